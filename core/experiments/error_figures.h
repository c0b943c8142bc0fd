// Errors of many trials in four numbers.
#pragma once

#include <limits>
#include <vector>

namespace fluorocut {

struct ErrorFigures {
    int count = 0;
    double mean = std::numeric_limits<double>::quiet_NaN();
    double rms = std::numeric_limits<double>::quiet_NaN();
    double percentile_95 = std::numeric_limits<double>::quiet_NaN();
    double largest = std::numeric_limits<double>::quiet_NaN();
};

// Of absolute values. None: NaN.
ErrorFigures figuresOf(std::vector<double> errors);

}  // namespace fluorocut
