// A bead phantom that a workshop can make: for every plane of beads (parallel to the frame's xy plane) one sheet of
// acrylic with a blind hole for each bead, held apart by posts at the corners.
//
// Frame: the layout's. A sheet lies about its plane, half its thickness on either side. Holes are drilled from its +z
// face, flat bottomed; a bead touches the bottom, so a hole's depth is half the thickness and the bead's radius.
#pragma once

#include <vector>

#include "core/base/result.h"
#include "core/fabrication/drawing.h"
#include "core/fiducial/bead_layout.h"
#include "core/geometry/triangle_mesh.h"

namespace fluorocut {

struct BeadSheet {
    double plane_mm = 0;  // z of the beads' centres
    double thickness_mm = 0;
    Vector2 low = Vector2::Zero();  // outline, the same of all sheets of a phantom
    Vector2 high = Vector2::Zero();
    std::vector<Bead> beads;
    std::vector<Vector2> posts;  // middles of the through holes

    double holeDepth(const Bead& bead) const { return 0.5 * thickness_mm + 0.5 * bead.diameter_mm; }
};

inline constexpr double kPostHoleMm = 5.3;  // clearance of M5
inline constexpr double kHoleFitMm = 0.05;  // a hole is wider than its bead by this: a glued slip fit

// In order of z. invalidInput: more than 8 planes, planes so near that sheets would meet, beads in one plane so near
// that their holes would, or more than 400 in one plane.
Result<std::vector<BeadSheet>> beadSheets(const BeadLayout& layout);

// Closed and turned outward. Holes are prisms of 48 sides whose area is the circle's.
Result<TriangleMesh> sheetSolid(const BeadSheet& sheet);

// One sheet (number counts from 1): top view in true size, holes with numbers, section of a hole, table of holes from
// the datum corner.
Drawing drawSheet(const BeadSheet& sheet, int number, int count);

// All of it from the side, spacers, and the table of bead coordinates in the layout's frame.
Drawing drawAssembly(const BeadLayout& layout, const std::vector<BeadSheet>& sheets);

}  // namespace fluorocut
