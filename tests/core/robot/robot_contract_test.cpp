// What every robot adaptor must keep, asked of all that are registered.
#include <string>

#include <gtest/gtest.h>

#include "core/robot/robot_registry.h"
#include "tests/core/robot/motions.h"

namespace fluorocut {
namespace {

class RobotContract : public testing::TestWithParam<RobotEntry> {
  protected:
    void SetUp() override { robot_ = GetParam().make(); }

    // Time with a client that lives.
    void live(double seconds) {
        for (double t = 0; t < seconds - 1e-9; t += 0.01) {
            robot_->heartbeat();
            robot_->advance(0.01);
        }
        robot_->heartbeat();
    }
    RobotFeedback last() {
        robot_->takeFeedback();
        robot_->advance(0.01);
        const auto feedback = robot_->takeFeedback();
        EXPECT_FALSE(feedback.empty());
        return feedback.empty() ? RobotFeedback{} : feedback.back();
    }
    void ready() {
        ASSERT_TRUE(robot_->connect());
        ASSERT_TRUE(robot_->enable());
        live(0.05);
        ASSERT_TRUE(robot_->setBoneReference());
    }
    // Straight from where the cutter stands; 20 mm at 20 mm/s.
    CheckedMotion aside() {
        start_ = last().robot_from_cutter;
        const Rigid3 end(start_.rotation(), start_.translation() + Vector3(20, 0, 0));
        robot_->heartbeat();
        return tryMotion({{start_, 20}, {end, 20}}).value();
    }
    double moved() { return (last().robot_from_cutter.translation() - start_.translation()).norm(); }

    // Encoders of a surgical robot: a tenth of a millimetre is five times what is asked of it.
    static constexpr double kPlace = 0.1;

    std::unique_ptr<RobotAdaptor> robot_;
    Rigid3 start_;
};

TEST_P(RobotContract, HasItsRegisteredNameAndBeginsDisconnected) {
    EXPECT_EQ(robot_->name(), GetParam().name);
    EXPECT_EQ(robot_->state(), RobotState::disconnected);
    EXPECT_FALSE(robot_->enable());
    EXPECT_FALSE(robot_->setBoneReference());
    robot_->advance(0.1);
    EXPECT_TRUE(robot_->takeFeedback().empty());
}

TEST_P(RobotContract, CommandsAreTakenAndRefusedAsTheTableSays) {
    const std::vector<std::pair<RobotEvent, Result<void> (RobotAdaptor::*)()>> commands{
        {RobotEvent::connect, &RobotAdaptor::connect}, {RobotEvent::disconnect, &RobotAdaptor::disconnect},
        {RobotEvent::enable, &RobotAdaptor::enable},   {RobotEvent::disable, &RobotAdaptor::disable},
        {RobotEvent::hold, &RobotAdaptor::hold},       {RobotEvent::resume, &RobotAdaptor::resume},
        {RobotEvent::stop, &RobotAdaptor::stop},       {RobotEvent::acknowledge, &RobotAdaptor::acknowledgeFault}};
    for (const RobotState from : {RobotState::disconnected, RobotState::disabled, RobotState::enabled,
                                  RobotState::executing, RobotState::paused}) {
        for (const auto& [event, command] : commands) {
            SCOPED_TRACE(std::string(name(from)) + ", " + std::string(name(event)));
            robot_ = GetParam().make();
            if (from != RobotState::disconnected) {
                ASSERT_TRUE(robot_->connect());
            }
            if (from >= RobotState::enabled) {
                ASSERT_TRUE(robot_->enable());
            }
            if (from >= RobotState::executing) {
                live(0.05);
                ASSERT_TRUE(robot_->execute(aside()));
                live(0.2);
            }
            if (from == RobotState::paused) {
                ASSERT_TRUE(robot_->hold());
                live(0.1);
            }
            ASSERT_EQ(robot_->state(), from);
            const auto next = nextState(from, event);
            const Result<void> done = (robot_.get()->*command)();
            EXPECT_EQ(done.ok(), next.has_value());
            EXPECT_TRUE(done || !done.error().message().empty());
            EXPECT_EQ(robot_->state(), next.value_or(from));
        }
    }
}

TEST_P(RobotContract, FeedbackComesAHundredTimesASecond) {
    ASSERT_TRUE(robot_->connect());
    live(1);
    const auto feedback = robot_->takeFeedback();
    EXPECT_GE(feedback.size(), 100U);
    for (std::size_t i = 1; i < feedback.size(); ++i) {
        EXPECT_GT(feedback[i].time_s, feedback[i - 1].time_s);
        EXPECT_LE(feedback[i].time_s - feedback[i - 1].time_s, 0.01 + 1e-9);
    }
    EXPECT_TRUE(robot_->takeFeedback().empty());
}

TEST_P(RobotContract, ExecutesAMotionToItsEnd) {
    ready();
    const CheckedMotion motion = aside();
    EXPECT_TRUE(robot_->execute(motion));
    EXPECT_EQ(robot_->state(), RobotState::executing);
    live(0.5);
    EXPECT_FALSE(robot_->execute(motion));
    live(1);
    EXPECT_EQ(robot_->state(), RobotState::enabled);
    EXPECT_NEAR(moved(), 20, kPlace);
}

TEST_P(RobotContract, ExecutesNothingThatDoesNotBeginWhereTheCutterStands) {
    ready();
    aside();
    const Rigid3 there(start_.rotation(), start_.translation() + Vector3(5, 0, 0));
    robot_->heartbeat();
    const auto refused = robot_->execute(tryMotion({{there, 20}, {start_, 20}}).value());
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().found.find("5.0"), std::string::npos) << refused.error().message();
    EXPECT_EQ(robot_->state(), RobotState::enabled);
}

TEST_P(RobotContract, NothingBeginsWithoutHeartbeats) {
    ASSERT_TRUE(robot_->connect());
    ASSERT_TRUE(robot_->enable());
    const CheckedMotion motion = aside();
    robot_->advance(0.1);
    EXPECT_FALSE(robot_->execute(motion));
    EXPECT_EQ(robot_->state(), RobotState::enabled);
}

TEST_P(RobotContract, ASilentClientPausesItWithin50MsAndNothingResumesByItself) {
    ready();
    ASSERT_TRUE(robot_->execute(aside()));
    live(0.3);
    const double silent = last().time_s - 0.01;  // the last heartbeat
    robot_->advance(0.5);
    bool rested = false;
    for (const RobotFeedback& feedback : robot_->takeFeedback()) {
        if (feedback.time_s < silent + 0.05) continue;
        EXPECT_EQ(feedback.state, RobotState::paused);
        EXPECT_EQ(feedback.speed_mm_s, 0);
        EXPECT_NE(feedback.reason.find("heartbeat"), std::string::npos);
        rested = true;
    }
    EXPECT_TRUE(rested);
    EXPECT_FALSE(robot_->resume());
    const double there = moved();
    EXPECT_GT(there, 1);
    EXPECT_LT(there, 19);
    live(2);
    EXPECT_EQ(robot_->state(), RobotState::paused);
    EXPECT_NEAR(moved(), there, kPlace);
    robot_->heartbeat();
    EXPECT_TRUE(robot_->resume());
    live(1.5);
    EXPECT_EQ(robot_->state(), RobotState::enabled);
    EXPECT_NEAR(moved(), 20, kPlace);
}

TEST_P(RobotContract, HoldsResumesAndStops) {
    ready();
    ASSERT_TRUE(robot_->execute(aside()));
    live(0.3);
    ASSERT_TRUE(robot_->hold());
    live(0.1);
    const double held = moved();
    live(0.5);
    EXPECT_NEAR(moved(), held, kPlace);
    EXPECT_FALSE(robot_->setBoneReference());
    robot_->heartbeat();
    ASSERT_TRUE(robot_->resume());
    live(0.2);
    ASSERT_TRUE(robot_->stop());
    live(0.1);
    const double stopped = moved();
    EXPECT_GT(stopped, held + 1);
    EXPECT_FALSE(robot_->resume());
    live(0.5);
    EXPECT_NEAR(moved(), stopped, kPlace);
    EXPECT_EQ(robot_->state(), RobotState::enabled);
}

TEST_P(RobotContract, DisablingStopsAtOnceAndForGood) {
    ready();
    ASSERT_TRUE(robot_->execute(aside()));
    live(0.3);
    ASSERT_TRUE(robot_->disable());
    EXPECT_EQ(last().speed_mm_s, 0);
    const double there = moved();
    ASSERT_TRUE(robot_->enable());
    live(0.5);
    EXPECT_EQ(robot_->state(), RobotState::enabled);
    EXPECT_NEAR(moved(), there, kPlace);
}

INSTANTIATE_TEST_SUITE_P(All, RobotContract, testing::ValuesIn(robotEntries()),
                         [](const auto& entry) { return std::string(entry.param.name); });

TEST(RobotRegistry, NamesWhatThereIs) {
    EXPECT_TRUE(makeRobot(robotEntries().front().name));
    const auto unknown = makeRobot("teapot");
    ASSERT_FALSE(unknown);
    EXPECT_EQ(unknown.error().message(), "robot: found 'teapot', expected one of simulated.");
}

}  // namespace
}  // namespace fluorocut
