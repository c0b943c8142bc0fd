// The truth of a virtual operating room. ONLY for tests, error reports and simulated adaptors: an estimator that can
// see it proves nothing (tests/architecture refuses this include anywhere else).
#pragma once

#include <memory>
#include <vector>

#include "core/simulation/virtual_operating_room.h"

namespace fluorocut {

// What was true when one image was taken.
struct ViewTruth {
    CArm carm;  // with its true focal length, image centre and distortion
    Rigid3 imager_from_room;
    Rigid3 imager_from_femur;
    Rigid3 imager_from_robot;
    XrayOptions xray;  // as used, with the exposure's seed
};

struct Truth {
    std::shared_ptr<const Volume> patient;
    double mu_water_per_mm = 0;
    Rigid3 room_from_femur;
    Rigid3 room_from_robot;
    std::vector<HeldObject> objects;  // as they are held now
    std::vector<ViewTruth> views;     // by ImageProvenance::sequence
};

const Truth& truthOf(const VirtualOperatingRoom& room);

}  // namespace fluorocut
