// How a stem at a pose fills a bone whose walls are known, and what it leaves of them. Frame `femur`, mm.
#pragma once

#include <vector>

#include "core/base/result.h"
#include "core/planning/templating.h"

namespace fluorocut {

// Sections across the stem's own axis, from the resection down: widths along the stem's x and y, areas. Exact sections
// of the stem's mesh and of the canal's (core/geometry/mesh_section.h).
Result<std::vector<FillLevel>> stemFill(const Implant& implant, const Rigid3& femur_from_cavity, const BoneWalls& walls,
                                        double step_mm);

// Cortex between a place on the stem and the bone's outer surface: min(-o, c - o), c and o the distances to canal and
// outer surface there. `only_cut`: of places where the stem reaches into the cortex; NaN when there is none.
LeastWall leastWall(const Implant& implant, const Rigid3& femur_from_cavity, const BoneWalls& walls, bool only_cut);

}  // namespace fluorocut
