// Where a femur's shaft stands in a CT, found in the CT itself: the canal's axis below the neck, on which side the head
// lies, and a level at which the neck may be cut. Frame `femur` (DICOM LPS), mm.
//
// The lowest sections in which a closed ring of cortex is found are followed upward, marrow after marrow
// (core/planning/bone_section.h). Then
//
//     axis        line through the marrow's middles where the section's area is within 15 % of the shaft's
//     medial      across the axis, toward the middle of all bone more than 30 mm from it: head and neck
//     resection   the lowest level, going up, at which the bone's edge toward the head lies `neck_ratio` times as far
//                 from the axis as it does in the shaft: at a neck-shaft angle of 127 degrees some 10 to 15 mm above
//                 the lesser trochanter's tip, which lies behind that direction and does not count
//
// A femur whose neck is gone, or whose shaft the CT shows less than 40 mm of, is refused: then the caller gives an
// axis.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/image/volume.h"
#include "core/planning/bone_walls.h"
#include "core/planning/implant.h"

namespace fluorocut {

struct FemurShaftOptions {
    std::optional<Side> side;      // which of two femurs; unset: the one there is
    std::optional<AxisLine> axis;  // given: its proximal end is the resection's level; nothing is searched but the head
    double neck_ratio = 1.85;

    Result<void> validate() const;
};

struct FemurShaft {
    AxisLine axis;                      // from the lowest level followed to the resection
    Vector3 medial = Vector3::UnitX();  // unit, across the axis
    Side side = Side::left;             // by the side of the axis on which the head lies (LPS: left femur, head at -x)
    std::vector<Vector3> centers;       // marrow's middles that the axis was fitted to
    double rms_mm = 0;                  // of their distances from the axis (the bow is in it)
};

Result<FemurShaft> findFemurShaft(const Volume& ct, const FemurShaftOptions& options = {},
                                  Progress& progress = Progress::none());

}  // namespace fluorocut
