#include "core/base/option_checks.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

TEST(RequireRange, NamesFieldValueAndLimits) {
    EXPECT_OK(requireRange("blur_px", 0, 0, 100, "px"));
    EXPECT_OK(requireRange("blur_px", 100, 0, 100, "px"));
    EXPECT_EQ(requireRange("blur_px", -1, 0, 100, "px").error().message(), "blur_px: found -1, expected 0 to 100 px.");
    EXPECT_EQ(requireRange("share", 1.5, 0, 1, "").error().message(), "share: found 1.5, expected 0 to 1.");
    EXPECT_FALSE(requireRange("blur_px", NAN, 0, 100, "px").ok());
}

TEST(RequireRanges, ReportsTheFirstThatFails) {
    EXPECT_OK(requireRanges({{"a", 1, 0, 2, "mm"}, {"b", 1, 0, 2, "mm"}}));
    EXPECT_EQ(requireRanges({{"a", 1, 0, 2, "mm"}, {"b", 3, 0, 2, "mm"}, {"c", 3, 0, 2, "mm"}}).error().where, "b");
}

}  // namespace
}  // namespace fluorocut
