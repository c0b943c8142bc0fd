// The outline of a cavity: as its mesh says it must look, and as the difference between an image after the cut and one
// before shows it. Ideal (undistorted) pixels of the whole image.
#pragma once

#include <optional>

#include "core/cavity/plane_contours.h"
#include "core/cavity/region_pixels.h"
#include "core/image/image.h"
#include "core/imaging/silhouette.h"

namespace fluorocut::cavity {

// The border of the mesh's shadow, one point each px or so. Nothing when it is not in front of the source.
std::optional<Contour> predictedOutline(const Silhouette& silhouette, const CArm& carm,
                                        const Rigid3& imager_from_cavity);

struct OutlineOptions {
    double blur_px = 1.5;                      // before anything is looked for
    double level = 0.35;                       // of the contrast inside, where the first contour runs
    double least_contrast = 3;                 // inside against the unrest outside, in its standard deviations
    double least_area = 0.5, most_area = 1.8;  // of the outline that is expected
    double most_shift = 0.5;                   // of the middles, in square roots of its area
};

// In `difference` (of the region; brighter where bone is gone; NaN: not known): the contour by marching squares at a
// level of the contrast that the expected outline has inside, drawn by a snake to where the difference is steepest.
// Nothing when there is no such contrast, or the contour is far from what is expected in size or place.
std::optional<Contour> detectedOutline(const Image& difference, const Region& region, const Contour& expected,
                                       const OutlineOptions& options = {});

}  // namespace fluorocut::cavity
