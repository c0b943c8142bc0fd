// The corkscrew's rod for a workshop: a solid with a bore for the shaft and a groove for every wire.
//
// Frame `corkscrew`, mm. A groove is as wide as its wire, straight down to the wire's middle line and round below it: a
// wire laid in lies where the layout has it. The helix' groove ends in flat walls. Holes for the beads are not in the
// solid: they are drilled (the drawing says where).
#pragma once

#include "core/base/result.h"
#include "core/fabrication/drawing.h"
#include "core/fiducial/corkscrew_layout.h"
#include "core/geometry/triangle_mesh.h"

namespace fluorocut {

// Closed and turned outward. `segments`: around the axis. invalidOption: a layout that does not validate, or whose
// grooves cut into each other or into the bore.
Result<TriangleMesh> corkscrewRod(const CorkscrewLayout& layout, int segments = 360);

// Side view, end view with phase zero, the groove enlarged, places of rings, helix and beads.
Result<Drawing> drawCorkscrew(const CorkscrewLayout& layout);

// The rod's surface unrolled in true size, to be cut out and wrapped round the rod, print outward: rings, helix, beads.
Result<Drawing> drawCorkscrewTemplate(const CorkscrewLayout& layout);

}  // namespace fluorocut
