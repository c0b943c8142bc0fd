// Which shadow is which bead once the pose is nearly known: one to one, nearest pairs first. Ideal pixels.
#pragma once

#include <vector>

#include "core/fiducial/bead_bundle.h"
#include "core/fiducial/bead_pose.h"

namespace fluorocut::detection {

// In the order of the layout.
std::vector<BeadMatch> matchBeads(const BeadLayout& layout, const std::vector<Vector2>& shadows_ideal_px,
                                  const PixelIntrinsics& intrinsics, const Rigid3& imager_from_layout,
                                  double tolerance_px);

}  // namespace fluorocut::detection
