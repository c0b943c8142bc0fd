#include "core/distortion/models/cubic_spline.h"

#include <algorithm>
#include <stdexcept>
#include <vector>

namespace fluorocut {

void cubicSplineWeights(std::span<const double> knots, double x, int derivative, std::span<double> weights) {
    const std::size_t n = knots.size();
    if (n < 4 || weights.size() != n) throw std::logic_error("cubicSplineWeights: fewer than 4 knots");
    const auto step = [&](std::size_t i) { return knots[i + 1] - knots[i]; };

    // s(x) = a y[k] + b y[k+1] + c M[k] + d M[k+1], with M the second derivatives at the knots.
    const auto after = std::upper_bound(knots.begin() + 1, knots.end() - 1, x);
    const auto k = static_cast<std::size_t>(after - knots.begin()) - 1;
    const double h = step(k), b = (x - knots[k]) / h, a = 1 - b;
    std::fill(weights.begin(), weights.end(), 0);
    thread_local std::vector<double> load, diagonal;
    load.assign(n, 0);
    diagonal.resize(n);
    if (derivative == 0) {
        weights[k] = a;
        weights[k + 1] = b;
        load[k] = (a * a * a - a) * h * h / 6;
        load[k + 1] = (b * b * b - b) * h * h / 6;
    } else {
        weights[k] = -1 / h;
        weights[k + 1] = 1 / h;
        load[k] = -(3 * a * a - 1) * h / 6;
        load[k + 1] = (3 * b * b - 1) * h / 6;
    }
    // Not-a-knot: M[0] = M[1] + (M[1] - M[2]) h0 / h1, and alike at the other end: two unknowns fewer.
    const double first = step(0) / step(1), last = step(n - 2) / step(n - 3);
    load[1] += load[0] * (1 + first);
    load[2] -= load[0] * first;
    load[n - 2] += load[n - 1] * (1 + last);
    load[n - 3] -= load[n - 1] * last;
    // The rest is a tridiagonal system A M = r with r[i] = 6 (slope[i] - slope[i-1]). The weights need the solution of
    // A^T z = load: Thomas's algorithm with rows and columns exchanged.
    const auto entry = [&](std::size_t row, std::size_t column) {  // of A, inner rows 1 ... n - 2
        double value = row == column ? 2 * (step(row - 1) + step(row)) : step(std::min(row, column));
        if (row == 1 && column == 1) value += step(0) * (1 + first);
        if (row == 1 && column == 2) value -= step(0) * first;
        if (row == n - 2 && column == n - 2) value += step(n - 2) * (1 + last);
        if (row == n - 2 && column == n - 3) value -= step(n - 2) * last;
        return value;
    };
    diagonal[1] = entry(1, 1);
    for (std::size_t i = 2; i + 1 < n; ++i) {
        const double factor = entry(i - 1, i) / diagonal[i - 1];
        diagonal[i] = entry(i, i) - factor * entry(i, i - 1);
        load[i] -= factor * load[i - 1];
    }
    for (std::size_t i = n - 2; i >= 1; --i) {
        if (i + 2 < n) load[i] -= entry(i + 1, i) * load[i + 1];
        load[i] /= diagonal[i];
        weights[i - 1] += 6 * load[i] / step(i - 1);
        weights[i] -= 6 * load[i] * (1 / step(i - 1) + 1 / step(i));
        weights[i + 1] += 6 * load[i] / step(i);
    }
}

}  // namespace fluorocut
