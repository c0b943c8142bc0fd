#include "core/experiments/error_figures.h"

#include <cmath>

#include <gtest/gtest.h>

namespace fluorocut {
namespace {

TEST(ErrorFigures, AreTheTextbooks) {
    std::vector<double> errors;
    for (int i = 1; i <= 100; ++i)
        errors.push_back(i % 2 ? i : -i);
    const ErrorFigures figures = figuresOf(errors);
    EXPECT_EQ(figures.count, 100);
    EXPECT_DOUBLE_EQ(figures.mean, 50.5);
    EXPECT_DOUBLE_EQ(figures.rms, std::sqrt(101 * 201 / 6.0));
    EXPECT_EQ(figures.percentile_95, 95);
    EXPECT_EQ(figures.largest, 100);
}

TEST(ErrorFigures, OfNothingAreNotANumber) {
    const ErrorFigures figures = figuresOf({});
    EXPECT_EQ(figures.count, 0);
    EXPECT_TRUE(std::isnan(figures.mean) && std::isnan(figures.largest));
}

}  // namespace
}  // namespace fluorocut
