#include "ui/panels/measure_tool.h"

#include <QTest>

#include <gtest/gtest.h>

#include "core/base/units.h"
#include "tests/support/fixtures.h"
#include "tests/ui/hand.h"
#include "tests/ui/panels/planning_scene.h"
#include "ui/panels/measurements.h"
#include "ui/panels/planning_tool.h"
#include "ui/spreadsheet/image_view.h"

namespace fluorocut::ui {
namespace {

class MeasureToolTest : public testing::Test {
  protected:
    MeasureToolTest() {
        session_.open(test::planningCase());
        view_.resize(512, 512);
        view_.show();
        view_.setImage(session_.state()->views[0].before.image, "AP");
        view_.setTool(&tool_);
    }
    QPointF at(const Vector2& px) const { return view_.widgetFromImage(QPointF(px.x(), px.y())); }
    const std::vector<PlacedMeasure>& placed() const { return session_.state()->measures; }
    void click(const Vector2& px) { test::drag(view_, at(px), at(px)); }

    Session session_;
    MeasureChoice choice_;
    PlanningTool tool_{session_, choice_, {0}};
    ImageView view_;
};

TEST_F(MeasureToolTest, ADragSetsALengthAndItIsOneStepToUndo) {
    choice_.setMode(MeasureMode::length);
    test::drag(view_, at({100, 100}), at({200, 100}));
    ASSERT_EQ(placed().size(), 1u);
    EXPECT_LT((placed()[0].points_px[0] - Vector2(100, 100)).norm(), 1e-9);
    EXPECT_LT((placed()[0].points_px[1] - Vector2(200, 100)).norm(), 1e-9);
    // 100 px of 0.32 mm, brought from the detector to the middle of the stem's depth.
    const auto view = registeredView(*session_.state(), {0});
    const Vector3 middle = session_.state()->plan.femur_from_implant * gripOf(session_.state()->plan).middle();
    const double scale = (view->imager_from_world * middle).z() / 1000;
    const Measure measure = measureOf(*session_.state(), placed()[0]);
    EXPECT_NEAR(measure.value, 32 * scale, 1e-9);
    EXPECT_NEAR(measure.sigma, std::hypot(std::sqrt(2.0) * kClickSigmaPx * 0.32 * scale, 32.0 / 1000 * kDepthSigmaMm),
                1e-6);
    EXPECT_NE(measure.plane.find("magnification"), std::string::npos);
    EXPECT_EQ(session_.undoText(), "Measure length");
    session_.undo();
    EXPECT_TRUE(placed().empty());
    session_.redo();
    EXPECT_EQ(placed().size(), 1u);
}

TEST_F(MeasureToolTest, WithoutAnImplantALengthIsInTheDetector) {
    CaseState state = *session_.state();
    state.plan = {};
    state.measures.push_back({MeasureKind::length, 0, {{100, 100}, {200, 100}}});
    const Measure measure = measureOf(state, state.measures[0]);
    EXPECT_NEAR(measure.value, 32, 1e-9);
    EXPECT_EQ(measure.plane, "in the detector plane");
    state.measures[0].view = 17;
    EXPECT_TRUE(std::isnan(measureOf(state, state.measures[0]).value));
}

TEST_F(MeasureToolTest, TwoClicksDoAsWell) {
    choice_.setMode(MeasureMode::length);
    click({100, 100});
    EXPECT_TRUE(placed().empty());
    click({100, 180});
    ASSERT_EQ(placed().size(), 1u);
    EXPECT_LT((placed()[0].points_px[1] - Vector2(100, 180)).norm(), 1e-9);
}

TEST_F(MeasureToolTest, TwoLinesMakeAnAngle) {
    choice_.setMode(MeasureMode::angle);
    test::drag(view_, at({100, 100}), at({200, 100}));
    EXPECT_TRUE(placed().empty());
    EXPECT_FALSE(session_.canUndo());
    test::drag(view_, at({100, 300}), at({200, 400}));
    ASSERT_EQ(placed().size(), 1u);
    EXPECT_EQ(placed()[0].kind, MeasureKind::angle);
    EXPECT_NEAR(measureOf(*session_.state(), placed()[0]).value, radiansFromDegrees(45), 1e-9);
    EXPECT_TRUE(textOf(measureOf(*session_.state(), placed()[0])).startsWith("45.0 \u00b1 "));
}

TEST_F(MeasureToolTest, EscapeForgetsWhatIsNotFinished) {
    choice_.setMode(MeasureMode::angle);
    test::drag(view_, at({100, 100}), at({200, 100}));
    QTest::keyClick(&view_, Qt::Key_Escape);
    test::drag(view_, at({100, 300}), at({200, 400}));
    EXPECT_TRUE(placed().empty());  // that was the first line again
}

TEST_F(MeasureToolTest, PointsAreMovedAndMeasuresDeleted) {
    choice_.setMode(MeasureMode::length);
    test::drag(view_, at({100, 100}), at({200, 100}));
    choice_.setMode(MeasureMode::none);
    // Taken 3 px beside the point: it does not jump to the cursor.
    test::drag(view_, at({203, 100}), at({203, 160}));
    EXPECT_LT((placed()[0].points_px[1] - Vector2(200, 160)).norm(), 1e-9);
    EXPECT_LT((placed()[0].points_px[0] - Vector2(100, 100)).norm(), 1e-9);
    EXPECT_EQ(session_.undoText(), "Move point of a measure");
    session_.undo();
    EXPECT_LT((placed()[0].points_px[1] - Vector2(200, 100)).norm(), 1e-9);
    session_.redo();

    test::sendMouse(view_, QEvent::MouseButtonPress, at({200, 160}), Qt::LeftButton, Qt::LeftButton);
    test::sendMouse(view_, QEvent::MouseMove, at({250, 160}), Qt::NoButton, Qt::LeftButton);
    EXPECT_TRUE(session_.isPreviewing());
    QTest::keyClick(&view_, Qt::Key_Escape);
    test::sendMouse(view_, QEvent::MouseButtonRelease, at({250, 160}), Qt::LeftButton, Qt::NoButton);
    EXPECT_LT((placed()[0].points_px[1] - Vector2(200, 160)).norm(), 1e-9);

    QTest::keyClick(&view_, Qt::Key_Delete);
    EXPECT_TRUE(placed().empty());
    EXPECT_EQ(session_.undoText(), "Delete measure");
    session_.undo();
    EXPECT_EQ(placed().size(), 1u);
    session_.undo();
    session_.undo();
    EXPECT_TRUE(placed().empty());
    QTest::keyClick(&view_, Qt::Key_Delete);  // what was chosen is not there any more
    EXPECT_TRUE(placed().empty());
}

TEST_F(MeasureToolTest, OnlyThisViewsPointsAreTaken) {
    CaseState state = *session_.state();
    state.measures.push_back({MeasureKind::length, 1, {{40, 60}, {40, 400}}});
    session_.open(state);
    test::drag(view_, at({40, 400}), at({60, 400}));
    EXPECT_FALSE(session_.canUndo());
    EXPECT_TRUE(tool_.overlay(view_).marks.empty() || tool_.overlay(view_).marks[0].ink != Ink::measure);
}

TEST_F(MeasureToolTest, TheImplantIsMovedWhenNothingIsMeasured) {
    const auto view = registeredView(*session_.state(), {0});
    const Vector2 stem =
        view->carm.project(view->imager_from_world * (session_.state()->plan.femur_from_implant * Vector3(0, 0, -60)));
    test::drag(view_, at(stem), at(stem) + QPointF(20, 0));
    EXPECT_EQ(session_.undoText(), "Move implant");
    choice_.setMode(MeasureMode::length);
    test::drag(view_, at(stem), at(stem) + QPointF(0, 50));
    EXPECT_EQ(session_.undoText(), "Measure length");
}

// A head 7 mm higher and 4 mm farther out than planned: the numbers come from two clicks.
TEST_F(MeasureToolTest, TheHeadsCentreInTwoViewsGivesLegLengthAndOffset) {
    CaseState state = *session_.state();
    state.canal = CanalAxis{{0, 0, -150}, {0, 0, 0}};
    state.measures.clear();
    session_.open(state);
    const Vector3 planned = state.plan.femur_from_implant * state.plan.implant->head_center;
    const Vector3 away = Vector3(planned.x(), planned.y(), 0).normalized();
    const Vector3 own = planned - 7 * Vector3::UnitZ() - 4 * away;
    auto measures = measuresOf(state, {});
    EXPECT_TRUE(std::isnan(measures[0].measure.value));
    EXPECT_NE(measures[0].measure.warnings.at(0).find("Head centre"), std::string::npos);
    EXPECT_EQ(textOf(measures[0].measure), "\u2013");

    choice_.setMode(MeasureMode::head_center);
    PlanningTool lateral(session_, choice_, {1});
    for (const std::size_t v : {0u, 1u}) {
        const auto view = registeredView(state, {v});
        view_.setTool(v == 0 ? &tool_ : &lateral);
        click(view->carm.project(view->imager_from_world * own));
        EXPECT_EQ(session_.undoText(), "Set head centre");
    }
    measures = measuresOf(*session_.state(), {});
    // 1e-6: clicks are exact here but for the widget's coordinates.
    EXPECT_NEAR(measures[0].measure.value, 7, 1e-6);
    EXPECT_NEAR(measures[1].measure.value, 4, 1e-6);
    // A click's pixel is 0.32 * 0.7 mm wide in the hip; two views see the height: less than one click's error.
    EXPECT_GT(measures[0].measure.sigma, 0.1);
    EXPECT_LT(measures[0].measure.sigma, 0.25);
    session_.undo();
    EXPECT_EQ(session_.state()->head_center.size(), 1u);
}

}  // namespace
}  // namespace fluorocut::ui
