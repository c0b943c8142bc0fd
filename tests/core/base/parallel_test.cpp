#include "core/base/parallel.h"

#include <atomic>
#include <numeric>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

namespace fluorocut {
namespace {

TEST(ParallelFor, VisitsEveryItemOnceInPiecesOfAtMostTheGrain) {
    std::vector<int> visits(1003, 0);
    std::atomic<std::size_t> longest = 0;
    parallelFor(visits.size(), 10, [&](std::size_t begin, std::size_t end) {
        std::size_t seen = longest;
        while (end - begin > seen && !longest.compare_exchange_weak(seen, end - begin)) {
        }
        for (std::size_t i = begin; i < end; ++i)
            visits[i]++;
    });
    EXPECT_EQ(visits, std::vector<int>(1003, 1));
    EXPECT_LE(longest, 10u);
}

TEST(ParallelFor, RethrowsAndCanBeNested) {
    EXPECT_THROW(parallelFor(10, 1, [](std::size_t, std::size_t) { throw std::runtime_error("x"); }),
                 std::runtime_error);
    std::atomic<int> sum = 0;
    parallelFor(4, 1, [&](std::size_t, std::size_t) {
        parallelFor(5, 1, [&](std::size_t begin, std::size_t end) { sum += static_cast<int>(end - begin); });
    });
    EXPECT_EQ(sum, 20);
}

TEST(ThreadLimit, HoldsForItsLifetime) {
    const int before = parallelThreads();
    {
        ThreadLimit limit(1);
        EXPECT_EQ(parallelThreads(), 1);
    }
    EXPECT_EQ(parallelThreads(), before);
}

}  // namespace
}  // namespace fluorocut
