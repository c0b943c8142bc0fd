// What dewarping did to an image, as in the paper's Figure 4: the image, the points found on the grooves, the grooves
// as the map has them, the straight image, and how far each place was moved.
#pragma once

#include "core/distortion/distortion_map.h"
#include "core/distortion/groove_detection.h"
#include "core/image/image.h"

namespace fluorocut::cli {

Result<ColorImage> dewarpFigure(const Image& image, const GrooveDetection& grooves, const DistortionMap& map);

}  // namespace fluorocut::cli
