// Where a corkscrew is that was expected nearby: for following it from image to image. Up to 6 mm across the ray and 4
// degrees away; near enough to what is true for a shape fit to start from.
//
// The expected wires' picture is shifted, turned in the plane and rolled over the ridges of the image; the best few are
// polished as the search does it. A scan of the twist must put the answer's helix in front: whoever comes with a pose
// of another twist, or of another picture, is sent to the search.
#pragma once

#include <optional>

#include "core/fiducial/corkscrew_layout.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"

namespace fluorocut::corkscrew {

struct NearPose {
    Rigid3 imager_from_corkscrew;
    bool metal_is_bright = false;
};

// Nothing: no corkscrew there, or another twist explains the helix better.
std::optional<NearPose> poseNear(const Image& image, const CArm& carm, const CorkscrewLayout& layout,
                                 const Rigid3& expected);

}  // namespace fluorocut::corkscrew
