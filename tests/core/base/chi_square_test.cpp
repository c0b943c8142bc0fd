#include "core/base/chi_square.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

namespace fluorocut {
namespace {

// Two, four and one degree of freedom have closed forms.
TEST(ChiSquare, TailsWithClosedForms) {
    for (const double x : {1e-3, 0.5, 2.0, 3.9, 4.1, 10.0, 60.0, 400.0}) {
        EXPECT_NEAR(chiSquareTail(x, 2) / std::exp(-x / 2), 1, 1e-10);
        EXPECT_NEAR(chiSquareTail(x, 4) / (std::exp(-x / 2) * (1 + x / 2)), 1, 1e-10);
        EXPECT_NEAR(chiSquareTail(x, 1) / std::erfc(std::sqrt(x / 2)), 1, 1e-9);
    }
    EXPECT_EQ(chiSquareTail(0, 6), 1);
    EXPECT_TRUE(std::isnan(chiSquareTail(NAN, 6)));
    EXPECT_THROW(static_cast<void>(chiSquareTail(1, 0)), std::logic_error);
}

TEST(ChiSquare, QuantilesOfTheTables) {
    EXPECT_NEAR(chiSquareQuantile(0.05, 1), 3.841459, 1e-6);
    EXPECT_NEAR(chiSquareQuantile(0.05, 6), 12.591587, 1e-6);
    EXPECT_NEAR(chiSquareQuantile(0.001, 6), 22.457744, 1e-6);
    EXPECT_NEAR(chiSquareQuantile(0.05, 100), 124.342113, 1e-5);
}

}  // namespace
}  // namespace fluorocut
