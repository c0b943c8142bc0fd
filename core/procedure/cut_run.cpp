#include "core/procedure/cut_run.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace fluorocut {
namespace {

constexpr double kSilence_s = 0.05;  // without feedback: the robot's own side has paused by then
constexpr double kRest_s = 0.5;      // to come to rest in
constexpr double kTraceEvery_s = 0.02;
constexpr std::size_t kLongestTrace = 20000;
constexpr double kArrived_mm = 0.5;  // encoders tremble

Error ended(const std::string& found, const std::string& advice) {
    return noSolution("cut", found, "the path run to its end", advice);
}

// What the feedback says, kept.
class Keeper {
  public:
    Keeper(CutRun& run, double expected_s)
        : run_(run), every_s_(std::max(kTraceEvery_s, expected_s / static_cast<double>(kLongestTrace))) {
        run_ = {};
        run_.time_s = run_.length_mm = run_.greatest_force_n = run_.bone_most_mm = 0;
    }
    void keep(const RobotFeedback& feedback) {
        if (!(start_s_ <= feedback.time_s)) start_s_ = feedback.time_s;
        run_.time_s = feedback.time_s - start_s_;
        if (last_.time_s < feedback.time_s && std::isfinite(feedback.speed_mm_s))
            run_.length_mm += feedback.speed_mm_s * (feedback.time_s - last_.time_s);
        if (std::isfinite(feedback.force_n)) run_.greatest_force_n = std::max(run_.greatest_force_n, feedback.force_n);
        if (std::isfinite(feedback.bone_displacement_mm) && std::isfinite(feedback.bone_rotation_rad)) {
            ++count_;
            bone_mm2_ += feedback.bone_displacement_mm * feedback.bone_displacement_mm;
            bone_rad2_ += feedback.bone_rotation_rad * feedback.bone_rotation_rad;
            run_.bone_rms_mm = std::sqrt(bone_mm2_ / count_);
            run_.bone_rms_rad = std::sqrt(bone_rad2_ / count_);
            run_.bone_most_mm = std::max(run_.bone_most_mm, feedback.bone_displacement_mm);
        }
        if (std::isfinite(feedback.done)) run_.done = feedback.done;
        if (run_.trace.empty() || run_.time_s >= run_.trace.back().time_s + every_s_)
            run_.trace.push_back({run_.time_s, feedback.robot_from_cutter, feedback.force_n});
        last_ = feedback;
    }
    const RobotFeedback& last() const { return last_; }

  private:
    CutRun& run_;
    double every_s_;
    double start_s_ = std::numeric_limits<double>::infinity();
    double bone_mm2_ = 0, bone_rad2_ = 0;
    double count_ = 0;
    RobotFeedback last_;
};

// At rest, and the rest of the motion forgotten. Fails where there is no link: the robot's own side has paused then.
Result<void> bringToRest(Supervisor& robot, Keeper& keeper) {
    for (double waited = 0; waited < kRest_s; waited += kHeartbeat_s) {
        robot.heartbeat();
        robot.advance(kHeartbeat_s);
        for (const RobotFeedback& feedback : robot.takeFeedback())
            keeper.keep(feedback);
        if (!(keeper.last().speed_mm_s > 0)) break;
    }
    if (robot.robot().state() == RobotState::fault) return {};  // the brakes are on
    return robot.stop();
}

Result<void> makeReady(Supervisor& robot) {
    if (robot.robot().state() == RobotState::disconnected)
        if (auto done = robot.connect(); !done) return done;
    if (robot.robot().state() == RobotState::disabled)
        if (auto done = robot.enable(); !done) return done;
    if (robot.robot().state() == RobotState::enabled) return {};
    return noSolution("robot", fmt::format("it is {}", name(robot.robot().state())), "enabled and at rest",
                      robot.robot().state() == RobotState::fault ? "find the fault, acknowledge it, enable again"
                                                                 : "stop the motion that is under way");
}

double expectedTime(const CheckedMotion& motion) {
    double time = 0;
    for (std::size_t i = 1; i < motion.steps().size(); ++i) {
        time +=
            (motion.steps()[i].robot_from_cutter.translation() - motion.steps()[i - 1].robot_from_cutter.translation())
                .norm() /
            motion.steps()[i].feed_mm_s;
    }
    return time;
}

}  // namespace

Result<RobotFeedback> whereItStands(Supervisor& robot) {
    if (robot.robot().state() == RobotState::disconnected)
        if (auto done = robot.connect(); !done) return done.error();
    (void)robot.takeFeedback();
    std::vector<RobotFeedback> heard;
    for (int i = 0; i < 10 && heard.empty(); ++i) {
        robot.heartbeat();
        robot.advance(kHeartbeat_s);
        heard = robot.takeFeedback();
    }
    if (heard.empty()) return noSolution("robot", "no feedback", "100 times a second", "mend the link to the robot");
    return heard.back();
}

Result<void> runCut(Supervisor& robot, MotionRequest request, CutRun& run, Progress& progress) {
    run = {};
    if (auto ready = makeReady(robot); !ready) return ready;
    (void)robot.takeFeedback();
    robot.heartbeat();
    if (auto started = robot.execute(request); !started) return started;
    const double expected_s = expectedTime(*request.motion);
    Keeper keeper(run, expected_s);
    double silent_s = 0;
    std::string against;
    while (robot.robot().state() == RobotState::executing) {
        if (progress.isCancelled()) {
            const Result<void> held = robot.hold();
            const Result<void> stopped = bringToRest(robot, keeper);
            if (!held || !stopped) return ended("a robot that could not be told to stop", "press its emergency stop");
            return cancelled("cut");
        }
        robot.advance(kHeartbeat_s);
        request.registration.age_s += kHeartbeat_s;
        request.time_out.calibration_age_s += kHeartbeat_s;
        for (const Refusal& refusal : robot.watch(request))
            against += (against.empty() ? "" : " ") + refusal.sentence;
        const std::vector<RobotFeedback> heard = robot.takeFeedback();
        for (const RobotFeedback& feedback : heard)
            keeper.keep(feedback);
        silent_s = heard.empty() ? silent_s + kHeartbeat_s : 0;
        if (silent_s > kSilence_s) {
            (void)bringToRest(robot, keeper);  // it may hear us still
            return ended(fmt::format("no word from the robot for {:.0f} ms, {:.0f} % of the path run", 1000 * silent_s,
                                     100 * run.done),
                         "mend the link; the robot pauses by itself and nothing resumes");
        }
        if (!against.empty()) break;
        progress.report(std::clamp(run.done, 0.0, 1.0), "cutting");
    }
    // The state is known before the last of the feedback.
    robot.heartbeat();
    robot.advance(2 * kHeartbeat_s);
    for (const RobotFeedback& feedback : robot.takeFeedback())
        keeper.keep(feedback);
    const RobotFeedback last = keeper.last();
    if (!against.empty() || robot.robot().state() != RobotState::enabled) {
        const std::string why = against.empty() ? last.reason : against;
        const bool fault = robot.robot().state() == RobotState::fault;
        const Result<void> stopped = bringToRest(robot, keeper);
        return ended(fmt::format("the robot {} after {:.0f} % of the path: {}", fault ? "failed" : "paused",
                                 100 * run.done, why.empty() ? "it does not say why" : why),
                     stopped ? "what was cut so far stays within its envelope; remove the cause, then cut again"
                             : "press its emergency stop");
    }
    const double off =
        (last.robot_from_cutter.translation() - request.motion->steps().back().robot_from_cutter.translation()).norm();
    if (!(run.done >= 1 - 1e-9 && off <= kArrived_mm)) {
        return ended(
            fmt::format("a motion that ended after {:.1f} % of the path, {:.2f} mm from its end", 100 * run.done, off),
            "see the robot's own log");
    }
    return {};
}

}  // namespace fluorocut
