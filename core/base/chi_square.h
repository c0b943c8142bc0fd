// The chi-square distribution: how likely squared residuals are, and what squares belong to a probability.
//     P(x; k) = gamma(k/2, x/2) / Gamma(k/2),  by its series below k/2 + 1 and its continued fraction above (Abramowitz
//     and Stegun 6.5.29, 6.5.31; Lentz's method). Relative error of the tail below 1e-10.
#pragma once

namespace fluorocut {

// The probability of a sum of squares of `degrees` standard normal numbers above `chi_square`. Throws std::logic_error
// for degrees < 1; NaN gives NaN.
double chiSquareTail(double chi_square, int degrees);

// The sum of squares that is exceeded with probability `tail`, in (0, 1).
double chiSquareQuantile(double tail, int degrees);

}  // namespace fluorocut
