// Motions for the robot's tests: checked by two checkers that have nothing to say.
#pragma once

#include <string>
#include <vector>

#include "core/robot/checked_motion.h"

namespace fluorocut {

class AgreeableChecker : public MotionChecker {
  public:
    explicit AgreeableChecker(std::string name) : name_(std::move(name)) {}
    std::string name() const override { return name_; }

  private:
    Result<void> judge(const MotionProposal&) const override { return {}; }
    std::string name_;
};

inline Result<CheckedMotion> tryMotion(const std::vector<MotionStep>& steps, const std::string& stage = "stage 1",
                                       const std::string& registration = "registration 7") {
    const auto proposal = std::make_shared<const MotionProposal>(MotionProposal{stage, registration, steps});
    const CheckToken one = AgreeableChecker("one").check(proposal).value();
    const CheckToken two = AgreeableChecker("two").check(proposal).value();
    return CheckedMotion::make(one, two);
}

// Along straight lines, in one direction of the spindle.
inline CheckedMotion motionThrough(const std::vector<Vector3>& places, double feed_mm_s,
                                   const std::string& stage = "stage 1",
                                   const std::string& registration = "registration 7") {
    std::vector<MotionStep> steps;
    for (const Vector3& place : places)
        steps.push_back({Rigid3::fromTranslation(place), feed_mm_s});
    return tryMotion(steps, stage, registration).value();
}

}  // namespace fluorocut
