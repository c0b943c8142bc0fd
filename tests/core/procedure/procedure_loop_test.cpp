// The real loop on the rig: images, registration, cuts by the simulated robot, correction.
#include <cstdio>

#include <gtest/gtest.h>

#include "core/base/units.h"
#include "core/procedure/by_limits.h"
#include "tests/core/procedure/rig.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

TEST(ProcedureLoop, DISABLED_SlowRunsFromTheFirstImagesToTheFinalCavity) {
    test::ScratchFolder scratch;
    test::Rig rig;
    Result<Procedure> procedure =
        Procedure::begin(test::newCase(scratch / "a.fluorocut"), rig.setup(), rig.equipment());
    ASSERT_OK(procedure);
    const Result<void> done = runByLimits(*procedure, "limits", Progress::none(), [](const Outcome& outcome) {
        std::printf("%s: %s\n", outcome.step.name().c_str(), outcome.summary.c_str());
        for (const std::string& warning : outcome.warnings)
            std::printf("    warning: %s\n", warning.c_str());
        for (const std::string& doubt : outcome.doubts)
            std::printf("    doubt: %s\n", doubt.c_str());
        for (const Judgement& judgement : outcome.acceptance)
            if (!judgement.accepted()) std::printf("    %s\n", judgement.sentence().c_str());
    });
    ASSERT_OK(done);
}

}  // namespace
}  // namespace fluorocut
