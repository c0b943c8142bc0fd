#include "core/robot/checked_motion.h"

#include <limits>
#include <stdexcept>
#include <type_traits>

#include <gtest/gtest.h>

#include "tests/core/robot/motions.h"

namespace fluorocut {
namespace {

// Nobody makes a token or a checked motion from nothing, and a proposal stays as it was checked.
static_assert(!std::is_default_constructible_v<CheckToken>);
static_assert(!std::is_default_constructible_v<CheckedMotion>);
static_assert(!std::is_constructible_v<CheckToken, std::shared_ptr<const MotionProposal>, std::string>);
static_assert(!std::is_copy_assignable_v<MotionProposal>);

std::vector<MotionStep> line(double length_mm, double feed_mm_s) {
    return {{Rigid3(), feed_mm_s}, {Rigid3::fromTranslation({length_mm, 0, 0}), feed_mm_s}};
}

class ShortSightedChecker : public MotionChecker {
  public:
    std::string name() const override { return "short"; }

  private:
    Result<void> judge(const MotionProposal& proposal) const override {
        if (proposal.steps.back().robot_from_cutter.translation().norm() <= 50) return {};
        return noSolution("path", "an end too far", "one within 50 mm");
    }
};

TEST(CheckedMotion, HoldsWhatWasChecked) {
    const auto motion = tryMotion(line(10, 20), "stage 2", "registration 3");
    ASSERT_TRUE(motion);
    EXPECT_EQ(motion->stage(), "stage 2");
    EXPECT_EQ(motion->registration(), "registration 3");
    EXPECT_EQ(motion->firstChecker(), "one");
    EXPECT_EQ(motion->secondChecker(), "two");
    ASSERT_EQ(motion->steps().size(), 2U);
    EXPECT_EQ(motion->steps()[1].robot_from_cutter.translation().x(), 10);
    EXPECT_TRUE(motion->sameAs(*motion));
    EXPECT_FALSE(motion->sameAs(*tryMotion(line(10, 20), "stage 2", "registration 3")));
}

TEST(CheckedMotion, ACheckersNoGivesNoToken) {
    const auto steps = [](double length) {
        return std::make_shared<const MotionProposal>(MotionProposal{"s", "r", line(length, 20)});
    };
    EXPECT_TRUE(ShortSightedChecker().check(steps(50)));
    EXPECT_EQ(ShortSightedChecker().check(steps(51)).error().found, "an end too far");
    EXPECT_THROW((void)ShortSightedChecker().check(nullptr), std::logic_error);
}

TEST(CheckedMotion, TakesTwoDifferentCheckersOfOneMotion) {
    const auto proposal = std::make_shared<const MotionProposal>(MotionProposal{"s", "r", line(10, 20)});
    const auto twin = std::make_shared<const MotionProposal>(MotionProposal{"s", "r", line(10, 20)});
    const AgreeableChecker one("one"), two("two");
    const CheckToken token = one.check(proposal).value();
    EXPECT_EQ(CheckedMotion::make(token, token).error().found, "two checks by 'one'");
    EXPECT_EQ(CheckedMotion::make(token, two.check(twin).value()).error().found, "checks of two different motions");
    EXPECT_TRUE(CheckedMotion::make(token, two.check(proposal).value()));
}

TEST(CheckedMotion, RefusesNumbersOutOfOrder) {
    const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
    for (const double feed : {nan, inf, 0.0, -1.0, 60.001}) {
        const auto motion = tryMotion(line(10, feed));
        ASSERT_FALSE(motion) << feed;
        EXPECT_EQ(motion.error().where, "motion, step 1");
        EXPECT_NE(motion.error().found.find("feed"), std::string::npos);
    }
    EXPECT_TRUE(tryMotion(line(10, 60)));
    EXPECT_TRUE(tryMotion(line(200, 20)));
    EXPECT_NE(tryMotion(line(200.1, 20)).error().found.find("jump of 200.1"), std::string::npos);
    std::vector<MotionStep> turn = line(10, 20);
    turn[1].robot_from_cutter = Rigid3::fromRotationVector({0, 0.59, 0});
    EXPECT_TRUE(tryMotion(turn));
    turn[1].robot_from_cutter = Rigid3::fromRotationVector({0, 0.61, 0});
    EXPECT_NE(tryMotion(turn).error().found.find("turn"), std::string::npos);
    EXPECT_EQ(tryMotion({}).error().found, "0 steps");
    EXPECT_EQ(tryMotion({{Rigid3(), 20}}).error().found, "1 steps");
    // A pose that is not finite is none.
    EXPECT_THROW(Rigid3::fromTranslation({nan, 0, 0}), std::logic_error);
    MotionLimits limits;
    limits.most_feed_mm_s = nan;
    EXPECT_EQ(limits.validate().error().where, "most_feed_mm_s");
}

}  // namespace
}  // namespace fluorocut
