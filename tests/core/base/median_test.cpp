#include "core/base/median.h"

#include <cmath>

#include <gtest/gtest.h>

namespace fluorocut {
namespace {

TEST(Median, IsTheOneInTheMiddle) {
    EXPECT_EQ(median(std::vector<double>{7}), 7);
    EXPECT_EQ(median(std::vector<double>{9, -1, 4}), 4);
    EXPECT_EQ(median(std::vector<float>{4, 1, 3, 2}), 3);  // the larger of the two
}

TEST(Median, OfNothingIsNotANumber) {
    EXPECT_TRUE(std::isnan(median(std::vector<double>{})));
}

}  // namespace
}  // namespace fluorocut
