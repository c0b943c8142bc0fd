#include "core/robot/checked_motion.h"

#include <utility>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/units.h"

namespace fluorocut {
namespace {

Result<void> checkNumbers(const std::vector<MotionStep>& steps, const MotionLimits& limits) {
    if (steps.size() < 2 || steps.size() > limits.most_steps) {
        return invalidInput("motion", fmt::format("{} steps", steps.size()), fmt::format("2 to {}", limits.most_steps),
                            "Plan the path again.");
    }
    for (std::size_t i = 1; i < steps.size(); ++i) {
        const std::string where = fmt::format("motion, step {}", i);
        const double feed = steps[i].feed_mm_s;
        if (!(feed > 0 && feed <= limits.most_feed_mm_s)) {
            return invalidInput(where, fmt::format("a feed of {} mm/s", feed),
                                fmt::format("more than 0, at most {} mm/s", limits.most_feed_mm_s),
                                "Plan the path with slower feeds.");
        }
        const Rigid3& from = steps[i - 1].robot_from_cutter;
        const Rigid3& to = steps[i].robot_from_cutter;
        const double jump = (to.translation() - from.translation()).norm();
        if (!(jump <= limits.most_step_mm)) {
            return invalidInput(where, fmt::format("a jump of {:.3f} mm", jump),
                                fmt::format("at most {} mm from the step before", limits.most_step_mm),
                                "Plan the path again, without gaps.");
        }
        const double turn = from.rotation().angularDistance(to.rotation());
        if (!(turn <= limits.most_turn_rad)) {
            return invalidInput(
                where, fmt::format("a turn of {:.3f} degrees", degreesFromRadians(turn)),
                fmt::format("at most {:.3f} degrees from the step before", degreesFromRadians(limits.most_turn_rad)),
                "Plan the path with more steps.");
        }
    }
    return {};
}

}  // namespace

Result<CheckToken> MotionChecker::check(const std::shared_ptr<const MotionProposal>& proposal) const {
    if (!proposal) throw std::logic_error("a motion checker needs a motion");
    if (auto verdict = judge(*proposal); !verdict) return verdict.error();
    return CheckToken(proposal, name());
}

Result<void> MotionLimits::validate() const {
    return requireRanges({{"most_feed_mm_s", most_feed_mm_s, 0.01, 250, "mm/s"},  // ISO 10218-1: reduced speed
                          {"most_step_mm", most_step_mm, 0.01, 1000, "mm"},
                          {"most_turn_rad", most_turn_rad, 1e-4, 1.6, "rad"},
                          {"most_steps", static_cast<double>(most_steps), 2, 1e8, ""}});
}

Result<CheckedMotion> CheckedMotion::make(const CheckToken& first, const CheckToken& second,
                                          const MotionLimits& limits) {
    if (auto valid = limits.validate(); !valid) return valid.error();
    if (first.proposal_ != second.proposal_) {
        return noSolution("motion", "checks of two different motions", "two checks of the same one",
                          "Check the motion again by both checkers.");
    }
    if (first.checker_ == second.checker_) {
        return noSolution("motion", fmt::format("two checks by '{}'", first.checker_), "two different checkers",
                          "Check the motion by the other checker too.");
    }
    if (auto numbers = checkNumbers(first.proposal_->steps, limits); !numbers) return numbers.error();
    return CheckedMotion(first.proposal_, first.checker_, second.checker_);
}

}  // namespace fluorocut
