// What the procedure does not do: cut with a plan that was tampered with, on a registration that is too uncertain, or
// go on when something is wrong with the images or the outcome.
#include <gmock/gmock.h>

#include "core/procedure/by_limits.h"
#include "core/procedure/standing.h"
#include "core/procedure/step_results.h"
#include "tests/core/procedure/rig.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using testing::HasSubstr;

class ProcedureStops : public testing::Test {
  protected:
    void begin(const test::RigOptions& options = {}) {
        rig_ = std::make_unique<test::Rig>(options);
        Result<Procedure> begun =
            Procedure::begin(test::newCase(scratch_ / "a.fluorocut"), rig_->setup(), rig_->equipment());
        ASSERT_OK(begun);
        procedure_ = std::make_unique<Procedure>(std::move(*begun));
    }
    // Runs the next step and accepts it, whatever it says.
    Outcome acceptNext() {
        Result<Outcome> outcome = procedure_->run();
        EXPECT_OK(outcome);
        if (!outcome) return {};
        const Result<void> decided = procedure_->decide(true, "Dr Ito", "I know better");
        EXPECT_OK(decided);
        return std::move(*outcome);
    }
    void acceptUntil(const std::string& step) {
        while (procedure_->next() && procedure_->next()->name() != step && !HasFailure())
            acceptNext();
        ASSERT_EQ(procedure_->next()->name(), step);
    }
    StepState state(const std::string& step) const {
        for (const StepStanding& standing : procedure_->steps())
            if (standing.step.name() == step) return standing.state;
        return StepState::waiting;
    }
    bool robotMoved() const {
        return rig_->robot().trueRobotFromCutter().translation().norm() > 0.2;  // it began at the origin, and trembles
    }
    // The file, to be written to by somebody else meanwhile.
    template <class Change>
    void tamper(const Change& change) {
        procedure_.reset();
        {
            CaseStore store = test::openCase(scratch_ / "a.fluorocut");
            change(store, store.content().value());
        }
        Result<Procedure> resumed = Procedure::resume(test::openCase(scratch_ / "a.fluorocut"), rig_->equipment());
        ASSERT_OK(resumed);
        procedure_ = std::make_unique<Procedure>(std::move(*resumed));
    }

    test::ScratchFolder scratch_;
    std::unique_ptr<test::Rig> rig_;
    std::unique_ptr<Procedure> procedure_;
};

TEST_F(ProcedureStops, AskedByOnePictureForTwoViews) {
    begin();
    rig_->repeat_last = true;
    const Result<void> done = runByLimits(*procedure_, "limits");
    ASSERT_FALSE(done.ok());
    EXPECT_THAT(done.error().message(), HasSubstr("the same picture as one before"));
    // It waits for somebody; refused, it is done again.
    EXPECT_EQ(state("images 0"), StepState::done);
    const Result<void> judged = procedure_->decide(false, "Dr Ito", "take them again");
    ASSERT_OK(judged);
    EXPECT_EQ(state("images 0"), StepState::refused);
    rig_->repeat_last = false;
    EXPECT_TRUE(acceptNext().doubts.empty());
    EXPECT_EQ(state("register"), StepState::ready);
    // Nothing waits: nothing to be judged.
    EXPECT_FALSE(procedure_->decide(true, "Dr Ito", "again").ok());
    EXPECT_FALSE(procedure_->withdraw({StepKind::registration, 0}, "Dr Ito", "not there yet").ok());
}

TEST_F(ProcedureStops, AskedByExchangedViews) {
    begin();
    rig_->exchange_views = true;
    acceptUntil("register");
    // Each picture fits its own C-arm as well as the other's: what tells is where it looks.
    const Result<Outcome> outcome = procedure_->run();
    if (outcome) {
        EXPECT_THAT(outcome->doubts, testing::Contains(HasSubstr("are images exchanged?")));
    } else {
        EXPECT_EQ(outcome.error().code, ErrorCode::noSolution);
    }
}

TEST_F(ProcedureStops, SlowBeforeACutWithAPathThatIsNotItsStages) {
    begin();
    acceptUntil("time-out 1");
    // Stage 1 with the path of stage 2, in a record with all hashes right and somebody's acceptance.
    tamper([](CaseStore& store, const CaseContent& content) {
        Step step = *newestStep(content, "plan");
        PlanResult plan = parsePlan(store.bytes(step.result).value(), "plan").value();
        plan.stages[0].path = plan.stages[1].path;
        Item item;
        item.schema = "fluorocut/step-plan/1";
        item.file_name = "plan.json";
        step.result = store.addItem(item, jsonText(plan)).value().hash;
        Decision decision;
        decision.step = store.addStep(step).value().record;
        decision.accepted = true;
        decision.who = decision.why = "somebody";
        EXPECT_TRUE(store.addDecision(decision).ok());
    });
    acceptUntil("cut 1");
    const Result<Outcome> cut = procedure_->run();
    ASSERT_FALSE(cut.ok());
    EXPECT_THAT(cut.error().message(), HasSubstr("beyond the envelope"));
    EXPECT_FALSE(robotMoved());
    EXPECT_EQ(state("cut 1"), StepState::ready);

    // A registration that is withdrawn takes everything with it that rests on it.
    const Result<void> withdrawn = procedure_->withdraw({StepKind::registration, 0}, "Dr Ito", "a bead was loose");
    ASSERT_OK(withdrawn);
    EXPECT_EQ(procedure_->next()->name(), "register");
    EXPECT_EQ(state("images 0"), StepState::accepted);
    EXPECT_EQ(state("plan"), StepState::stale);
    EXPECT_EQ(state("time-out 1"), StepState::stale);
    EXPECT_EQ(state("cut 1"), StepState::waiting);
    EXPECT_FALSE(robotMoved());
}

TEST_F(ProcedureStops, SlowBeforeACutThatIsTooUncertainThoughPeopleInsist) {
    test::RigOptions options;
    options.mount_mm = 0.9;
    options.insets_mm = {1, 0};
    begin(options);
    const Result<void> done = runByLimits(*procedure_, "limits");
    ASSERT_FALSE(done.ok());
    EXPECT_THAT(done.error().message(), HasSubstr("1.00 mm of room inside the final cavity"));
    EXPECT_EQ(state("plan"), StepState::done);
    const Result<void> insisted = procedure_->decide(true, "Dr Ito", "it will do");
    ASSERT_OK(insisted);
    acceptUntil("cut 1");
    const Result<Outcome> cut = procedure_->run();
    ASSERT_FALSE(cut.ok());
    EXPECT_THAT(cut.error().message(), HasSubstr("error bound for the next cavity"));
    EXPECT_FALSE(robotMoved());
}

// The bone is pushed when a part of the cut is done.
class Push final : public Progress {
  public:
    explicit Push(SimulatedRobot& robot) : robot_(robot) {}
    void report(double fraction, std::string_view) override {
        if (fraction < 0.4 || pushed_) return;
        robot_.moveBone(Rigid3::fromTranslation({0.6, 0, 0}));
        pushed_ = true;
    }
    bool isCancelled() const override { return false; }

  private:
    SimulatedRobot& robot_;
    bool pushed_ = false;
};

TEST_F(ProcedureStops, SlowByABoneThatMovesInTheCutAndTheCaseKnowsWhatWasCut) {
    begin();
    acceptUntil("cut 1");
    Push push(rig_->robot());
    Result<Outcome> cut = procedure_->run(push);
    ASSERT_FALSE(cut.ok());
    EXPECT_THAT(cut.error().message(), HasSubstr("the bone has moved by 0."));
    EXPECT_EQ(rig_->robot().trueSpeed(), 0);
    EXPECT_EQ(state("cut 1"), StepState::ready);  // nothing was acknowledged
    const CaseContent content = procedure_->store().content().value();
    EXPECT_EQ(content.items.back().file_name, "cut_1_interrupted.json");
    EXPECT_EQ(newestStep(content, "cut 1"), nullptr);
    // Again, and again nothing: the bone is still elsewhere.
    cut = procedure_->run();
    ASSERT_FALSE(cut.ok());
    EXPECT_THAT(cut.error().message(), HasSubstr("the bone has moved"));
}

TEST_F(ProcedureStops, SlowWhenACutLiesWhereItWasSaidNotToLie) {
    test::RigOptions options;
    options.mount_mm = 0.7;
    options.honest_mount = false;  // hand-eye calibration claims 3 um
    begin(options);
    const Result<void> done = runByLimits(*procedure_, "limits");
    ASSERT_FALSE(done.ok());
    EXPECT_THAT(done.error().message(), HasSubstr("were announced; so much has a probability of"));
    EXPECT_EQ(procedure_->next()->name(), "correct 1");
    EXPECT_EQ(state("cut 2"), StepState::waiting);
}

}  // namespace
}  // namespace fluorocut
