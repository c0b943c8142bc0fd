// A motion that a robot may execute: poses of the cutter with feeds, which two checkers have looked at.
//
// A MotionProposal is what somebody would like to run; it cannot be changed once it is made. A MotionChecker that finds
// nothing wrong with it gives a CheckToken for that very proposal; nothing else can make one. Two tokens of different
// checkers for one proposal whose numbers are in order make a CheckedMotion, and only that can be executed. So `robot`
// need not know what is checked: the envelope of a cavity, the reach of an arm.
//
// Frames: steps are robot_from_cutter (frames.h). Between steps the cutter goes straight and turns evenly. mm, s, rad.
//
// To write a checker: derive from MotionChecker and give `judge`, independent of the other one: no code in common.
#pragma once

#include <cstddef>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/rigid3.h"

namespace fluorocut {

struct MotionStep {
    Rigid3 robot_from_cutter;
    // On the way to this pose; of the first step, at which the cutter already stands, it is not used.
    double feed_mm_s = std::numeric_limits<double>::quiet_NaN();
};

struct MotionProposal {
    const std::string stage;         // of the procedure, that it cuts
    const std::string registration;  // by which the poses were carried into the robot's frame
    const std::vector<MotionStep> steps;
};

class CheckToken {
  public:
    const std::string& checker() const { return checker_; }

  private:
    friend class MotionChecker;
    friend class CheckedMotion;
    CheckToken(std::shared_ptr<const MotionProposal> proposal, std::string checker)
        : proposal_(std::move(proposal)), checker_(std::move(checker)) {}

    std::shared_ptr<const MotionProposal> proposal_;
    std::string checker_;
};

class MotionChecker {
  public:
    virtual ~MotionChecker() = default;

    virtual std::string name() const = 0;
    // A token, or what is wrong with the motion. No proposal is a broken contract.
    Result<CheckToken> check(const std::shared_ptr<const MotionProposal>& proposal) const;

  private:
    virtual Result<void> judge(const MotionProposal& proposal) const = 0;
};

struct MotionLimits {
    double most_feed_mm_s = 60;
    double most_step_mm = 200;  // farther from one step to the next is a jump
    double most_turn_rad = 0.6;
    std::size_t most_steps = 2'000'000;

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

class CheckedMotion {
  public:
    // noSolution: one checker twice, or tokens of two proposals. invalidInput names the first step with numbers out of
    // order.
    static Result<CheckedMotion> make(const CheckToken& first, const CheckToken& second,
                                      const MotionLimits& limits = {});

    const std::string& stage() const { return proposal_->stage; }
    const std::string& registration() const { return proposal_->registration; }
    const std::vector<MotionStep>& steps() const { return proposal_->steps; }
    const std::string& firstChecker() const { return first_checker_; }
    const std::string& secondChecker() const { return second_checker_; }
    bool sameAs(const CheckedMotion& other) const { return proposal_ == other.proposal_; }

  private:
    CheckedMotion(std::shared_ptr<const MotionProposal> proposal, std::string first, std::string second)
        : proposal_(std::move(proposal)), first_checker_(std::move(first)), second_checker_(std::move(second)) {}

    std::shared_ptr<const MotionProposal> proposal_;
    std::string first_checker_, second_checker_;
};

}  // namespace fluorocut
