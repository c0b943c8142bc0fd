// Interpolating cubic splines as weights of the values: s(x) = w . values. Not-a-knot ends (de Boor 1978, IV).
#pragma once

#include <span>

namespace fluorocut {

// weights[i] of the value at knots[i] for the spline (derivative 0) or its slope (derivative 1) at x. At least 4 knots,
// increasing.
void cubicSplineWeights(std::span<const double> knots, double x, int derivative, std::span<double> weights);

}  // namespace fluorocut
