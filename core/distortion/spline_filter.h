// Cubic B-spline coefficients of images: interpolation that passes through every pixel and is C2 between them
// (Unser, IEEE Signal Processing Magazine 16(6), 1999). The image goes on mirrored at its borders.
#pragma once

#include <array>

#include "core/image/image.h"

namespace fluorocut {

// Coefficients in place of values, along the rows or along the columns; both for a surface.
void splineFilterRows(Image& image);
void splineFilterColumns(Image& image);

// Weights of the coefficients at floor(x) - 1 ... floor(x) + 2 for t = x - floor(x).
inline std::array<float, 4> splineWeights(float t) {
    const float s = 1 - t;
    return {s * s * s / 6, 2.0F / 3 - t * t * (1 - t / 2), 2.0F / 3 - s * s * (1 - s / 2), t * t * t / 6};
}

}  // namespace fluorocut
