#include "core/planning/femur_study.h"

#include <utility>

#include "core/planning/measures.h"
#include "core/planning/stem_fill.h"

namespace fluorocut {
namespace {

constexpr double kAboveSeatMm = 6;

}  // namespace

Result<FemurStudy> studyFemur(const Volume& ct, const FemurShaftOptions& options, Progress& progress) {
    SubProgress finding(progress, 0, 0.4), walling(progress, 0.4, 1);
    Result<FemurShaft> shaft = findFemurShaft(ct, options, finding);
    if (!shaft) return shaft.error();
    const AxisLine axis = shaft->axis;
    const AxisLine longer{axis.distal, axis.proximal + kAboveSeatMm * axis.direction()};
    Result<BoneWalls> walls = findBoneWalls(ct, longer, {}, walling);
    if (!walls) return walls.error();
    LineFit canal = canalAxis(*walls, 0, (axis.proximal - axis.distal).norm());
    const StemSeat seat{axis.proximal, axis.direction(), shaft->medial, shaft->side};
    return FemurStudy{std::move(*shaft), seat, std::move(*walls), canal};
}

Result<StemInBone> stemInBone(const Implant& implant, const Rigid3& femur_from_cavity, const FemurStudy& femur,
                              double level_step_mm) {
    Result<std::vector<FillLevel>> fill = stemFill(implant, femur_from_cavity, femur.walls, level_step_mm);
    if (!fill) return fill.error();
    return StemInBone{std::move(*fill), leastWall(implant, femur_from_cavity, femur.walls, false),
                      leastWall(implant, femur_from_cavity, femur.walls, true)};
}

}  // namespace fluorocut
