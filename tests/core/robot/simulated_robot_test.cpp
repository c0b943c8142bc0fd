#include "core/robot/adaptors/simulated_robot.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include <gtest/gtest.h>

#include "core/base/units.h"
#include "tests/core/robot/motions.h"

namespace fluorocut {
namespace {

SimulatedRobotOptions exact() {
    SimulatedRobotOptions options;
    options.calibration_mm = options.calibration_rad = options.tremble_mm = options.tremble_rad = 0;
    options.bone_noise_mm = 0;
    return options;
}

void live(SimulatedRobot& robot, double seconds) {
    for (double t = 0; t < seconds - 1e-9; t += 0.01) {
        robot.heartbeat();
        robot.advance(0.01);
    }
    robot.heartbeat();
}

void makeReady(SimulatedRobot& robot) {
    ASSERT_TRUE(robot.connect());
    ASSERT_TRUE(robot.enable());
    live(robot, 0.02);
}

// 100 mm at 20 mm/s from where the robot begins.
CheckedMotion along() {
    return motionThrough({Vector3(0, 0, 0), Vector3(100, 0, 0)}, 20);
}

// Executing, for 0.5 s.
void makeMoving(SimulatedRobot& robot) {
    makeReady(robot);
    ASSERT_TRUE(robot.execute(along()));
    live(robot, 0.5);
}

double placeOf(const SimulatedRobot& robot) {
    return robot.trueRobotFromCutter().translation().x();
}

TEST(SimulatedRobot, AMoveTakesTheTrapezoidsTime) {
    SimulatedRobot robot(exact());
    makeReady(robot);
    robot.takeFeedback();
    ASSERT_TRUE(robot.execute(along()));
    double begun = 0, ended = 0;
    live(robot, 6);
    for (const RobotFeedback& feedback : robot.takeFeedback()) {
        if (begun == 0) begun = feedback.time_s;
        if (feedback.state == RobotState::executing) ended = feedback.time_s;
    }
    // To a feedback's period of 4 ms at either end.
    EXPECT_NEAR(ended - begun, 100.0 / 20 + 20.0 / 3000, 0.008);
    EXPECT_NEAR(placeOf(robot), 100, 1e-9);
    EXPECT_EQ(robot.trueSpeed(), 0);
}

TEST(SimulatedRobot, HeldItComesToRestInTheBrakingDistance) {
    SimulatedRobot robot(exact());
    makeMoving(robot);
    const double before = placeOf(robot);
    EXPECT_NEAR(robot.trueSpeed(), 20, 1e-9);
    ASSERT_TRUE(robot.hold());
    EXPECT_FALSE(robot.resume());  // still coming to rest
    live(robot, 0.1);
    EXPECT_NEAR(placeOf(robot) - before, 20.0 * 20 / (2 * 3000), 1e-9);
    live(robot, 1);
    EXPECT_NEAR(placeOf(robot) - before, 20.0 * 20 / (2 * 3000), 1e-9);
    ASSERT_TRUE(robot.resume());
    live(robot, 6);
    EXPECT_NEAR(placeOf(robot), 100, 1e-9);
}

TEST(SimulatedRobot, DisabledItStandsAtOnce) {
    SimulatedRobot robot(exact());
    makeMoving(robot);
    const double there = placeOf(robot);
    ASSERT_TRUE(robot.disable());
    EXPECT_EQ(robot.trueSpeed(), 0);
    live(robot, 0.1);
    EXPECT_EQ(placeOf(robot), there);
}

TEST(SimulatedRobot, StoppedItTakesTheNextMotionWhenAtRest) {
    SimulatedRobot robot(exact());
    makeMoving(robot);
    ASSERT_TRUE(robot.stop());
    const auto back = [&] { return motionThrough({Vector3(placeOf(robot), 0, 0), Vector3(0, 0, 0)}, 20); };
    const auto early = robot.execute(back());
    ASSERT_FALSE(early);
    EXPECT_EQ(early.error().found, "a cutter still coming to rest");
    live(robot, 0.02);  // 20 / 3000 s of braking
    EXPECT_TRUE(robot.execute(back()));
}

TEST(SimulatedRobot, HeartbeatsOfAnEarlierConnectionDoNotCount) {
    SimulatedRobot robot(exact());
    makeReady(robot);
    ASSERT_TRUE(robot.disconnect());
    ASSERT_TRUE(robot.connect());
    ASSERT_TRUE(robot.enable());
    EXPECT_EQ(robot.execute(along()).error().found, "no heartbeat yet");
    robot.heartbeat();
    EXPECT_TRUE(robot.execute(along()));
}

TEST(SimulatedRobot, ItsErrorIs20MicrometresAndAHundredthOfADegree) {
    const int count = 4000;
    double square_mm = 0, square_rad = 0;
    for (int seed = 1; seed <= count; ++seed) {
        SimulatedRobotOptions options;
        options.seed = static_cast<std::uint64_t>(seed);
        const SimulatedRobot robot(options);  // stands at the origin, it believes
        const Vector6 error = robot.trueRobotFromCutter().deltaFrom(Rigid3());
        square_mm += error.head<3>().squaredNorm() / count;
        square_rad += error.tail<3>().squaredNorm() / count;
    }
    // Of 3 x 4000 nearly normal numbers the mean square has a relative deviation of sqrt(2 / 12000) = 1.3 %, its root
    // half of it; four of these.
    EXPECT_NEAR(std::sqrt(square_mm), 0.020, 0.020 * 0.026);
    EXPECT_NEAR(degreesFromRadians(std::sqrt(square_rad)), 0.010, 0.010 * 0.026);
}

TEST(SimulatedRobot, ItTremblesWithItsCorrelationTimeAboutARepeatableError) {
    SimulatedRobotOptions options;
    options.seed = 5;
    SimulatedRobot robot(options);
    makeReady(robot);
    const Rigid3 mean = Rigid3().perturbed(robot.calibrationErrorAt(Vector3::Zero()));
    const int count = 20000;
    double square = 0, product = 0;
    Vector6 before = Vector6::Zero();
    for (int i = 0; i < count; ++i) {
        robot.advance(0.02);
        const Vector6 tremble = robot.trueRobotFromCutter().deltaFrom(mean);
        square += tremble.head<3>().squaredNorm() / count;
        product += tremble.head<3>().dot(before.head<3>()) / count;
        before = tremble;
    }
    // 20,000 samples at one correlation time are worth 20000 tanh(1) = 15,000 independent ones, three numbers each:
    // sqrt(2 / 45000) = 0.7 %; four of these.
    EXPECT_NEAR(square, 0.012 * 0.012, 0.012 * 0.012 * 0.028);
    EXPECT_NEAR(product / square, std::exp(-1.0), 0.02);

    SimulatedRobot again(options);
    EXPECT_EQ(again.calibrationErrorAt({10, 20, 30}), robot.calibrationErrorAt({10, 20, 30}));
    // Waves of 200 mm and more: 1 mm away it changes by at most 2 pi / 200 of their sum of amplitudes.
    const double change =
        (robot.calibrationErrorAt({10, 20, 30}) - robot.calibrationErrorAt({11, 20, 30})).head<3>().norm();
    EXPECT_GT(change, 0);
    EXPECT_LT(change, 2 * std::numbers::pi / 200 * std::sqrt(3.0) * std::sqrt(2.0) * 0.016);
    options.seed = 6;
    EXPECT_NE(SimulatedRobot(options).calibrationErrorAt({10, 20, 30}), robot.calibrationErrorAt({10, 20, 30}));
}

TEST(SimulatedRobot, ItsEncodersSeeTheTrembleAndNotTheCalibration) {
    SimulatedRobot robot;
    makeReady(robot);
    robot.advance(0.004);
    const Rigid3 believed = robot.takeFeedback().back().robot_from_cutter;
    const Vector6 hidden = robot.trueRobotFromCutter().deltaFrom(believed);
    EXPECT_LT((hidden - robot.calibrationErrorAt(Vector3::Zero())).norm(), 1e-12);
    EXPECT_GT(hidden.head<3>().norm(), 0.001);
}

TEST(SimulatedRobot, TheSameSeedGivesTheSameRunHoweverTimeIsCutUp) {
    SimulatedRobotOptions options;
    options.watchdog_s = 0.02;
    SimulatedRobot coarse(options), fine(options);
    for (SimulatedRobot* robot : {&coarse, &fine}) {
        makeReady(*robot);
        ASSERT_TRUE(robot->execute(along()));
    }
    for (int i = 0; i < 100; ++i) {
        coarse.heartbeat();
        fine.heartbeat();
        coarse.advance(0.01);
        for (int k = 0; k < 10; ++k)
            fine.advance(0.001);
        ASSERT_EQ(coarse.trueRobotFromCutter().matrix(), fine.trueRobotFromCutter().matrix());
    }
    const auto one = coarse.takeFeedback(), other = fine.takeFeedback();
    ASSERT_EQ(one.size(), other.size());
    EXPECT_GT(placeOf(coarse), 15);
}

// A fast move, so that braking takes its full 20 ms; whatever the phase between heartbeats and cycles.
TEST(SimulatedRobot, AClientThatHangsOrALinkThatIsLostLeavesItAtRestWithin50Ms) {
    double slowest = 0;
    for (int phase = 0; phase < 40; ++phase) {
        for (const bool link_lost : {false, true}) {
            SimulatedRobot robot(exact());
            makeReady(robot);
            ASSERT_TRUE(robot.execute(motionThrough({Vector3(0, 0, 0), Vector3(150, 0, 0)}, 60)));
            live(robot, 0.3);
            robot.advance(0.0005 * phase);
            robot.heartbeat();
            ASSERT_EQ(robot.trueState(), RobotState::executing);
            if (link_lost) robot.setLink(false);
            double rest_s = 0;
            while (robot.trueSpeed() > 0 && rest_s < 1) {
                if (link_lost) robot.heartbeat();  // says the client, and nobody hears it
                robot.advance(0.0005);
                rest_s += 0.0005;
            }
            EXPECT_GT(rest_s, 0.025);
            EXPECT_LE(rest_s, 0.050 + 1e-9);
            slowest = std::max(slowest, rest_s);
            EXPECT_EQ(robot.trueState(), RobotState::paused);
            EXPECT_EQ(robot.state(), link_lost ? RobotState::executing : RobotState::paused);  // last heard of

            // Nothing resumes by itself.
            robot.setLink(true);
            const double there = placeOf(robot);
            live(robot, 2);
            EXPECT_EQ(robot.trueState(), RobotState::paused);
            EXPECT_EQ(robot.state(), RobotState::paused);
            EXPECT_EQ(placeOf(robot), there);
            EXPECT_TRUE(robot.resume());
        }
    }
    // Found out at 26 ms, by the first cycle after the watchdog's 25, whose 2 ms are braked in already; 20 ms in all.
    EXPECT_NEAR(slowest, 0.044, 0.0005 + 1e-9);
}

TEST(SimulatedRobot, WithoutALinkNothingIsHeardEitherWay) {
    SimulatedRobot robot(exact());
    makeMoving(robot);
    robot.setLink(false);
    robot.takeFeedback();
    robot.advance(0.01);
    EXPECT_TRUE(robot.takeFeedback().empty());
    for (const auto& refused : {robot.hold(), robot.stop(), robot.disable(), robot.execute(along()), robot.resume(),
                                robot.setBoneReference(), robot.connect(), robot.disconnect()}) {
        ASSERT_FALSE(refused);
        EXPECT_EQ(refused.error().found, "no link to the robot");
    }
    EXPECT_EQ(robot.trueState(), RobotState::executing);
}

TEST(SimulatedRobot, ABoneThatMovesPausesIt) {
    SimulatedRobotOptions options = exact();
    options.bone_point_mm = {50, 0, 0};
    SimulatedRobot robot(options);
    makeMoving(robot);
    robot.moveBone(Rigid3::fromTranslation({0, 0.29, 0}));
    live(robot, 0.1);
    EXPECT_EQ(robot.trueState(), RobotState::executing);
    robot.moveBone(Rigid3::fromTranslation({0, 0.02, 0}));
    robot.takeFeedback();
    robot.advance(0.004);
    EXPECT_EQ(robot.trueState(), RobotState::paused);
    const RobotFeedback feedback = robot.takeFeedback().back();
    EXPECT_NEAR(feedback.bone_displacement_mm, 0.31, 1e-9);
    EXPECT_EQ(feedback.reason, "the bone has moved by 0.31 mm, limit 0.30 mm");
    live(robot, 0.1);
    EXPECT_EQ(robot.trueSpeed(), 0);
    EXPECT_FALSE(robot.resume());
    EXPECT_FALSE(robot.setBoneReference());
    // Registered again: only after a stop, and the old path is gone.
    ASSERT_TRUE(robot.stop());
    ASSERT_TRUE(robot.setBoneReference());
    EXPECT_FALSE(robot.resume());
    live(robot, 0.02);
    const double x = placeOf(robot);
    EXPECT_TRUE(robot.execute(motionThrough({Vector3(x, 0, 0), Vector3(0, 0, 0)}, 20)));
}

TEST(SimulatedRobot, ABoneThatTurnsOrIsNotSeenPausesItAndMovedBackItMayGoOn) {
    SimulatedRobot robot(exact());
    makeMoving(robot);
    robot.moveBone(Rigid3::fromRotationVector({0, 0, 0.004}));  // about the watched point: no displacement
    live(robot, 0.1);
    EXPECT_EQ(robot.trueState(), RobotState::paused);
    EXPECT_EQ(robot.takeFeedback().back().reason, "the bone has turned by 0.23 degrees, limit 0.20 degrees");
    robot.moveBone(Rigid3::fromRotationVector({0, 0, -0.004}));
    live(robot, 0.1);
    EXPECT_EQ(robot.trueState(), RobotState::paused);
    ASSERT_TRUE(robot.resume());
    live(robot, 0.1);
    robot.setBoneSeen(false);
    live(robot, 0.1);
    EXPECT_EQ(robot.trueState(), RobotState::paused);
    const RobotFeedback blind = robot.takeFeedback().back();
    EXPECT_TRUE(std::isnan(blind.bone_displacement_mm));
    EXPECT_EQ(blind.reason, "the bone is not seen by its monitor");
    EXPECT_FALSE(robot.resume());
    ASSERT_TRUE(robot.stop());
    EXPECT_FALSE(robot.setBoneReference());
}

// Material of a constant section across the way, mm^2.
RobotSurroundings material(double section_mm2) {
    return [section_mm2](const Rigid3& before, const Rigid3& now) {
        return section_mm2 * (now.translation() - before.translation()).norm();
    };
}

TEST(SimulatedRobot, ForceIsBiteTimesFeed) {
    SimulatedRobot robot(exact(), material(6));
    makeMoving(robot);
    robot.advance(0.004);
    EXPECT_NEAR(robot.takeFeedback().back().force_n, 0.5 * 6 * 20, 1e-6);
    live(robot, 6);
    EXPECT_EQ(robot.trueState(), RobotState::enabled);
    EXPECT_NEAR(robot.takeFeedback().back().force_n, 0, 1e-6);  // 0.5 s of the filter's 20 ms later
}

TEST(SimulatedRobot, OverloadIsAFaultWithTheBrakesOn) {
    // 0.5 * 16 * 20 = 160 N, limit 80 N: reached 20 ms * ln 2 = 13.9 ms after a step, and later by about half of the
    // 6.7 ms in which it comes to speed.
    SimulatedRobot robot(exact(), material(16));
    makeReady(robot);
    robot.takeFeedback();
    ASSERT_TRUE(robot.execute(along()));
    double found_s = 0;
    while (robot.state() == RobotState::executing && found_s < 1) {
        robot.heartbeat();
        robot.advance(0.002);
        found_s += 0.002;
    }
    EXPECT_NEAR(found_s, 0.0139 + 0.0033, 0.003);  // to a cycle and the ramp's filtering
    EXPECT_EQ(robot.state(), RobotState::fault);
    EXPECT_EQ(robot.trueSpeed(), 0);
    const double there = placeOf(robot);
    robot.advance(0.004);
    const std::string reason = robot.takeFeedback().back().reason;
    EXPECT_EQ(reason.substr(0, 24), "force on the cutter of 8") << reason;
    EXPECT_EQ(reason.substr(reason.size() - 10), "limit 80 N") << reason;
    EXPECT_FALSE(robot.execute(along()));
    EXPECT_FALSE(robot.resume());
    EXPECT_FALSE(robot.enable());
    ASSERT_TRUE(robot.acknowledgeFault());
    EXPECT_EQ(robot.state(), RobotState::disabled);
    live(robot, 1);
    EXPECT_EQ(placeOf(robot), there);
}

TEST(SimulatedRobot, AForceThatIsNoNumberIsAFault) {
    SimulatedRobot robot(exact(),
                         [](const Rigid3&, const Rigid3&) { return std::numeric_limits<double>::quiet_NaN(); });
    ASSERT_TRUE(robot.connect());
    live(robot, 0.01);
    EXPECT_EQ(robot.state(), RobotState::fault);
    SimulatedRobot negative(exact(), [](const Rigid3&, const Rigid3&) { return -1.0; });
    ASSERT_TRUE(negative.connect());
    live(negative, 0.01);
    EXPECT_EQ(negative.state(), RobotState::fault);
    SimulatedRobot broken;
    makeMoving(broken);
    broken.break_("drive 3 is too hot");
    EXPECT_EQ(broken.state(), RobotState::fault);
    broken.advance(0.004);
    EXPECT_EQ(broken.takeFeedback().back().reason, "drive 3 is too hot");
}

TEST(SimulatedRobot, KeepsToItsWorkspaceAndFeeds) {
    SimulatedRobotOptions options = exact();
    options.workspace_low_mm = {-50, -50, -50};
    options.workspace_high_mm = {50, 50, 50};
    options.most_feed_mm_s = 30;
    SimulatedRobot robot(options);
    makeReady(robot);
    const auto outside = robot.execute(motionThrough({Vector3(0, 0, 0), Vector3(0, 0, 50.1)}, 20));
    ASSERT_FALSE(outside);
    EXPECT_EQ(outside.error().where, "robot, execute, step 1");
    const auto fast = robot.execute(motionThrough({Vector3(0, 0, 0), Vector3(0, 0, 40)}, 31));
    ASSERT_FALSE(fast);
    EXPECT_EQ(fast.error().found, "a feed of 31 mm/s");
    const auto gap = robot.execute(motionThrough({Vector3(0, 0, 1.1), Vector3(0, 0, 40)}, 20));
    ASSERT_FALSE(gap);
    EXPECT_EQ(gap.error().where, "robot, execute");
    const auto turned = robot.execute(
        tryMotion({{Rigid3::fromRotationVector({0.02, 0, 0}), 20}, {Rigid3::fromRotationVector({0.1, 0, 0}), 20}})
            .value());
    ASSERT_FALSE(turned);
    EXPECT_EQ(turned.error().found, "a first pose 0.00 mm and 1.15 degrees from the cutter's");
    EXPECT_EQ(robot.state(), RobotState::enabled);
    EXPECT_TRUE(robot.execute(motionThrough({Vector3(0, 0, 0), Vector3(0, 0, 50)}, 30)));
}

TEST(SimulatedRobot, OptionsMustKeepTheSafetyTime) {
    EXPECT_TRUE(SimulatedRobotOptions().validate());
    SimulatedRobotOptions options;
    options.watchdog_s = 0.03;  // 30 + 4 + 20 ms
    EXPECT_EQ(options.validate().error().where, "time from the last heartbeat to rest");
    EXPECT_THROW(SimulatedRobot{options}, std::logic_error);
    options = {};
    options.cycles_per_feedback = 6;
    EXPECT_EQ(options.validate().error().where, "feedback's period");
    options = {};
    options.workspace_high_mm.y() = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(options.validate().error().where, "workspace_high_mm");
    SimulatedRobot robot;
    EXPECT_THROW(robot.advance(-1), std::logic_error);
    EXPECT_THROW(robot.advance(std::numeric_limits<double>::quiet_NaN()), std::logic_error);
}

}  // namespace
}  // namespace fluorocut
