// One image laid upon another of the same scene from a slightly different pose: the paper's alignment, and the
// difference that a cut leaves. Logarithms of levels; pixels.
#pragma once

#include <optional>
#include <vector>

#include "core/cavity/plane_contours.h"
#include "core/cavity/region_pixels.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"

namespace fluorocut::cavity {

// Between pixels; beyond the border that of the border.
float linearAt(const Image& image, const Vector2& pixel);
// By cubic convolution (Catmull and Rom): what is measured is not blurred.
float cubicAt(const Image& image, const Vector2& pixel);

// Turn, scale and shift: to = (a -b; b a) from + shift.
struct PlaneSimilarity {
    double a = 1, b = 0;
    Vector2 shift_px = Vector2::Zero();

    Vector2 operator*(const Vector2& from) const {
        return Vector2(a * from.x() - b * from.y(), b * from.x() + a * from.y()) + shift_px;
    }
    double scale() const;
    double angle() const;
};
PlaneSimilarity bestSimilarity(const Contour& from, const Contour& to);

// An image without its distortion, so that its C-arm is CArm::ideal(). Beyond what was imaged its border is repeated;
// where the distortion is not known stands the mean level.
Image idealImage(const Image& image, const CArm& carm);

// True inside the contours' outermost ones, and up to `margin_px` from them.
Mask filledMask(int width, int height, const std::vector<Contour>& contours, double margin_px);

struct Alignment {
    PlaneSimilarity before_from_after;  // pixels of the whole images
    double rms_log = 0;                 // that is left along the contours used
    int iterations = 0;
};

// Lays the outer contours of the bone, and whatever else is sharp (the corkscrew), upon each other: weighted least
// squares on high-passed logarithms where either image has strong edges and `mask` (of the region) is not set; from
// coarse to fine, and held near `start` where nothing tells. Nothing when there are no edges or it goes far from
// `start`.
std::optional<Alignment> alignImages(const Image& log_before, const Image& log_after, const Region& region,
                                     const Mask& mask, const PlaneSimilarity& start);

// The region of log_before as it lies upon the image after; NaN where it does not reach.
Image alignedBefore(const Image& log_before, const Region& region, const PlaneSimilarity& before_from_after);

// log_after of the region less `reference`, less what is slow (a polynomial of degree 2) and in proportion to the
// reference (another dose, scatter): these fitted where neither `mask` nor NaN is, outliers weighed down.
Image differenceFrom(const Image& reference, const Image& log_after, const Region& region, const Mask& mask);

}  // namespace fluorocut::cavity
