#include "core/robot/adaptors/simulated_robot.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/units.h"

namespace fluorocut {
namespace {

constexpr double kTrembleTime = 0.02;      // s
constexpr double kStartGap = 1;            // mm between the cutter and a motion's first pose
constexpr double kStartTurn = 0.01;        // rad
constexpr double kSafetyTime = 0.05;       // s from the last heartbeat to rest
constexpr std::size_t kMostKept = 50'000;  // feedback nobody takes: the oldest is dropped

}  // namespace

Result<void> SimulatedRobotOptions::validate() const {
    if (auto ok =
            requireRanges({{"most_feed_mm_s", most_feed_mm_s, 0.1, 250, "mm/s"},
                           {"acceleration_mm_s2", acceleration_mm_s2, 1, 1e5, "mm/s^2"},
                           {"lever_mm", lever_mm, 1, 1000, "mm"},
                           {"cycle_s", cycle_s, 1e-4, 0.01, "s"},
                           {"cycles_per_feedback", static_cast<double>(cycles_per_feedback), 1, 100, ""},
                           {"feedback's period", cycle_s * cycles_per_feedback, 1e-4, 0.01, "s"},
                           {"watchdog_s", watchdog_s, 0.001, kSafetyTime, "s"},
                           {"calibration_mm", calibration_mm, 0, 10, "mm"},
                           {"calibration_rad", calibration_rad, 0, 0.1, "rad"},
                           {"tremble_mm", tremble_mm, 0, 10, "mm"},
                           {"tremble_rad", tremble_rad, 0, 0.1, "rad"},
                           {"force_per_rate", force_per_rate, 0, 1000, "N per mm^3/s"},
                           {"force_time_s", force_time_s, 0.001, 0.1, "s"},
                           {"most_force_n", most_force_n, 0, 10000, "N"},
                           {"most_bone_mm", most_bone_mm, 0.01, 10, "mm"},
                           {"most_bone_rad", most_bone_rad, 1e-4, 0.1, "rad"},
                           {"bone_noise_mm", bone_noise_mm, 0, 1, "mm"},
                           {"time from the last heartbeat to rest",
                            watchdog_s + 2 * cycle_s + most_feed_mm_s / acceleration_mm_s2, 0, kSafetyTime, "s"}});
        !ok)
        return ok;
    for (int k = 0; k < 3; ++k) {
        if (auto ok = requireRanges({{"workspace_low_mm", workspace_low_mm[k], -1e4, 1e4, "mm"},
                                     {"workspace_high_mm", workspace_high_mm[k], workspace_low_mm[k] + 1, 2e4, "mm"},
                                     {"bone_point_mm", bone_point_mm[k], -1e4, 1e4, "mm"}});
            !ok)
            return ok;
    }
    return {};
}

SimulatedRobot::SimulatedRobot(const SimulatedRobotOptions& options, RobotSurroundings surroundings)
    : options_(options), surroundings_(std::move(surroundings)), random_(Random(options.seed).fork(1)) {
    if (auto valid = options_.validate(); !valid) throw std::logic_error(valid.error().message());
    Random phases = Random(options_.seed).fork(2);
    for (auto& component : waves_) {
        for (Wave& wave : component) {
            Vector3 direction(phases.normal(), phases.normal(), phases.normal());
            wave.per_mm = 2 * std::numbers::pi / phases.uniform(200, 600) * direction.normalized();
            wave.phase = phases.uniform(0, 2 * std::numbers::pi);
        }
    }
    commanded_ = Rigid3::fromTranslation(0.5 * (options_.workspace_low_mm + options_.workspace_high_mm));
    // As if it had trembled for ever.
    const double share = 1 / std::sqrt(3.0);
    for (int k = 0; k < 6; ++k)
        tremble_[k] = share * (k < 3 ? options_.tremble_mm : options_.tremble_rad) * random_.normal();
    true_pose_ = believed().perturbed(calibrationErrorAt(commanded_.translation()));
}

// A wave of random phase has the mean square amplitude^2 / 2; nine of them make up the length's square.
Vector6 SimulatedRobot::calibrationErrorAt(const Vector3& place_mm) const {
    Vector6 error;
    for (std::size_t k = 0; k < 6; ++k) {
        double sum = 0;
        for (const Wave& wave : waves_[k])
            sum += std::sin(wave.per_mm.dot(place_mm) + wave.phase);
        error[static_cast<Eigen::Index>(k)] =
            std::sqrt(2.0) / 3 * (k < 3 ? options_.calibration_mm : options_.calibration_rad) * sum;
    }
    return error;
}

Rigid3 SimulatedRobot::believed() const {
    return commanded_.perturbed(tremble_);
}

Result<void> SimulatedRobot::requireLink(RobotEvent event) const {
    if (link_) return {};
    return noSolution(fmt::format("robot, {}", fluorocut::name(event)), "no link to the robot", "a link",
                      "Mend the connection; the robot pauses by itself.");
}

// Whether it may begin or go on to move; empty: it may.
std::string SimulatedRobot::whyNoMotion() const {
    if (!last_heartbeat_s_ || !(now() - *last_heartbeat_s_ <= options_.watchdog_s)) {
        return last_heartbeat_s_ ? fmt::format("no heartbeat for {:.0f} ms", 1000 * (now() - *last_heartbeat_s_))
                                 : "no heartbeat yet";
    }
    if (!bone_seen_) return "the bone is not seen by its monitor";
    if (!(bone_displacement_mm_ <= options_.most_bone_mm)) {
        return fmt::format("the bone has moved by {:.2f} mm, limit {:.2f} mm", bone_displacement_mm_,
                           options_.most_bone_mm);
    }
    if (!(bone_rotation_rad_ <= options_.most_bone_rad)) {
        return fmt::format("the bone has turned by {:.2f} degrees, limit {:.2f} degrees",
                           degreesFromRadians(bone_rotation_rad_), degreesFromRadians(options_.most_bone_rad));
    }
    return {};
}

Result<void> SimulatedRobot::command(RobotEvent event) {
    if (auto linked = requireLink(event); !linked) return linked;
    auto applied = machine_.apply(event);
    heard_ = machine_.state();
    return applied;
}

Result<void> SimulatedRobot::connect() {
    auto done = command(RobotEvent::connect);
    if (done) last_heartbeat_s_.reset();
    return done;
}

Result<void> SimulatedRobot::disconnect() {
    auto done = command(RobotEvent::disconnect);
    if (done) brakeAtOnce();
    return done;
}

Result<void> SimulatedRobot::enable() {
    return command(RobotEvent::enable);
}

Result<void> SimulatedRobot::disable() {
    auto done = command(RobotEvent::disable);
    if (done) brakeAtOnce();
    return done;
}

Result<void> SimulatedRobot::execute(const CheckedMotion& motion) {
    if (auto linked = requireLink(RobotEvent::execute); !linked) return linked;
    if (auto allowed = machine_.allows(RobotEvent::execute); !allowed) return allowed;
    if (speed_mm_s_ > 0) return noSolution("robot, execute", "a cutter still coming to rest", "rest", "Wait for it.");
    if (const std::string why = whyNoMotion(); !why.empty()) {
        return noSolution("robot, execute", why, "heartbeats, and the bone at its reference",
                          "Send heartbeats; register again when the bone has moved.");
    }
    for (std::size_t i = 0; i < motion.steps().size(); ++i) {
        const MotionStep& step = motion.steps()[i];
        const Vector3& place = step.robot_from_cutter.translation();
        const bool inside = (place.array() >= options_.workspace_low_mm.array()).all() &&
                            (place.array() <= options_.workspace_high_mm.array()).all();
        if (!inside) {
            return noSolution(fmt::format("robot, execute, step {}", i),
                              fmt::format("({:.1f}, {:.1f}, {:.1f}) mm", place.x(), place.y(), place.z()),
                              "a place in the robot's workspace", "Move the robot nearer to the patient.");
        }
        if (i > 0 && !(step.feed_mm_s <= options_.most_feed_mm_s)) {
            return noSolution(fmt::format("robot, execute, step {}", i),
                              fmt::format("a feed of {} mm/s", step.feed_mm_s),
                              fmt::format("at most {} mm/s", options_.most_feed_mm_s), "Plan it with slower feeds.");
        }
    }
    const Rigid3& start = motion.steps().front().robot_from_cutter;
    const double gap = (start.translation() - commanded_.translation()).norm();
    const double turn = start.rotation().angularDistance(commanded_.rotation());
    if (!(gap <= kStartGap && turn <= kStartTurn)) {
        return noSolution(
            "robot, execute",
            fmt::format("a first pose {:.2f} mm and {:.2f} degrees from the cutter's", gap, degreesFromRadians(turn)),
            fmt::format("at most {} mm and {:.2f} degrees", kStartGap, degreesFromRadians(kStartTurn)),
            "Begin the motion where the cutter stands.");
    }
    // From where it stands, in the place of a first pose that differs by an encoder's noise.
    std::vector<MotionStep> steps = motion.steps();
    steps.front().robot_from_cutter = commanded_;
    MotionTrack track(steps, options_.lever_mm);
    if (auto done = command(RobotEvent::execute); !done) return done;
    reason_.clear();
    motion_ = motion;
    track_ = std::move(track);
    profile_.emplace(*track_, 0, options_.acceleration_mm_s2);
    profile_start_s_ = now();
    along_mm_ = 0;
    return {};
}

Result<void> SimulatedRobot::hold() {
    const bool moving = machine_.state() == RobotState::executing;
    auto done = command(RobotEvent::hold);
    if (done && moving) reason_ = "held by command";
    return done;
}

Result<void> SimulatedRobot::resume() {
    if (auto linked = requireLink(RobotEvent::resume); !linked) return linked;
    if (auto allowed = machine_.allows(RobotEvent::resume); !allowed) return allowed;
    if (speed_mm_s_ > 0) return noSolution("robot, resume", "a cutter still coming to rest", "rest", "Wait for it.");
    if (const std::string why = whyNoMotion(); !why.empty()) {
        return noSolution("robot, resume", why, "heartbeats, and the bone at its reference",
                          "Send heartbeats; stop and register again when the bone has moved.");
    }
    if (auto done = command(RobotEvent::resume); !done) return done;
    reason_.clear();
    profile_.emplace(*track_, along_mm_, options_.acceleration_mm_s2);
    profile_start_s_ = now();
    return {};
}

Result<void> SimulatedRobot::stop() {
    return command(RobotEvent::stop);
}

Result<void> SimulatedRobot::acknowledgeFault() {
    auto done = command(RobotEvent::acknowledge);
    if (done) reason_.clear();
    return done;
}

Result<void> SimulatedRobot::setBoneReference() {
    if (!link_) return noSolution("robot, bone reference", "no link to the robot", "a link", "Mend the connection.");
    const RobotState state = machine_.state();
    if (state != RobotState::disabled && state != RobotState::enabled) {
        return noSolution("robot, bone reference", fmt::format("the state {}", fluorocut::name(state)),
                          "disabled or enabled", "Stop the motion first: its path belongs to where the bone was.");
    }
    if (!bone_seen_) {
        return noSolution("robot, bone reference", "a bone that is not seen by its monitor", "a bone in sight",
                          "Free the line of sight.");
    }
    bone_reference_ = bone_;
    bone_displacement_mm_ = bone_rotation_rad_ = 0;
    return {};
}

void SimulatedRobot::heartbeat() {
    if (link_ && machine_.state() != RobotState::disconnected) last_heartbeat_s_ = now();
}

std::vector<RobotFeedback> SimulatedRobot::takeFeedback() {
    std::vector<RobotFeedback> taken(feedback_.begin(), feedback_.end());
    feedback_.clear();
    return taken;
}

void SimulatedRobot::advance(double seconds) {
    if (!(seconds >= 0 && seconds <= 1e5)) throw std::logic_error("time goes forward, by a day at most");
    left_over_s_ += seconds;
    // A rounding must not cost a cycle: 1 s is 500 cycles of 2 ms.
    const double count = std::floor(left_over_s_ / options_.cycle_s + 1e-6);
    left_over_s_ = std::max(left_over_s_ - count * options_.cycle_s, 0.0);
    for (double i = 0; i < count; ++i)
        cycle();
}

void SimulatedRobot::setLink(bool up) {
    link_ = up;
    if (up) hear();
}

void SimulatedRobot::moveBone(const Rigid3& robot_moved_from_robot) {
    bone_ = robot_moved_from_robot * bone_;
}

void SimulatedRobot::break_(const std::string& reason) {
    fail(reason);
    hear();
}

void SimulatedRobot::pause(const std::string& reason) {
    if (!machine_.apply(RobotEvent::hold)) return;
    reason_ = reason;
}

void SimulatedRobot::fail(const std::string& reason) {
    if (machine_.state() == RobotState::fault || !machine_.apply(RobotEvent::fail)) return;
    reason_ = reason;
    brakeAtOnce();
}

void SimulatedRobot::brakeAtOnce() {
    speed_mm_s_ = 0;
    force_n_ = 0;
    profile_.reset();
    track_.reset();
    motion_.reset();
}

void SimulatedRobot::hear() {
    if (link_) heard_ = machine_.state();
}

void SimulatedRobot::cycle() {
    ++cycles_;
    watch();
    move();
    hear();
    if (cycles_ % static_cast<std::uint64_t>(options_.cycles_per_feedback) != 0) return;
    if (!link_ || machine_.state() == RobotState::disconnected) return;
    RobotFeedback feedback;
    feedback.time_s = now();
    feedback.state = machine_.state();
    feedback.robot_from_cutter = believed();
    feedback.speed_mm_s = speed_mm_s_;
    feedback.force_n = force_n_;
    if (track_) feedback.done = track_->length() > 0 ? along_mm_ / track_->length() : 1;
    feedback.bone_displacement_mm = bone_seen_ ? bone_displacement_mm_ : std::numeric_limits<double>::quiet_NaN();
    feedback.bone_rotation_rad = bone_seen_ ? bone_rotation_rad_ : std::numeric_limits<double>::quiet_NaN();
    feedback.reason = reason_;
    if (feedback_.size() >= kMostKept) feedback_.pop_front();
    feedback_.push_back(std::move(feedback));
}

void SimulatedRobot::watch() {
    const Rigid3 moved = bone_ * bone_reference_.inverse();
    Vector3 measured = moved * options_.bone_point_mm - options_.bone_point_mm;
    for (int k = 0; k < 3; ++k)
        measured[k] += options_.bone_noise_mm * random_.normal();
    bone_displacement_mm_ = measured.norm();
    bone_rotation_rad_ = moved.rotationAngle();
    if (machine_.state() != RobotState::executing) return;
    if (const std::string why = whyNoMotion(); !why.empty()) pause(why);
}

void SimulatedRobot::move() {
    const RobotState state = machine_.state();
    if (state == RobotState::executing) {
        const SpeedProfile::State at = profile_->at(now() - profile_start_s_);
        along_mm_ = at.along_mm;
        speed_mm_s_ = at.speed_mm_s;
    } else if (speed_mm_s_ > 0) {  // held or stopped: to rest along the path
        const double a = options_.acceleration_mm_s2, time = std::min(options_.cycle_s, speed_mm_s_ / a);
        along_mm_ = std::min(along_mm_ + time * (speed_mm_s_ - 0.5 * a * time), track_->length());
        speed_mm_s_ = time < options_.cycle_s ? 0 : speed_mm_s_ - a * time;
    }
    if (track_) commanded_ = track_->poseAt(along_mm_);
    tremble();
    const Rigid3 before = true_pose_;
    true_pose_ = believed().perturbed(calibrationErrorAt(commanded_.translation()));
    // At rest too: a bone may move into the cutter, and it trembles.
    const double removed_mm3 = surroundings_ ? surroundings_(before, true_pose_) : 0;
    const double keep = std::exp(-options_.cycle_s / options_.force_time_s);
    force_n_ = keep * force_n_ + (1 - keep) * options_.force_per_rate * removed_mm3 / options_.cycle_s;
    if (!(removed_mm3 >= 0 && force_n_ <= options_.most_force_n)) {
        fail(fmt::format("force on the cutter of {:.0f} N, limit {:.0f} N", force_n_, options_.most_force_n));
        return;
    }
    if (state == RobotState::executing && now() - profile_start_s_ >= profile_->duration()) {
        if (!machine_.apply(RobotEvent::finish)) throw std::logic_error("a motion that is executed can finish");
    }
}

void SimulatedRobot::tremble() {
    const double keep = std::exp(-options_.cycle_s / kTrembleTime);
    const double renew = std::sqrt((1 - keep * keep) / 3);
    for (int k = 0; k < 6; ++k) {
        tremble_[k] =
            keep * tremble_[k] + renew * (k < 3 ? options_.tremble_mm : options_.tremble_rad) * random_.normal();
    }
}

}  // namespace fluorocut
