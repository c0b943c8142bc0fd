#include "core/robot/supervisor.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "core/base/option_checks.h"

namespace fluorocut {
namespace {

using Kind = RefusalKind;

void addRegistration(const MotionRequest& request, const SupervisorLimits& limits, std::vector<Refusal>& reasons) {
    const RegistrationStanding& registration = request.registration;
    if (registration.id.empty() || registration.accepted_by.empty())
        reasons.push_back({Kind::registrationNotAccepted, "Nobody has accepted the registration."});
    if (!registration.fresh || !registration.stale_because.empty()) {
        reasons.push_back({Kind::registrationStale,
                           fmt::format("The registration is stale: {}.", registration.stale_because.empty()
                                                                             ? "it is not known to hold still"
                                                                             : registration.stale_because)});
    }
    const double age = registration.age_s;
    if (!(age >= 0 && age <= limits.most_registration_age_s)) {
        reasons.push_back({Kind::registrationAge, fmt::format("The registration's age is {:.0f} s, not 0 to {:.0f} s.",
                                                              age, limits.most_registration_age_s)});
    }
    // A bound of zero was never worked out: no registration is exact.
    const double bound = registration.error_bound_mm, room = roomOf(request, limits);
    if (!(bound > 0 && bound <= room)) {
        reasons.push_back(
            {Kind::registrationUncertain,
             fmt::format("The registration's error bound for the next cavity is {:.2f} mm, not more than "
                         "0 and at most the {:.2f} mm of room {}.",
                         bound, room, request.inset_mm > 0 ? "inside the final cavity" : "that its envelope has")});
    }
}

void addPath(const MotionRequest& request, std::vector<Refusal>& reasons) {
    if (!request.motion) {
        reasons.push_back({Kind::pathNotChecked, "There is no path that was checked twice."});
        reasons.push_back({Kind::pathOfOtherRegistration, "It is not known for which registration the path was made."});
        reasons.push_back({Kind::pathOfOtherStage, "It is not known for which stage the path was made."});
        return;
    }
    const CheckedMotion& motion = *request.motion;
    const std::string& id = request.registration.id;
    if (id.empty() || motion.registration() != id) {
        reasons.push_back({Kind::pathOfOtherRegistration,
                           fmt::format("The path was made for the registration '{}', which now is '{}'.",
                                       motion.registration(), id)});
    }
    const std::string& stage = request.time_out.stage.in_case;
    if (stage.empty() || motion.stage() != stage) {
        reasons.push_back(
            {Kind::pathOfOtherStage,
             fmt::format("The path was made for the stage '{}', the case is at '{}'.", motion.stage(), stage)});
    }
}

void addItem(Kind kind, const char* what, const TimeOutItem& item, std::vector<Refusal>& reasons) {
    if (item.in_case.empty()) {
        reasons.push_back({kind, fmt::format("The case does not say which {} it is.", what)});
    } else if (item.confirmed.empty()) {
        reasons.push_back({kind, fmt::format("The {}, '{}', has not been confirmed.", what, item.in_case)});
    } else if (item.confirmed != item.in_case) {
        reasons.push_back({kind, fmt::format("The {} was confirmed as '{}', the case says '{}'.", what, item.confirmed,
                                             item.in_case)});
    }
}

void addTimeOut(const TimeOut& time_out, const SupervisorLimits& limits, std::vector<Refusal>& reasons) {
    addItem(Kind::timeOutPatient, "patient", time_out.patient, reasons);
    addItem(Kind::timeOutSide, "side", time_out.side, reasons);
    addItem(Kind::timeOutImplant, "implant", time_out.implant, reasons);
    addItem(Kind::timeOutStage, "stage", time_out.stage, reasons);
    const double age = time_out.calibration_age_s;
    if (!(age >= 0 && age <= limits.most_calibration_age_s)) {
        reasons.push_back(
            {Kind::timeOutCalibrationAge, fmt::format("The calibration's age is {:.1f} h, not 0 to {:.1f} h.",
                                                      age / 3600, limits.most_calibration_age_s / 3600)});
    } else if (!time_out.calibration_age_confirmed) {
        reasons.push_back({Kind::timeOutCalibrationAge, "The calibration's age has not been confirmed."});
    }
    if (time_out.confirmed_by.empty()) reasons.push_back({Kind::timeOutNobody, "Nobody has signed the time-out."});
}

Result<void> noneOf(const std::vector<Refusal>& reasons) {
    if (reasons.empty()) return {};
    std::string all;
    for (const Refusal& reason : reasons)
        all += fmt::format("{}{}", all.empty() ? "" : " ", reason.sentence);
    return noSolution("robot",
                      fmt::format("{} {} against motion", reasons.size(), reasons.size() == 1 ? "reason" : "reasons"),
                      "none", all);
}

}  // namespace

Result<void> SupervisorLimits::validate() const {
    return requireRanges({{"envelope_delta_mm", envelope_delta_mm, 0.5, 1.0, "mm"},
                          {"most_inset_mm", most_inset_mm, 0.5, 10, "mm"},
                          {"most_registration_age_s", most_registration_age_s, 1, 4 * 3600, "s"},
                          {"most_calibration_age_s", most_calibration_age_s, 1, 7 * 24 * 3600, "s"}});
}

double roomOf(const MotionRequest& request, const SupervisorLimits& limits) {
    if (request.inset_mm == 0) return limits.envelope_delta_mm;
    if (request.inset_mm > 0) return std::min(request.inset_mm, limits.most_inset_mm);
    return std::numeric_limits<double>::quiet_NaN();
}

std::vector<Refusal> refusals(const MotionRequest& request, const SupervisorLimits& limits) {
    std::vector<Refusal> reasons;
    if (auto valid = limits.validate(); !valid) reasons.push_back({Kind::limits, valid.error().message()});
    addRegistration(request, limits, reasons);
    addPath(request, reasons);
    addTimeOut(request.time_out, limits, reasons);
    return reasons;
}

Supervisor::Supervisor(std::unique_ptr<RobotAdaptor> robot, const SupervisorLimits& limits)
    : robot_(std::move(robot)), limits_(limits) {
    if (!robot_) throw std::logic_error("a supervisor needs a robot");
}

std::vector<Refusal> Supervisor::refusals(const MotionRequest& request) const {
    return fluorocut::refusals(request, limits_);
}

Result<void> Supervisor::execute(const MotionRequest& request) {
    if (auto none = noneOf(refusals(request)); !none) return none;
    auto started = robot_->execute(*request.motion);
    if (started) executed_ = request.motion;
    return started;
}

std::vector<Refusal> Supervisor::refusalsToGoOn(const MotionRequest& request) const {
    std::vector<Refusal> reasons = refusals(request);
    if (request.motion && !(executed_ && executed_->sameAs(*request.motion)))
        reasons.push_back({Kind::pathNotChecked, "This is not the motion that was begun."});
    return reasons;
}

Result<void> Supervisor::resume(const MotionRequest& request) {
    if (auto none = noneOf(refusalsToGoOn(request)); !none) return none;
    return robot_->resume();
}

std::vector<Refusal> Supervisor::watch(const MotionRequest& request) {
    std::vector<Refusal> reasons = refusalsToGoOn(request);
    const bool moving = robot_->state() == RobotState::executing;
    if (reasons.empty() || !moving || robot_->hold()) robot_->heartbeat();
    return reasons;
}

}  // namespace fluorocut
