#include "core/procedure/cut_run.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>

#include "core/robot/adaptors/simulated_robot.h"
#include "tests/core/robot/motions.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using testing::HasSubstr;

// Something happens in the middle of the cut.
class Meanwhile final : public Progress {
  public:
    explicit Meanwhile(std::function<void()> what) : what_(std::move(what)) {}
    void report(double fraction, std::string_view) override {
        if (fraction < 0.4 || !what_) return;
        what_();
        what_ = nullptr;
    }
    bool isCancelled() const override { return cancelled; }
    bool cancelled = false;

  private:
    std::function<void()> what_;
};

class CutRunTest : public testing::Test {
  protected:
    void SetUp() override {
        auto robot = std::make_unique<SimulatedRobot>();
        robot_ = robot.get();
        supervisor_ = std::make_unique<Supervisor>(std::move(robot));
        const Result<RobotFeedback> standing = whereItStands(*supervisor_);
        ASSERT_OK(standing);
        start_ = standing->robot_from_cutter;
        std::vector<MotionStep> steps{{start_, 20}};
        for (const double x : {10.0, 20.0, 0.0})
            steps.push_back({Rigid3(start_.rotation(), start_.translation() + Vector3(x, 0, 0)), 20});
        request_.registration = {"registration 7", "Dr Ito", true, "", 120, 0.4};
        request_.inset_mm = 0;
        request_.motion = tryMotion(steps).value();
        request_.time_out = {{"P-1", "P-1"}, {"left", "left"}, {"stem 4", "stem 4"}, {"stage 1", "stage 1"}, 3600,
                             true,           "Dr Ito"};
    }

    // Why it ended; nothing moves, and nothing can be resumed.
    std::string endOf(Progress& progress = Progress::none()) {
        const Result<void> done = runCut(*supervisor_, request_, run_, progress);
        EXPECT_FALSE(done.ok());
        EXPECT_EQ(robot_->trueSpeed(), 0);
        EXPECT_NE(robot_->trueState(), RobotState::executing);
        return done ? "" : done.error().message();
    }

    SimulatedRobot* robot_ = nullptr;
    std::unique_ptr<Supervisor> supervisor_;
    Rigid3 start_;
    MotionRequest request_;
    CutRun run_;
};

TEST_F(CutRunTest, RunsAMotionToItsEnd) {
    const Result<void> done = runCut(*supervisor_, request_, run_);
    ASSERT_OK(done);
    EXPECT_EQ(robot_->trueState(), RobotState::enabled);
    EXPECT_EQ(run_.done, 1);
    // 40 mm at 20 mm/s with three starts and stops, or two: 2 s and some hundredths.
    EXPECT_NEAR(run_.length_mm, 40, 0.5);
    EXPECT_NEAR(run_.time_s, 2, 0.1);
    EXPECT_LT((run_.trace.back().robot_from_cutter.translation() - start_.translation()).norm(), 0.2);
    EXPECT_GT(run_.trace.size(), 80u);
    // The monitor's noise, 0.01 mm per axis.
    EXPECT_NEAR(run_.bone_rms_mm, 0.01 * std::sqrt(3.0), 0.003);
}

TEST_F(CutRunTest, WhatSpeaksAgainstItKeepsItFromBeginning) {
    const MotionRequest good = request_;
    const std::pair<std::function<void()>, const char*> reasons[] = {
        {[&] { request_.registration.accepted_by.clear(); }, "Nobody has accepted the registration"},
        {[&] { request_.registration.fresh = false; }, "The registration is stale"},
        {[&] { request_.registration.error_bound_mm = 0.9; }, "error bound for the next cavity is 0.90 mm"},
        {[&] { request_.registration.age_s = 1801; }, "The registration's age"},
        {[&] { request_.time_out.side.confirmed.clear(); }, "The side, 'left', has not been confirmed"},
        {[&] { request_.time_out.confirmed_by.clear(); }, "Nobody has signed the time-out"},
        {[&] { request_.inset_mm = std::numeric_limits<double>::quiet_NaN(); }, "error bound"},
        {[&] { request_.motion.reset(); }, "no path that was checked twice"}};
    for (const auto& [spoil, sentence] : reasons) {
        request_ = good;
        spoil();
        EXPECT_THAT(endOf(), HasSubstr(sentence));
        EXPECT_TRUE(run_.trace.empty());
        EXPECT_LT((robot_->trueRobotFromCutter().translation() - start_.translation()).norm(), 0.2) << sentence;
    }
}

TEST_F(CutRunTest, ARegistrationThatGrowsTooOldWhileItCutsStopsIt) {
    request_.registration.age_s = 1799.5;
    EXPECT_THAT(endOf(), HasSubstr("The registration's age is 1800 s"));
    EXPECT_GT(run_.done, 0.1);
    EXPECT_LT(run_.done, 0.5);
}

TEST_F(CutRunTest, ABoneThatMovesStopsIt) {
    Meanwhile meanwhile([&] { robot_->moveBone(Rigid3::fromTranslation({0, 0.5, 0})); });
    EXPECT_THAT(endOf(meanwhile), HasSubstr("the bone has moved"));
    EXPECT_LT(run_.done, 0.6);
    EXPECT_FALSE(run_.trace.empty());
    // And it does not go on, nor begin again, while the bone is elsewhere.
    EXPECT_THAT(endOf(), HasSubstr("the bone has moved"));
    robot_->moveBone(Rigid3::fromTranslation({0, -0.5, 0}));
}

TEST_F(CutRunTest, ALostLinkStopsItWithin50Milliseconds) {
    double at_loss = 0;
    Meanwhile meanwhile([&] {
        robot_->setLink(false);
        at_loss = robot_->trueRobotFromCutter().translation().x();
    });
    EXPECT_THAT(endOf(meanwhile), HasSubstr("no word from the robot"));
    EXPECT_EQ(robot_->trueState(), RobotState::paused);
    EXPECT_LT(std::abs(robot_->trueRobotFromCutter().translation().x() - at_loss), 0.05 * 20 + 0.1);
}

TEST_F(CutRunTest, AFaultOfTheRobotEndsIt) {
    Meanwhile meanwhile([&] { robot_->break_("a broken belt"); });
    EXPECT_THAT(endOf(meanwhile), HasSubstr("a broken belt"));
    EXPECT_EQ(robot_->trueState(), RobotState::fault);
    EXPECT_THAT(endOf(), HasSubstr("acknowledge it"));
}

TEST_F(CutRunTest, CancellingHoldsItWithinOneHeartbeat) {
    double at_cancel = 0;
    Meanwhile meanwhile([&] {
        meanwhile.cancelled = true;
        at_cancel = robot_->trueRobotFromCutter().translation().x();
    });
    const Result<void> done = runCut(*supervisor_, request_, run_, meanwhile);
    ASSERT_FALSE(done.ok());
    EXPECT_TRUE(done.error().isCancelled());
    EXPECT_EQ(robot_->trueState(), RobotState::enabled);  // stopped, at rest
    EXPECT_EQ(robot_->trueSpeed(), 0);
    // A heartbeat at 20 mm/s, and v^2 / 2a to rest; tremble beside.
    EXPECT_LT(std::abs(robot_->trueRobotFromCutter().translation().x() - at_cancel), 0.006 * 20 + 0.067 + 0.1);
}

}  // namespace
}  // namespace fluorocut
