#include "core/robot/supervisor.h"

#include <functional>
#include <limits>
#include <map>
#include <set>

#include <gtest/gtest.h>

#include "core/robot/adaptors/simulated_robot.h"
#include "tests/core/robot/motions.h"

namespace fluorocut {
namespace {

using Kind = RefusalKind;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

MotionRequest goodRequest() {
    MotionRequest request;
    request.registration = {"registration 7", "Dr Ito", true, "", 120, 0.4};
    request.inset_mm = 0;
    request.motion = motionThrough({Vector3(0, 0, 0), Vector3(20, 0, 0)}, 20);
    request.time_out = {{"P-1", "P-1"}, {"left", "left"}, {"stem 4", "stem 4"}, {"stage 1", "stage 1"}, 3600,
                        true,           "Dr Ito"};
    return request;
}

std::set<Kind> kinds(const MotionRequest& request, const SupervisorLimits& limits = {}) {
    std::set<Kind> found;
    for (const Refusal& refusal : refusals(request, limits)) {
        EXPECT_TRUE(found.insert(refusal.kind).second) << refusal.sentence;
        // One sentence, for people.
        EXPECT_GT(refusal.sentence.size(), 15U);
        EXPECT_EQ(refusal.sentence.back(), '.');
    }
    return found;
}

struct Fault {
    Kind kind;
    std::function<void(MotionRequest&)> make;
};
// Each takes one thing away, in every way in which it can be missing.
std::vector<Fault> faults() {
    return {
        {Kind::registrationNotAccepted, [](auto& r) { r.registration.accepted_by.clear(); }},
        {Kind::registrationStale, [](auto& r) { r.registration.fresh = false; }},
        {Kind::registrationStale, [](auto& r) { r.registration.stale_because = "the bone has moved"; }},
        {Kind::registrationAge, [](auto& r) { r.registration.age_s = kNan; }},
        {Kind::registrationAge, [](auto& r) { r.registration.age_s = -1; }},
        {Kind::registrationAge, [](auto& r) { r.registration.age_s = 1801; }},
        {Kind::registrationUncertain, [](auto& r) { r.registration.error_bound_mm = kNan; }},
        {Kind::registrationUncertain, [](auto& r) { r.registration.error_bound_mm = 0; }},
        {Kind::registrationUncertain, [](auto& r) { r.registration.error_bound_mm = -0.1; }},
        {Kind::registrationUncertain, [](auto& r) { r.registration.error_bound_mm = 0.7501; }},
        {Kind::registrationUncertain, [](auto& r) { r.inset_mm = kNan; }},
        {Kind::registrationUncertain, [](auto& r) { r.inset_mm = -1; }},
        {Kind::registrationUncertain, [](auto& r) { r.inset_mm = 0.3; }},
        {Kind::pathOfOtherRegistration, [](auto& r) { r.registration.id = "registration 8"; }},
        {Kind::pathOfOtherStage,
         [](auto& r) {
             r.motion = motionThrough({Vector3(0, 0, 0), Vector3(20, 0, 0)}, 20, "stage 2");
         }},
        {Kind::timeOutPatient, [](auto& r) { r.time_out.patient.in_case.clear(); }},
        {Kind::timeOutPatient, [](auto& r) { r.time_out.patient.confirmed.clear(); }},
        {Kind::timeOutPatient,
         [](auto& r) {
             r.time_out.patient = {"", ""};
         }},
        {Kind::timeOutSide, [](auto& r) { r.time_out.side.confirmed = "right"; }},
        {Kind::timeOutImplant, [](auto& r) { r.time_out.implant.confirmed = "stem 5"; }},
        {Kind::timeOutStage, [](auto& r) { r.time_out.stage.confirmed = "stage 2"; }},
        {Kind::timeOutCalibrationAge, [](auto& r) { r.time_out.calibration_age_s = kNan; }},
        {Kind::timeOutCalibrationAge, [](auto& r) { r.time_out.calibration_age_s = 24 * 3600 + 1; }},
        {Kind::timeOutCalibrationAge, [](auto& r) { r.time_out.calibration_age_s = -1; }},
        {Kind::timeOutCalibrationAge, [](auto& r) { r.time_out.calibration_age_confirmed = false; }},
        {Kind::timeOutNobody, [](auto& r) { r.time_out.confirmed_by.clear(); }},
    };
}

TEST(Supervisor, AGoodRequestHasNothingAgainstIt) {
    EXPECT_TRUE(kinds(goodRequest()).empty());
    MotionRequest edge = goodRequest();
    edge.registration.error_bound_mm = 0.75;
    edge.registration.age_s = 1800;
    EXPECT_TRUE(kinds(edge).empty());
}

TEST(Supervisor, EachReasonAloneIsFoundAlone) {
    for (const Fault& fault : faults()) {
        MotionRequest request = goodRequest();
        fault.make(request);
        EXPECT_EQ(kinds(request), std::set<Kind>{fault.kind}) << static_cast<int>(fault.kind);
    }
}

TEST(Supervisor, NamesThatAreEmptyDoNotAgree) {
    MotionRequest request = goodRequest();
    request.registration.id.clear();
    request.time_out.stage = {"", ""};
    request.motion = motionThrough({Vector3(0, 0, 0), Vector3(20, 0, 0)}, 20, "", "");
    EXPECT_EQ(kinds(request), (std::set<Kind>{Kind::registrationNotAccepted, Kind::pathOfOtherRegistration,
                                              Kind::pathOfOtherStage, Kind::timeOutStage}));
}

TEST(Supervisor, EveryTwoReasonsAreBothFound) {
    for (const Fault& one : faults()) {
        for (const Fault& other : faults()) {
            MotionRequest request = goodRequest();
            one.make(request);
            other.make(request);
            EXPECT_EQ(kinds(request), (std::set<Kind>{one.kind, other.kind}));
        }
    }
}

TEST(Supervisor, ADefaultRequestIsRefusedForEveryReason) {
    std::set<Kind> all{Kind::pathNotChecked};
    for (const Fault& fault : faults())
        all.insert(fault.kind);
    EXPECT_EQ(kinds({}), all);
    SupervisorLimits broken;
    broken.envelope_delta_mm = 2;
    all.insert(Kind::limits);
    EXPECT_EQ(kinds({}, broken), all);
    EXPECT_EQ(all.size(), static_cast<std::size_t>(Kind::timeOutNobody) + 1);  // no reason is left out
}

TEST(Supervisor, LimitsOutsideTheirOwnAreAReason) {
    for (const double delta : {0.49, 1.01, kNan, 0.0}) {
        SupervisorLimits limits;
        limits.envelope_delta_mm = delta;
        EXPECT_TRUE(kinds(goodRequest(), limits).contains(Kind::limits)) << delta;
    }
    SupervisorLimits narrow;
    narrow.envelope_delta_mm = 0.5;
    MotionRequest request = goodRequest();
    request.registration.error_bound_mm = 0.6;
    EXPECT_EQ(kinds(request, narrow), std::set<Kind>{Kind::registrationUncertain});
}

TEST(Supervisor, AStageBeforeTheLastHasItsInsetForRoom) {
    MotionRequest request = goodRequest();
    request.registration.error_bound_mm = 1.9;
    EXPECT_EQ(kinds(request), std::set<Kind>{Kind::registrationUncertain});
    request.inset_mm = 2;
    EXPECT_TRUE(kinds(request).empty());
    request.registration.error_bound_mm = 2.01;
    EXPECT_EQ(kinds(request), std::set<Kind>{Kind::registrationUncertain});
    // However much room there is, a registration as bad as this is none.
    request.inset_mm = 9;
    request.registration.error_bound_mm = 5.01;
    EXPECT_EQ(kinds(request), std::set<Kind>{Kind::registrationUncertain});
    request.registration.error_bound_mm = 4.99;
    EXPECT_TRUE(kinds(request).empty());
}

TEST(Supervisor, SentencesSayWhatIsWrong) {
    MotionRequest request = goodRequest();
    request.time_out.side.confirmed = "right";
    request.registration.stale_because = "the bone has moved";
    const auto found = refusals(request, {});
    ASSERT_EQ(found.size(), 2U);
    EXPECT_EQ(found[0].sentence, "The registration is stale: the bone has moved.");
    EXPECT_EQ(found[1].sentence, "The side was confirmed as 'right', the case says 'left'.");
}

class SupervisedRobot : public testing::Test {
  protected:
    SupervisedRobot() {
        auto robot = std::make_unique<SimulatedRobot>();
        robot_ = robot.get();
        supervisor_ = std::make_unique<Supervisor>(std::move(robot));
        EXPECT_TRUE(supervisor_->connect());
        EXPECT_TRUE(supervisor_->enable());
        live(0.02);
    }
    void live(double seconds) {
        for (double t = 0; t < seconds - 1e-9; t += 0.01) {
            supervisor_->advance(0.01);
            supervisor_->heartbeat();
        }
    }
    SimulatedRobot* robot_ = nullptr;
    std::unique_ptr<Supervisor> supervisor_;
};

TEST_F(SupervisedRobot, MovesOnlyWithNothingAgainstIt) {
    for (const Fault& fault : faults()) {
        MotionRequest request = goodRequest();
        fault.make(request);
        const auto refused = supervisor_->execute(request);
        ASSERT_FALSE(refused);
        EXPECT_EQ(refused.error().found, "1 reason against motion");
        EXPECT_EQ(refused.error().advice, refusals(request, {}).front().sentence);
        live(0.05);
        EXPECT_EQ(robot_->trueState(), RobotState::enabled);
        EXPECT_EQ(robot_->trueSpeed(), 0);
    }
    EXPECT_EQ(supervisor_->execute({}).error().found.substr(0, 2), "13");
    EXPECT_TRUE(supervisor_->execute(goodRequest()));
    live(0.1);
    EXPECT_GT(robot_->trueSpeed(), 0);
}

TEST_F(SupervisedRobot, GoingOnAsksEverythingAgainOfTheSameMotion) {
    MotionRequest request = goodRequest();
    ASSERT_TRUE(supervisor_->execute(request));
    live(0.2);
    ASSERT_TRUE(supervisor_->hold());
    live(0.1);
    MotionRequest stale = request;
    stale.registration.fresh = false;
    EXPECT_FALSE(supervisor_->resume(stale));
    EXPECT_FALSE(supervisor_->resume({}));
    MotionRequest other = goodRequest();  // the same steps, checked anew
    EXPECT_EQ(supervisor_->resume(other).error().advice, "This is not the motion that was begun.");
    EXPECT_EQ(robot_->trueState(), RobotState::paused);
    EXPECT_TRUE(supervisor_->resume(request));
    EXPECT_EQ(robot_->trueState(), RobotState::executing);
}

TEST_F(SupervisedRobot, WhatTurnsUpDuringAMotionHoldsIt) {
    for (const Fault& fault : faults()) {
        MotionRequest request = goodRequest();
        const double x = robot_->trueRobotFromCutter().translation().x();
        request.motion = motionThrough({Vector3(x, 0, 0), Vector3(x < 100 ? x + 20 : x - 20, 0, 0)}, 20);
        ASSERT_TRUE(supervisor_->execute(request));
        for (int i = 0; i < 10; ++i) {
            supervisor_->advance(0.01);
            EXPECT_TRUE(supervisor_->watch(request).empty());
        }
        EXPECT_GT(robot_->trueSpeed(), 0);
        fault.make(request);
        EXPECT_FALSE(supervisor_->watch(request).empty());
        EXPECT_EQ(robot_->trueState(), RobotState::paused);
        for (int i = 0; i < 3; ++i) {
            supervisor_->advance(0.01);
            supervisor_->watch(request);  // the client lives, and that does not set it going
        }
        EXPECT_EQ(robot_->trueState(), RobotState::paused);
        EXPECT_EQ(robot_->trueSpeed(), 0);
        EXPECT_EQ(supervisor_->takeFeedback().back().reason, "held by command");
        ASSERT_TRUE(supervisor_->stop());
    }
}

// Hears heartbeats but takes no command to hold.
class DeafRobot : public SimulatedRobot {
  public:
    Result<void> hold() override { return noSolution("robot, hold", "no answer", "one"); }
};

TEST(Supervisor, ARobotThatCannotBeToldToHoldGetsNoMoreHeartbeats) {
    auto deaf = std::make_unique<DeafRobot>();
    DeafRobot& robot = *deaf;
    Supervisor supervisor(std::move(deaf));
    ASSERT_TRUE(supervisor.connect());
    ASSERT_TRUE(supervisor.enable());
    supervisor.heartbeat();
    MotionRequest request = goodRequest();
    ASSERT_TRUE(supervisor.execute(request));
    for (int i = 0; i < 10; ++i) {
        supervisor.advance(0.01);
        supervisor.watch(request);
    }
    EXPECT_GT(robot.trueSpeed(), 0);
    request.registration.fresh = false;
    for (int i = 0; i < 5; ++i) {
        EXPECT_EQ(supervisor.watch(request).size(), 1U);
        supervisor.advance(0.01);
    }
    EXPECT_EQ(robot.trueState(), RobotState::paused);  // by its own watchdog
    EXPECT_EQ(robot.trueSpeed(), 0);
}

TEST_F(SupervisedRobot, TheRobotsOwnRefusalComesThrough) {
    ASSERT_TRUE(supervisor_->disable());
    EXPECT_EQ(supervisor_->execute(goodRequest()).error().found, "the state disabled");
    EXPECT_THROW(Supervisor(nullptr), std::logic_error);
}

}  // namespace
}  // namespace fluorocut
