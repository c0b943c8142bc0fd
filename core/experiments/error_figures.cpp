#include "core/experiments/error_figures.h"

#include <algorithm>
#include <cmath>

namespace fluorocut {

ErrorFigures figuresOf(std::vector<double> errors) {
    ErrorFigures figures;
    if (errors.empty()) return figures;
    for (double& error : errors)
        error = std::abs(error);
    std::sort(errors.begin(), errors.end());
    const double count = static_cast<double>(errors.size());
    double sum = 0, squares = 0;
    for (const double error : errors) {
        sum += error;
        squares += error * error;
    }
    figures.count = static_cast<int>(errors.size());
    figures.mean = sum / count;
    figures.rms = std::sqrt(squares / count);
    figures.percentile_95 = errors[static_cast<std::size_t>(std::ceil(0.95 * count)) - 1];
    figures.largest = errors.back();
    return figures;
}

}  // namespace fluorocut
