// Times of repeated work, for benchmarks.
#pragma once

#include <functional>
#include <vector>

#include "core/base/median.h"
#include "core/base/stopwatch.h"

namespace fluorocut::benchmark {

inline double timedMs(const std::function<void()>& work) {
    const Stopwatch stopwatch;
    work();
    return stopwatch.ms();
}

inline double medianMs(int rounds, const std::function<void()>& work) {
    std::vector<double> ms;
    for (int round = 0; round < rounds; ++round)
        ms.push_back(timedMs(work));
    return median(ms);
}

}  // namespace fluorocut::benchmark
