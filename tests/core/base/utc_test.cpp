#include "core/base/utc.h"

#include <cmath>

#include <gtest/gtest.h>

namespace fluorocut {
namespace {

TEST(Utc, CountsDays) {
    EXPECT_EQ(daysFromUtc("1970-01-02T12:00:00Z"), 1.5);
    EXPECT_EQ(*daysFromUtc("2024-03-01T00:00:00Z") - *daysFromUtc("2024-02-28T00:00:00Z"), 2);  // a leap year
    for (const char* bad :
         {"", "2026-03-01", "2026-02-30T00:00:00Z", "2026-03-01T24:00:00Z", "2026-03-01T09:30:00+1",
          "2026-03-01T09:30:00.Z", "2026-03-01T09:30:00.12", "2026-03-01T09:30:00,12Z", "2026-03-01T09:30:00.1x5Z"}) {
        EXPECT_FALSE(daysFromUtc(bad).has_value()) << bad;
    }
}

TEST(Utc, TellsSecondsApart) {
    // 20,000 days with an epsilon of 4e-12 are 3e-7 s.
    EXPECT_NEAR(secondsBetween("2026-03-01T09:30:00Z", "2026-03-01T09:30:00.125Z"), 0.125, 1e-6);
    EXPECT_NEAR(secondsBetween("2026-03-01T00:00:00.5Z", "2026-02-28T23:59:59Z"), -1.5, 1e-6);
    EXPECT_TRUE(std::isnan(secondsBetween("", "2026-03-01T09:30:00Z")));
    EXPECT_TRUE(std::isnan(secondsBetween("2026-03-01T09:30:00Z", "soon")));
}

}  // namespace
}  // namespace fluorocut
