// How long something took, by the steady clock.
#pragma once

#include <chrono>

namespace fluorocut {

class Stopwatch {
  public:
    // Since it was made.
    double ms() const { return std::chrono::duration<double, std::milli>(Clock::now() - start_).count(); }

  private:
    using Clock = std::chrono::steady_clock;
    Clock::time_point start_ = Clock::now();
};

}  // namespace fluorocut
