// A femur, a cavity planned in it, the cavity that was cut instead, and X-rays before and after: what the paper's Table
// 3 was made of, for every way of locating a cavity.
//
// The built-in femur as a CT; the cavity of an implant of the built-in library, its axis along the shaft. The cut lies
// off the plan by
//
//     planned_from_cut = T(x, y, z) Rz(yaw) Ry(pitch) Rx(roll), about the cavity's middle, in its frame `cavity`
//
// (the paper does not say about what; its errors show that yaw is about the stem's axis). Two views, to either side of
// the front; before and after the C-arm stands somewhere else by up to `pose_way_mm` and `pose_turn_rad`.
//
// No inverse crime: line integrals ray by ray around the cavity (`exact`; estimators use `fast`), and what the cut
// takes out is made on a grid of half the CT's voxels, not by the voxels of the CT. Focal spot, scatter, glare, blur,
// noise, 12 bits (core/imaging/xray_physics.h). The poses handed out are off by what a corkscrew leaves unknown.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/random.h"
#include "core/base/result.h"
#include "core/base/units.h"
#include "core/cavity/cavity_location.h"

namespace fluorocut {

struct CavitySceneOptions {
    double voxel_mm = 0.8;
    std::string implant = "straight";
    double pixel_mm = 0.32;
    double view_angle_rad = radiansFromDegrees(55);  // between the two
    double pose_way_mm = 40;                         // between before and after: up to
    double pose_turn_rad = radiansFromDegrees(5);
    double photons = 20000;  // in the open beam
    // Standard deviations of the poses that are handed out, about the cavity's middle.
    ViewPoseUncertainty pose_error{0.1, 0.5, radiansFromDegrees(0.1)};
    double fill_hu = -1000;
    // Of the CT that is handed out: blurred by 0.6 voxel, 5 % wrong scale, noise of 20 HU.
    bool imperfect_ct = false;

    Result<void> validate() const;
};

// A motion off the plan, as Table 3 has it.
struct CavityOffset {
    Vector3 shift_mm = Vector3::Zero();
    Vector3 roll_pitch_yaw_rad = Vector3::Zero();

    // Rigid3 planned_from_cut, about `middle`.
    Rigid3 about(const Vector3& middle) const;
    static CavityOffset from(const Rigid3& planned_from_cut, const Vector3& middle);
};

// What does not change from cut to cut.
struct CavityPatient {
    std::shared_ptr<const Volume> ct;        // that images are made of
    std::shared_ptr<const Volume> known_ct;  // that estimators are given
    TriangleMesh cavity;
    Vector3 middle;  // of the cavity, in its frame
    Rigid3 planned_femur_from_cavity;
};
Result<CavityPatient> makeCavityPatient(const CavitySceneOptions& options, Progress& progress = Progress::none());

struct CavityScene {
    Rigid3 truth_femur_from_cavity;  // for judging
    std::vector<CavityView> views;   // poses as they are known
};
Result<CavityScene> makeCavityScene(const CavityPatient& patient, const CavitySceneOptions& options,
                                    const CavityOffset& offset, Random& random);

}  // namespace fluorocut
