// Triangles of a polygon with holes: the faces of a drilled sheet, the cap of a solid that a plane has cut.
//
// Holes are joined to the outline by bridges (Eberly, "Triangulation by ear clipping", 2002), then ears are cut off.
// Only the given points are used, so that faces meet walls without a gap. O(n^2): for some thousand points.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/triangle_mesh.h"

namespace fluorocut {

// `outline` counter-clockwise, each hole clockwise, as indices of `points`; they must not touch. The triangles are
// counter-clockwise. noSolution for a polygon that crosses itself.
Result<std::vector<Triangle>> triangulate(const std::vector<Vector2>& points, const std::vector<std::int32_t>& outline,
                                          const std::vector<std::vector<std::int32_t>>& holes);

}  // namespace fluorocut
