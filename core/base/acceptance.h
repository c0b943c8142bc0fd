// Acceptance: what a result was held against, one judgement for each limit. Limits are data (a struct of defaults next
// to what they judge), never an `if` inside an algorithm; a value that was never measured (NaN) is not accepted.
#pragma once

#include <string>
#include <vector>

namespace fluorocut {

struct Judgement {
    std::string what;  // "residual", as on the screen
    double value = 0;
    double least = 0;  // limits, inclusive; infinite where there is none
    double most = 0;
    std::string unit;  // "mm"; "" for a pure number

    bool accepted() const { return value >= least && value <= most; }
    // "residual 0.31 mm is over the limit of 0.25 mm", "residual 0.04 mm, limit 0.25 mm"
    std::string sentence() const;
};

Judgement atMost(std::string what, double value, double limit, std::string unit);
Judgement atLeast(std::string what, double value, double limit, std::string unit);

using Acceptance = std::vector<Judgement>;

// Nothing judged is not accepted.
bool accepted(const Acceptance& acceptance);

}  // namespace fluorocut
