// What planning wants to know of the femur in a CT, found once for it: its shaft, where a stem would be seated, the
// walls of bone and canal, the canal's axis with its errors. And what a planned stem makes of it. Frame `femur`, mm.
#pragma once

#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/planning/femur_shaft.h"
#include "core/planning/line_fit.h"
#include "core/planning/templating.h"

namespace fluorocut {

struct FemurStudy {
    FemurShaft shaft;
    StemSeat seat;    // at the level where the neck may be cut
    BoneWalls walls;  // from the lowest level followed to a little above the seat, so that a tilted stem lies in them
    LineFit canal;    // through the middles of the canal's sections over the shaft; its direction is proximal
};

// Fails as findFemurShaft and findBoneWalls do.
Result<FemurStudy> studyFemur(const Volume& ct, const FemurShaftOptions& options = {},
                              Progress& progress = Progress::none());

struct StemInBone {
    std::vector<FillLevel> fill;
    LeastWall least_wall;  // anywhere beside the stem
    LeastWall least_cut;   // where it cuts into the cortex; NaN: it does not
};
Result<StemInBone> stemInBone(const Implant& implant, const Rigid3& femur_from_cavity, const FemurStudy& femur,
                              double level_step_mm = 20);

}  // namespace fluorocut
