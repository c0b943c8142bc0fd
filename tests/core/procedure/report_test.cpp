#include "core/procedure/report.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/procedure/by_limits.h"
#include "tests/core/procedure/rig.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using testing::AllOf;
using testing::HasSubstr;

TEST(ReportSlow, TellsWhatWasDoneAndWhatIsNext) {
    test::ScratchFolder scratch;
    test::Rig rig;
    Result<Procedure> procedure =
        Procedure::begin(test::newCase(scratch / "a.fluorocut"), rig.setup(), rig.equipment());
    ASSERT_OK(procedure);
    const Result<ProcedureReport> begun = reportOf(procedure->store());
    ASSERT_OK(begun);
    EXPECT_FALSE(begun->finished);
    EXPECT_THAT(begun->conclusion, HasSubstr("images 0"));
    EXPECT_TRUE(begun->stages.empty());

    ASSERT_OK(runByLimits(*procedure, "limits"));
    const Result<ProcedureReport> report = reportOf(procedure->store());
    ASSERT_OK(report);
    EXPECT_TRUE(report->finished);
    EXPECT_THAT(report->conclusion, HasSubstr("final cavity"));
    ASSERT_EQ(report->stages.size(), rig.setup().plan.insets_mm.size());
    EXPECT_EQ(report->decisions.size(), procedure->steps().size());
    double shares = 0;
    for (const ReportTerm& term : report->budget)
        shares += term.share;
    EXPECT_GT(shares, 0.5);  // the largest terms
    EXPECT_LE(shares, 1 + 1e-9);
    for (const ReportStage& stage : report->stages) {
        EXPECT_TRUE(std::isfinite(stage.announced_mm));
        EXPECT_TRUE(accepted(stage.acceptance)) << stage.name;
        ASSERT_EQ(stage.pictures.size(), rig.setup().views.size());
        for (std::size_t i = 0; i < stage.pictures.size(); ++i) {
            const CArm& carm = rig.setup().views[i].carm;
            int planned = 0, found = 0;
            for (const ReportCurve& curve : stage.pictures[i].curves) {
                ++(curve.kind == ReportCurve::Kind::planned ? planned : found);
                for (const Vector2& p : curve.points)
                    EXPECT_TRUE(p.x() > -1 && p.y() > -1 && p.x() < carm.columns && p.y() < carm.rows);
            }
            EXPECT_GT(planned, 0);
            EXPECT_GT(found, 0);
        }
    }
    EXPECT_EQ(report->plan_pictures.size(), rig.setup().views.size());
    EXPECT_EQ(report->views.size(), rig.setup().views.size());
    for (const ReportView& view : report->views) {
        EXPECT_LT(view.residual_mm, 5) << view.name;  // within the registration's own limit
        EXPECT_EQ(view.beads_px.size(), report->stages.size());
    }
    // Calibration (2), plan, one for each view, registration, two for each stage.
    EXPECT_EQ(report->poses.size(), 4 + report->views.size() + 2 * report->stages.size());
    EXPECT_THAT(report->budget_at, testing::Not(HasSubstr("the the")));
    EXPECT_EQ(report->newest_hash.size(), 64U);
    const Result<std::string> page = html(*report);
    ASSERT_OK(page);
    EXPECT_THAT(*page, AllOf(HasSubstr("Cut 1 of 2"), HasSubstr("class=\"curve found\"")));
}

TEST(Report, ACaseWithoutAProcedureIsRefused) {
    test::ScratchFolder scratch;
    const CaseStore store = test::newCase(scratch / "a.fluorocut");
    const Result<ProcedureReport> report = reportOf(store);
    ASSERT_FALSE(report);
    EXPECT_THAT(report.error().message(), HasSubstr("no procedure"));
}

}  // namespace
}  // namespace fluorocut
