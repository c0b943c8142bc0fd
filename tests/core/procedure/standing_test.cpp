#include "core/procedure/standing.h"

#include <gtest/gtest.h>

namespace fluorocut {
namespace {

// The records of a case, one after another.
class Records {
  public:
    std::int64_t step(const std::string& name) {
        Step step;
        step.name = name;
        step.record = ++record_;
        content.steps.push_back(step);
        return record_;
    }
    void judge(std::int64_t step, bool accepted, const std::string& why = "so it is") {
        Decision decision;
        decision.step = step;
        decision.accepted = accepted;
        decision.who = "Dr Ito";
        decision.why = why;
        decision.record = ++record_;
        content.decisions.push_back(decision);
    }
    std::int64_t accepted(const std::string& name) {
        const std::int64_t record = step(name);
        judge(record, true);
        return record;
    }
    StepStanding of(const std::string& name) const {
        for (const StepStanding& standing : standingOf(content, 2))
            if (standing.step.name() == name) return standing;
        ADD_FAILURE() << "no step " << name;
        return {};
    }
    StepState state(const std::string& name) const { return of(name).state; }

    CaseContent content;

  private:
    std::int64_t record_ = 0;
};

TEST(Standing, StepsHaveTheirOrderAndTheirNames) {
    std::vector<std::string> names;
    for (const ProcedureStep& step : stepsOf(2)) {
        names.push_back(step.name());
        EXPECT_EQ(stepFromName(step.name()), step);
    }
    const std::vector<std::string> expected{"images 0", "register", "plan",      "time-out 1", "cut 1",
                                            "images 1", "locate 1", "correct 1", "time-out 2", "cut 2",
                                            "images 2", "locate 2", "correct 2"};
    EXPECT_EQ(names, expected);
    for (const char* other : {"", "register 1", "cut", "cut ", "cut x", "cut 1 ", "cut -1", "cut1", "procedure"})
        EXPECT_FALSE(stepFromName(other).has_value()) << other;
}

TEST(Standing, OnlyTheFirstStepIsReadyInANewCase) {
    const Records records;
    EXPECT_EQ(records.state("images 0"), StepState::ready);
    EXPECT_EQ(records.state("register"), StepState::waiting);
    EXPECT_EQ(records.state("correct 2"), StepState::waiting);
}

TEST(Standing, AStepIsDoneAcceptedOrRefused) {
    Records records;
    const std::int64_t images = records.step("images 0");
    EXPECT_EQ(records.state("images 0"), StepState::done);
    EXPECT_EQ(records.state("register"), StepState::waiting);
    records.judge(images, true);
    EXPECT_EQ(records.state("images 0"), StepState::accepted);
    EXPECT_EQ(records.state("register"), StepState::ready);
    records.judge(images, false, "blurred");
    EXPECT_EQ(records.state("images 0"), StepState::refused);
    EXPECT_EQ(records.of("images 0").why, "Dr Ito: blurred");
    EXPECT_EQ(records.state("register"), StepState::waiting);
    // Done again, it is another: the old refusal does not count.
    records.step("images 0");
    EXPECT_EQ(records.state("images 0"), StepState::done);
}

TEST(Standing, WhatRestsOnARefusedStepIsStaleAndSoItStaysWhenThatIsDoneAnew) {
    Records records;
    records.accepted("images 0");
    const std::int64_t registration = records.accepted("register");
    records.accepted("plan");
    records.accepted("time-out 1");
    EXPECT_EQ(records.state("cut 1"), StepState::ready);
    records.judge(registration, false, "a bead was moved");
    EXPECT_EQ(records.state("images 0"), StepState::accepted);
    EXPECT_EQ(records.state("register"), StepState::refused);
    EXPECT_EQ(records.state("plan"), StepState::stale);
    EXPECT_EQ(records.state("time-out 1"), StepState::stale);
    EXPECT_EQ(records.of("plan").why, "register is no longer accepted");
    EXPECT_EQ(records.state("cut 1"), StepState::waiting);

    records.accepted("register");
    EXPECT_EQ(records.state("register"), StepState::accepted);
    EXPECT_EQ(records.state("plan"), StepState::stale);
    EXPECT_EQ(records.of("plan").why, "register was done anew");
    // Accepting the old plan once more does not make it fresh: it was made of the old registration.
    records.judge(newestStep(records.content, "plan")->record, true);
    EXPECT_EQ(records.state("plan"), StepState::stale);
    records.accepted("plan");
    EXPECT_EQ(records.state("plan"), StepState::accepted);
    EXPECT_EQ(records.state("time-out 1"), StepState::stale);
}

TEST(Standing, ACutIsMadeByTheNewestRegistration) {
    EXPECT_EQ(registrationFor(1).name(), "register");
    EXPECT_EQ(registrationFor(2).name(), "correct 1");
    EXPECT_EQ(registrationFor(3).name(), "correct 2");
}

}  // namespace
}  // namespace fluorocut
