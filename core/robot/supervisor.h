// Supervisor: stands between the procedure and the robot, and owns it, so that there is no way round. Motion passes
// only when all of this holds; whatever is missing, not finite or left at its default counts against it:
//
//   registration  accepted by somebody, fresh, not older than its limit, and certain enough for the next cavity: its
//                 error bound is within the room that this one has. A stage before the last must stay inside the final
//                 cavity: its room is its inset; the last one's is the envelope's delta (0.5 to 1 mm)
//   path          checked twice (checked_motion.h), by this registration, for the stage that was confirmed
//   time-out      somebody has confirmed patient, side, implant, stage, and the age of the calibration, and what was
//                 confirmed is what the case says
//
// What takes motion away (hold, stop, disable) always passes. Going on after a pause asks everything again, of the same
// motion; and so does `watch`, while it moves: a registration that becomes stale holds the robot.
//
// All reasons against a motion are given, each a sentence.
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/robot/robot_adaptor.h"

namespace fluorocut {

struct RegistrationStanding {
    std::string id;           // of the result, as the case has it
    std::string accepted_by;  // empty: nobody has
    bool fresh = false;       // nothing it rests on has changed since
    std::string stale_because;
    double age_s = std::numeric_limits<double>::quiet_NaN();
    // Of the next cavity's surface, wherever on it the error is largest, 95 %.
    double error_bound_mm = std::numeric_limits<double>::quiet_NaN();
};

// One item of the time-out: what the case says, and what the person who looked has said.
struct TimeOutItem {
    std::string in_case;
    std::string confirmed;
};

struct TimeOut {
    TimeOutItem patient, side, implant, stage;
    double calibration_age_s = std::numeric_limits<double>::quiet_NaN();
    bool calibration_age_confirmed = false;
    std::string confirmed_by;  // empty: nobody
};

struct MotionRequest {
    RegistrationStanding registration;
    // How far inside the final cavity the stage to be cut lies; 0: it is the final one.
    double inset_mm = std::numeric_limits<double>::quiet_NaN();
    std::optional<CheckedMotion> motion;  // empty: no path has been checked twice
    TimeOut time_out;
};

struct SupervisorLimits {
    double envelope_delta_mm = 0.75;
    double most_inset_mm = 5;  // that counts as room: a registration less certain than this is none
    double most_registration_age_s = 1800;
    double most_calibration_age_s = 24 * 3600;

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

enum class RefusalKind {
    limits,
    registrationNotAccepted,
    registrationStale,
    registrationAge,
    registrationUncertain,
    pathNotChecked,
    pathOfOtherRegistration,
    pathOfOtherStage,
    timeOutPatient,
    timeOutSide,
    timeOutImplant,
    timeOutStage,
    timeOutCalibrationAge,
    timeOutNobody,
};

// How far the stage may lie from where it belongs; NaN for an inset that is none.
double roomOf(const MotionRequest& request, const SupervisorLimits& limits);

struct Refusal {
    RefusalKind kind;
    std::string sentence;
};

// All reasons why a motion may not be run, in the order above; none: it may.
std::vector<Refusal> refusals(const MotionRequest& request, const SupervisorLimits& limits);

class Supervisor {
  public:
    // No robot throws std::logic_error.
    explicit Supervisor(std::unique_ptr<RobotAdaptor> robot, const SupervisorLimits& limits = {});

    const RobotAdaptor& robot() const { return *robot_; }
    std::vector<Refusal> refusals(const MotionRequest& request) const;

    // noSolution with every reason, or the robot's own refusal.
    Result<void> execute(const MotionRequest& request);
    // The motion that was paused, and no other.
    Result<void> resume(const MotionRequest& request);
    // While a motion is under way, with what holds now, at every heartbeat, which it sends: as soon as something speaks
    // against the motion, or it is another one, the robot is held; if it cannot be told, its heartbeats end.
    std::vector<Refusal> watch(const MotionRequest& request);

    Result<void> connect() { return robot_->connect(); }
    Result<void> disconnect() { return robot_->disconnect(); }
    Result<void> enable() { return robot_->enable(); }
    Result<void> disable() { return robot_->disable(); }
    Result<void> hold() { return robot_->hold(); }
    Result<void> stop() { return robot_->stop(); }
    Result<void> acknowledgeFault() { return robot_->acknowledgeFault(); }
    Result<void> setBoneReference() { return robot_->setBoneReference(); }
    void heartbeat() { robot_->heartbeat(); }  // where nothing moves; otherwise `watch`
    std::vector<RobotFeedback> takeFeedback() { return robot_->takeFeedback(); }
    void advance(double seconds) { robot_->advance(seconds); }

  private:
    std::vector<Refusal> refusalsToGoOn(const MotionRequest& request) const;

    std::unique_ptr<RobotAdaptor> robot_;
    SupervisorLimits limits_;
    std::optional<CheckedMotion> executed_;
};

}  // namespace fluorocut
