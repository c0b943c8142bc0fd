#include "core/base/random.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace fluorocut {
namespace {

TEST(Random, IsTheSameOnEveryMachine) {
    // xoshiro256++ seeded with splitmix64(0), from an independent implementation of both published algorithms.
    Random random(0);
    const std::uint64_t first = random.bits();
    EXPECT_EQ(Random(0).bits(), first);
    EXPECT_NE(Random(1).bits(), first);
    EXPECT_EQ(first, 5987356902031041503u);
}

TEST(Random, ForksAreIndependentOfHowMuchTheParentWasUsed) {
    Random a(7);
    const Random b(7);
    (void)a.bits();
    EXPECT_EQ(a.fork(3).bits(), b.fork(3).bits());
    EXPECT_NE(a.fork(3).bits(), a.fork(4).bits());
}

TEST(Random, NormalHasItsMoments) {
    Random random(11);
    const int n = 200000;
    double sum = 0, sum2 = 0, sum4 = 0;
    for (int i = 0; i < n; ++i) {
        const double x = random.normal();
        sum += x;
        sum2 += x * x;
        sum4 += x * x * x * x;
    }
    // Five standard errors of the mean, variance and fourth moment of 200,000 draws.
    EXPECT_NEAR(sum / n, 0, 5 / std::sqrt(n));
    EXPECT_NEAR(sum2 / n, 1, 5 * std::sqrt(2.0 / n));
    EXPECT_NEAR(sum4 / n, 3, 5 * std::sqrt(96.0 / n));
}

// Chi-square of the draws against the exact probabilities, on both sides of the change of algorithm at 10.
TEST(Random, PoissonHasItsDistribution) {
    for (const double mean : {0.3, 4.0, 9.99, 10.0, 37.5, 1000.0}) {
        Random random(5);
        const int n = 200000;
        const int low = std::max(0, static_cast<int>(mean - 3 * std::sqrt(mean)));
        const int high = static_cast<int>(mean + 3 * std::sqrt(mean)) + 1;
        std::vector<int> count(static_cast<std::size_t>(high - low + 2), 0);
        for (int i = 0; i < n; ++i) {
            const int k = static_cast<int>(random.poisson(mean));
            count[static_cast<std::size_t>(k < low ? high - low + 1 : k > high ? high - low + 1 : k - low)]++;
        }
        double chi2 = 0, inside = 0;
        int cells = 0;
        for (int k = low; k <= high; ++k) {
            const double p = std::exp(-mean + k * std::log(mean) - std::lgamma(k + 1.0));
            inside += p;
            if (n * p < 10) continue;
            const double d = count[static_cast<std::size_t>(k - low)] - n * p;
            chi2 += d * d / (n * p);
            ++cells;
        }
        EXPECT_LT(chi2, cells + 5 * std::sqrt(2.0 * cells)) << "mean " << mean;
        const double outside = count.back() - n * (1 - inside);
        EXPECT_LT(std::abs(outside), 6 * std::sqrt(n * (1 - inside)) + 1) << "mean " << mean;
    }
}

TEST(Random, BelowStaysBelowAndReachesEverything) {
    Random random(1);
    std::vector<int> count(7, 0);
    for (int i = 0; i < 7000; ++i)
        count[random.below(7)]++;
    for (int c : count)
        EXPECT_NEAR(c, 1000, 5 * std::sqrt(1000.0));
    EXPECT_THROW((void)random.below(0), std::logic_error);
}

}  // namespace
}  // namespace fluorocut
