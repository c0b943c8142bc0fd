// The real loop on the rig, from the first images to the final cavity: every number that judges it is the rig's truth.
#include <cstdio>
#include <map>

#include <gtest/gtest.h>

#include "core/base/units.h"
#include "core/procedure/by_limits.h"
#include "core/procedure/recompute.h"
#include "core/procedure/standing.h"
#include "core/procedure/step_results.h"
#include "tests/core/procedure/rig.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

std::string resultOf(const Procedure& procedure, const std::string& step) {
    const CaseContent content = procedure.store().content().value();
    return procedure.store().bytes(newestStep(content, step)->result).value();
}

// How far the cavity of a stage truly lies from its plan: where it was sent by what the procedure believed.
CavityOffset trueOffset(const test::Rig& rig, const Procedure& procedure, int stage) {
    const CutStepResult cut = parseCut(resultOf(procedure, "cut " + std::to_string(stage)), "cut").value();
    return offsetOf(wallPoints(rig.setup().plan.mesh, 2), rig.setup().plan.femur_from_cavity,
                    rig.trueFemurFromRobot() * cut.robot_from_cavity);
}

// The file can be opened again.
Error closed() {
    return noSolution("test", "a case that was closed", "another");
}

TEST(ProcedureLoop, SlowGoesFromTheFirstImagesToTheFinalCavityThoughKilledAfterEveryStep) {
    test::ScratchFolder scratch;
    const std::filesystem::path file = scratch / "a.fluorocut";
    test::Rig rig;
    {
        const Result<Procedure> begun = Procedure::begin(test::newCase(file), rig.setup(), rig.equipment());
        ASSERT_OK(begun);
    }
    std::vector<std::string> done;
    std::map<std::string, std::string> sentences;
    while (true) {
        // As after kill -9: nothing is left but the file.
        Result<Procedure> procedure = Procedure::resume(test::openCase(file), rig.equipment());
        ASSERT_OK(procedure);
        const std::optional<ProcedureStep> next = procedure->next();
        if (!next) break;
        const Result<Outcome> outcome = procedure->run();
        ASSERT_OK(outcome);
        EXPECT_EQ(outcome->step, *next);
        EXPECT_TRUE(outcome->doubts.empty()) << next->name() << ": " << outcome->doubts.front();
        for (const Judgement& judgement : outcome->acceptance)
            EXPECT_TRUE(judgement.accepted()) << next->name() << ": " << judgement.sentence();
        // Killed between the work and the judgement: it is still there, to the letter.
        procedure = closed();
        procedure = Procedure::resume(test::openCase(file), rig.equipment());
        ASSERT_OK(procedure);
        EXPECT_FALSE(procedure->run().ok());  // it has been done
        const Result<std::optional<Outcome>> waiting = procedure->pending();
        ASSERT_OK(waiting);
        ASSERT_TRUE(waiting->has_value());
        EXPECT_EQ((*waiting)->record, outcome->record);
        EXPECT_EQ((*waiting)->summary, outcome->summary);
        const Result<void> decided = procedure->decide(true, "Dr Ito", "as it should be");
        ASSERT_OK(decided);
        done.push_back(next->name());
        sentences[next->name()] = outcome->summary;
    }
    const std::vector<std::string> expected{"images 0", "register", "plan",      "time-out 1", "cut 1",
                                            "images 1", "locate 1", "correct 1", "time-out 2", "cut 2",
                                            "images 2", "locate 2", "correct 2"};
    EXPECT_EQ(done, expected);

    Result<Procedure> procedure = Procedure::resume(test::openCase(file), rig.equipment());
    ASSERT_OK(procedure);
    const CavityOffset first = trueOffset(rig, *procedure, 1), last = trueOffset(rig, *procedure, 2);
    const CutStepResult cut_1 = parseCut(resultOf(*procedure, "cut 1"), "cut 1").value();
    const CutStepResult cut_2 = parseCut(resultOf(*procedure, "cut 2"), "cut 2").value();
    std::printf("first cut %.3f mm, %.2f degrees off (95 %%: %.2f mm), last %.3f mm, %.2f degrees (%.2f mm)\n",
                first.most_mm, degreesFromRadians(first.turn_rad), cut_1.bound_mm, last.most_mm,
                degreesFromRadians(last.turn_rad), cut_2.bound_mm);
    // Registered to a millimetre, as the mount's error makes it; corrected to what a location knows, with cusps of 0.05
    // mm on the floor that it takes for the floor itself.
    EXPECT_LT(first.most_mm, 2 * cut_1.bound_mm);
    EXPECT_GT(first.most_mm, 0.2);
    EXPECT_LT(last.most_mm, 0.2);
    EXPECT_LT(last.most_mm, 0.6 * first.most_mm);
    EXPECT_LT(cut_2.bound_mm, 0.25);
    EXPECT_LT(cut_2.bound_mm, 0.3 * cut_1.bound_mm);

    // The same content gives the same results.
    Result<Recomputation> again = recompute(procedure->store());
    ASSERT_OK(again);
    EXPECT_EQ(again->steps.size(), 6u);  // register, plan, locate and correct, twice
    for (const RecomputedStep& step : again->steps)
        EXPECT_TRUE(step.same) << step.what;

    // Somebody's own registration, put in with all hashes right.
    RegistrationResult forged = parseRegistration(resultOf(*procedure, "register"), "register").value();
    forged.robot_from_femur.target_from_source =
        forged.robot_from_femur.target_from_source * Rigid3::fromTranslation({0.01, 0, 0});
    const CaseContent content = procedure->store().content().value();
    Step step = *newestStep(content, "register");
    procedure = closed();
    CaseStore store = test::openCase(file);
    Item item;
    item.schema = "fluorocut/step-register/1";
    item.file_name = "register.json";
    const Result<Item> added = store.addItem(item, jsonText(forged));
    ASSERT_OK(added);
    step.result = added->hash;
    const Result<Step> forgery = store.addStep(step);
    ASSERT_OK(forgery);
    again = recompute(store);
    ASSERT_OK(again);
    EXPECT_FALSE(again->same());
    int different = 0;
    for (const RecomputedStep& one : again->steps)
        different += !one.same;
    EXPECT_EQ(different, 1);
    EXPECT_EQ(again->steps.back().name, "register");
}

}  // namespace
}  // namespace fluorocut
