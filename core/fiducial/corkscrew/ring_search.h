// Along a line that might be the shaft: where do rings lie as those of the layout would, and from which distance and at
// which roll? Full perspective, both directions of the axis.
//
// In the plane through source and line, with s along the line (px, from the foot of the perpendicular from the
// principal point) and f' the foot's distance from the source (px), a point (X, W) of the axis projects to s = f' X /
// W. A ring of radius R there is an ellipse of half axes a = R f' / W across the line and a |cos| along it, cos being
// the cosine between the axis and the ray through the ring's middle. All ellipses are looked up, (a, a cos, s), once
// per line; then place, distance and roll of the whole pattern are a few look-ups each.
#pragma once

#include <vector>

#include "core/fiducial/corkscrew/ridge_map.h"
#include "core/fiducial/corkscrew/shaft_lines.h"
#include "core/fiducial/corkscrew_detection.h"

namespace fluorocut::corkscrew {

struct AxisGuess {
    Rigid3 imager_from_corkscrew;  // with any twist
    double score = 0;              // of its rings: each 0 by chance, 0.75 when seen all round
};

// Best first. `ridges`: of the wires, dilated.
std::vector<AxisGuess> ringPatterns(const RidgeMap& ridges, const CArm& ideal, const CorkscrewLayout& layout,
                                    const ImageLine& line, const CorkscrewDetectionOptions& options, int most);

}  // namespace fluorocut::corkscrew
