// A picture of a corkscrew with the lines of a pose drawn over it: for eyes that check a pose.
#pragma once

#include "core/fiducial/corkscrew_layout.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"

namespace fluorocut::cli {

// Left the picture, right the same with shaft, rings, helix and beads where `imager_from_corkscrew` has them, and the
// corkscrew's axes (x vermilion, y green, z blue).
ColorImage corkscrewFigure(const Image& image, const CArm& carm, const CorkscrewLayout& layout,
                           const Rigid3& imager_from_corkscrew);

}  // namespace fluorocut::cli
