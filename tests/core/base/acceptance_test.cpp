#include "core/base/acceptance.h"

#include <limits>

#include <gtest/gtest.h>

namespace fluorocut {
namespace {

constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();

TEST(Acceptance, LimitsAreInclusiveAndWhatWasNotMeasuredFails) {
    EXPECT_TRUE(atMost("residual", 0.25, 0.25, "mm").accepted());
    EXPECT_FALSE(atMost("residual", 0.2501, 0.25, "mm").accepted());
    EXPECT_TRUE(atLeast("coverage", 0.5, 0.5, "").accepted());
    EXPECT_FALSE(atLeast("coverage", 0.49, 0.5, "").accepted());
    EXPECT_FALSE(atMost("residual", kNotMeasured, 0.25, "mm").accepted());
    EXPECT_FALSE(atLeast("coverage", kNotMeasured, 0.5, "").accepted());
}

TEST(Acceptance, OneFailureOrNoJudgementAtAllIsNotAccepted) {
    EXPECT_FALSE(accepted({}));
    EXPECT_TRUE(accepted({atMost("a", 1, 2, ""), atLeast("b", 3, 2, "")}));
    EXPECT_FALSE(accepted({atMost("a", 1, 2, ""), atLeast("b", 1, 2, "")}));
}

TEST(Acceptance, SaysWhatAndWhy) {
    EXPECT_EQ(atMost("residual", 0.04, 0.25, "mm").sentence(), "residual 0.04 mm, limit 0.25 mm");
    EXPECT_EQ(atMost("residual", 0.31, 0.25, "mm").sentence(), "residual 0.31 mm is over the limit of 0.25 mm");
    EXPECT_EQ(atLeast("coverage", 0.4, 0.5, "").sentence(), "coverage 0.4 is under the limit of 0.5");
    EXPECT_EQ(atLeast("coverage", kNotMeasured, 0.5, "").sentence(), "coverage was not measured, limit 0.5");
}

}  // namespace
}  // namespace fluorocut
