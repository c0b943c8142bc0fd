#include "core/base/result.h"

#include <string>

#include <gtest/gtest.h>

namespace fluorocut {
namespace {

TEST(Result, HoldsAValueOrTheErrorThatExplainsItsAbsence) {
    const Result<int> good = 3;
    const Result<int> bad = noSolution("image 2", "no ring", "four rings", "raise the exposure");
    ASSERT_TRUE(good.ok());
    EXPECT_EQ(*good, 3);
    ASSERT_FALSE(bad.ok());
    EXPECT_EQ(bad.error().message(), "image 2: found no ring, expected four rings; raise the exposure.");
}

TEST(Result, ReadingTheWrongSideIsABrokenContract) {
    const Result<std::string> good = std::string("x");
    const Result<std::string> bad = invalidInput("a", "b", "c");
    EXPECT_THROW((void)good.error(), std::logic_error);
    EXPECT_THROW((void)bad.value(), std::logic_error);
    EXPECT_THROW((void)Result<void>().error(), std::logic_error);
}

TEST(Error, CancellationIsNotAFailureMessage) {
    EXPECT_TRUE(cancelled("projection").isCancelled());
    EXPECT_EQ(cancelled("projection").message(), "projection: cancelled.");
}

}  // namespace
}  // namespace fluorocut
