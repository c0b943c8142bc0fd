#include "core/base/chi_square.h"

#include <cmath>
#include <limits>
#include <stdexcept>

namespace fluorocut {

double chiSquareTail(double chi_square, int degrees) {
    if (degrees < 1) throw std::logic_error("chiSquareTail: no degrees of freedom");
    if (std::isnan(chi_square)) return chi_square;
    if (!(chi_square > 0)) return 1;
    if (std::isinf(chi_square)) return 0;
    const double a = 0.5 * degrees, x = 0.5 * chi_square;
    int sign;  // std::lgamma writes a global
    const double scale = std::exp(a * std::log(x) - x - ::lgamma_r(a, &sign));
    constexpr double kSmall = 1e-15;
    if (x < a + 1) {
        double term = 1 / a, sum = term;
        for (double n = a + 1; term > kSmall * sum; n += 1) {
            term *= x / n;
            sum += term;
        }
        return 1 - scale * sum;
    }
    constexpr double kTiny = 1e-300;
    double b = x + 1 - a, c = 1 / kTiny, d = 1 / b, value = d;
    for (int n = 1; n < 10'000; ++n) {
        const double an = -n * (n - a);
        b += 2;
        d = an * d + b;
        if (std::abs(d) < kTiny) d = kTiny;
        c = b + an / c;
        if (std::abs(c) < kTiny) c = kTiny;
        d = 1 / d;
        value *= d * c;
        if (std::abs(d * c - 1) < kSmall) break;
    }
    return scale * value;
}

double chiSquareQuantile(double tail, int degrees) {
    if (!(tail > 0 && tail < 1)) throw std::logic_error("chiSquareQuantile: a probability outside of (0, 1)");
    double low = 0, high = degrees;
    while (chiSquareTail(high, degrees) > tail)
        high *= 2;
    for (int i = 0; i < 200 && high - low > 1e-13 * high; ++i) {
        const double middle = 0.5 * (low + high);
        (chiSquareTail(middle, degrees) > tail ? low : high) = middle;
    }
    return 0.5 * (low + high);
}

}  // namespace fluorocut
