#include "ui/panels/implant_tool.h"

#include <QSignalSpy>
#include <QTest>

#include <gtest/gtest.h>

#include "core/base/units.h"
#include "tests/ui/hand.h"
#include "tests/ui/panels/planning_scene.h"
#include "ui/spreadsheet/image_view.h"

namespace fluorocut::ui {
namespace {

class ImplantToolTest : public testing::Test {
  protected:
    ImplantToolTest() {
        session_.open(test::planningCase());
        view_.resize(512, 512);
        view_.show();
        view_.setImage(session_.state()->views[0].before.image, "AP");
        view_.setTool(&tool_);
    }

    const Rigid3& pose() const { return session_.state()->plan.femur_from_implant; }
    const Rigid3& committed() const { return session_.committed()->plan.femur_from_implant; }
    View carm(std::size_t view = 0) const { return *registeredView(*session_.state(), {view}); }
    Vector3 inImager(const Rigid3& pose_of, const Vector3& p) const { return carm().imager_from_world * (pose_of * p); }
    // Where a point of the implant lies in the widget.
    QPointF at(const Vector3& p, const Rigid3& pose_of) const {
        const Vector2 px = carm().carm.project(inImager(pose_of, p));
        return view_.widgetFromImage(QPointF(px.x(), px.y()));
    }
    QPointF at(const Vector3& p) const { return at(p, pose()); }
    static double difference(const Rigid3& a, const Rigid3& b) { return (a.matrix() - b.matrix()).norm(); }
    // One step was made, and it can be undone.
    void expectOneStep(const Rigid3& before, const char* what) {
        EXPECT_FALSE(session_.isPreviewing());
        EXPECT_EQ(session_.undoText(), QString(what));
        EXPECT_GT(difference(committed(), before), 0);
        session_.undo();
        EXPECT_EQ(difference(committed(), before), 0);
        EXPECT_FALSE(session_.canUndo());
        session_.redo();
    }

    Session session_;
    ImplantTool tool_{session_, {0}};
    ImageView view_;
    const Vector3 middle_{0, 0, -60};
};

TEST_F(ImplantToolTest, ADragMovesTheImplantWithTheCursorAtItsDepth) {
    const Rigid3 before = pose();
    const DisplayWindow window = view_.displayWindow();
    const QPointF from = at(middle_);
    test::drag(view_, from, from + QPointF(40, -25));
    EXPECT_EQ(view_.displayWindow(), window);
    expectOneStep(before, "Move implant");
    // What lay under the cursor lies under it again: the point of the stem's axis nearest to it is within 1 mm of depth
    // of what was held (midway through the stem), which is 1e-3 of the way: 0.05 px.
    const QPointF now = at(middle_);
    EXPECT_NEAR(now.x(), from.x() + 40, 0.1);
    EXPECT_NEAR(now.y(), from.y() - 25, 0.1);
    for (const Vector3& p : {Vector3(0, 0, 0), Vector3(20, 3, 20), Vector3(0, 0, -120)})
        EXPECT_NEAR(inImager(pose(), p).z(), inImager(before, p).z(), 1e-9);
}

TEST_F(ImplantToolTest, ADragIsAPreviewUntilItEnds) {
    const Rigid3 before = pose();
    const QPointF from = at(middle_);
    const QSignalSpy saved(&session_, &Session::committedTo);
    test::sendMouse(view_, QEvent::MouseButtonPress, from, Qt::LeftButton, Qt::LeftButton);
    test::sendMouse(view_, QEvent::MouseMove, from + QPointF(30, 0), Qt::NoButton, Qt::LeftButton);
    EXPECT_TRUE(session_.isPreviewing());
    EXPECT_GT(difference(pose(), before), 1);
    EXPECT_EQ(difference(committed(), before), 0);
    EXPECT_EQ(saved.count(), 0);

    QTest::keyClick(&view_, Qt::Key_Escape);
    EXPECT_FALSE(session_.isPreviewing());
    EXPECT_EQ(difference(pose(), before), 0);
    test::sendMouse(view_, QEvent::MouseMove, from + QPointF(60, 0), Qt::NoButton, Qt::LeftButton);
    test::sendMouse(view_, QEvent::MouseButtonRelease, from + QPointF(60, 0), Qt::LeftButton, Qt::NoButton);
    EXPECT_EQ(difference(pose(), before), 0);
    EXPECT_FALSE(session_.canUndo());
}

TEST_F(ImplantToolTest, AClickOrAWayOutAndBackIsNoStep) {
    const QPointF from = at(middle_);
    test::drag(view_, from, from);
    EXPECT_FALSE(session_.canUndo());
    test::sendMouse(view_, QEvent::MouseButtonPress, from, Qt::LeftButton, Qt::LeftButton);
    for (const double x : {20.0, 0.0})
        test::sendMouse(view_, QEvent::MouseMove, from + QPointF(x, 0), Qt::NoButton, Qt::LeftButton);
    test::sendMouse(view_, QEvent::MouseButtonRelease, from, Qt::LeftButton, Qt::NoButton);
    EXPECT_FALSE(session_.canUndo());
    EXPECT_FALSE(session_.isPreviewing());
}

TEST_F(ImplantToolTest, BesideTheImplantTheImagesWindowChanges) {
    const Rigid3 before = pose();
    const DisplayWindow window = view_.displayWindow();
    const QPointF beside = at(middle_) + QPointF(150, 0);
    test::drag(view_, beside, beside + QPointF(30, 30));
    EXPECT_NE(view_.displayWindow(), window);
    EXPECT_EQ(difference(pose(), before), 0);
}

TEST_F(ImplantToolTest, TheRingAtTheTipTurnsAboutTheShoulder) {
    const Rigid3 before = pose();
    const StemGrip grip = gripOf(session_.state()->plan);
    // To where the tip would be after 4 degrees: then that is the turn.
    const double angle = radiansFromDegrees(4);
    const Rigid3 expected = turned(carm(), before, grip.shoulder, angle);
    test::drag(view_, at(grip.tip), at(grip.tip, expected));
    expectOneStep(before, "Turn implant");
    EXPECT_LT(difference(pose(), expected), 1e-9);
}

TEST_F(ImplantToolTest, TheRingAtTheShoulderTurnsAboutTheTip) {
    const Rigid3 before = pose();
    const StemGrip grip = gripOf(session_.state()->plan);
    const Rigid3 expected = turned(carm(), before, grip.tip, radiansFromDegrees(-3));
    test::drag(view_, at(grip.shoulder), at(grip.shoulder, expected));
    expectOneStep(before, "Turn implant");
    EXPECT_LT(difference(pose(), expected), 1e-9);
}

TEST_F(ImplantToolTest, TheDotsTiltAndTurnAboutTheStem) {
    view_.setFocus();
    Rigid3 before = pose();
    const StemGrip grip = gripOf(session_.state()->plan);
    test::sendMouse(view_, QEvent::MouseMove, at(middle_), Qt::NoButton, Qt::NoButton);
    std::vector<Vector2> dots;
    const auto shown = [&] {
        dots.clear();
        view_.activateWindow();
        for (const OverlayMark& mark : tool_.overlay(view_).marks)
            if (mark.shape == MarkShape::dot) dots.push_back(mark.at_px);
        return dots.size();
    };
    QTest::qWait(0);
    ASSERT_EQ(shown(), 2u);
    const auto place = [&](const Vector2& px) { return view_.widgetFromImage(QPointF(px.x(), px.y())); };
    // 20 px up, along the stem's picture.
    test::drag(view_, place(dots[0]), place(dots[0]) + QPointF(0, -20));
    expectOneStep(before, "Tilt implant");
    EXPECT_LT((pose() * grip.shoulder - before * grip.shoulder).norm(), 1e-9);
    EXPECT_GT(inImager(pose(), grip.tip).z(), inImager(before, grip.tip).z());  // nearer to the detector
    // 20 px are 20 * 0.32 mm * 0.7 at the implant's depth, and as much of the tip (the stem's picture is not quite
    // vertical: 2 %).
    const double mm = 20 * 0.32 * (inImager(before, grip.shoulder).z() / 1000);
    EXPECT_NEAR(before.rotation().angularDistance(pose().rotation()) * grip.length(), mm, 0.02 * mm);

    session_.undo();
    before = pose();
    ASSERT_EQ(shown(), 2u);
    test::drag(view_, place(dots[1]), place(dots[1]) + QPointF(20, 0));
    expectOneStep(before, "Turn implant");
    for (const Vector3& p : {grip.shoulder, grip.tip})
        EXPECT_LT((pose() * p - before * p).norm(), 1e-9);
    EXPECT_NEAR(degreesFromRadians(before.rotation().angularDistance(pose().rotation())), mm, 0.02 * mm);
}

TEST_F(ImplantToolTest, ArrowsMoveOnTheScreen) {
    const auto way = [&](Qt::Key key, Qt::KeyboardModifiers modifiers = {}) {
        const Rigid3 before = pose();
        QTest::keyClick(&view_, key, modifiers);
        EXPECT_EQ(session_.undoText(), "Move implant");
        const Vector3 by = inImager(pose(), {0, 0, 0}) - inImager(before, {0, 0, 0});
        session_.undo();
        EXPECT_EQ(difference(pose(), before), 0);
        return by;
    };
    EXPECT_LT((way(Qt::Key_Right) - Vector3(0.1, 0, 0)).norm(), 1e-9);
    EXPECT_LT((way(Qt::Key_Left) - Vector3(-0.1, 0, 0)).norm(), 1e-9);
    EXPECT_LT((way(Qt::Key_Down) - Vector3(0, 0.1, 0)).norm(), 1e-9);
    EXPECT_LT((way(Qt::Key_Up, Qt::ShiftModifier) - Vector3(0, -1, 0)).norm(), 1e-9);
    view_.setMirrored(true);  // to the right on the screen is to the left in the image
    EXPECT_LT((way(Qt::Key_Right) - Vector3(-0.1, 0, 0)).norm(), 1e-9);
}

TEST_F(ImplantToolTest, KeysTurnTiltAndRollByATenthOfADegree) {
    const StemGrip grip = gripOf(session_.state()->plan);
    for (const auto& [key, modifiers, degrees, what] :
         {std::tuple(Qt::Key_BracketRight, Qt::KeyboardModifiers(), 0.1, "Turn implant"),
          std::tuple(Qt::Key_BracketLeft, Qt::KeyboardModifiers(), 0.1, "Turn implant"),
          std::tuple(Qt::Key_BraceRight, Qt::KeyboardModifiers(Qt::ShiftModifier), 1.0, "Turn implant"),
          std::tuple(Qt::Key_Up, Qt::KeyboardModifiers(Qt::ControlModifier), 0.1, "Tilt implant"),
          std::tuple(Qt::Key_Left, Qt::KeyboardModifiers(Qt::ControlModifier), 0.1, "Turn implant about its axis")}) {
        const Rigid3 before = pose();
        QTest::keyClick(&view_, key, modifiers);
        EXPECT_EQ(session_.undoText(), what);
        EXPECT_NEAR(degreesFromRadians(before.rotation().angularDistance(pose().rotation())), degrees, 1e-6);
        EXPECT_LT((pose() * grip.shoulder - before * grip.shoulder).norm(), 1e-9);
        session_.undo();
    }
    // ] turns clockwise on the screen: the tip, below, goes to the left.
    const QPointF tip = at(grip.tip);
    QTest::keyClick(&view_, Qt::Key_BracketRight);
    EXPECT_LT(at(grip.tip).x(), tip.x());
}

TEST_F(ImplantToolTest, PagesChangeTheSizeAndKeepTheResection) {
    const Rigid3 before = pose();
    const Vector3 resection = before * Vector3(0, 0, resectionOf(session_.state()->plan));
    QTest::keyClick(&view_, Qt::Key_PageUp);
    EXPECT_EQ(session_.state()->plan.size, "13");
    EXPECT_EQ(session_.state()->plan.implant->stem_length_mm, 140);
    EXPECT_EQ(session_.state()->plan.mesh.get(), &session_.state()->plan.implant->parts[0].mesh);
    EXPECT_LT((pose() * Vector3(0, 0, resectionOf(session_.state()->plan)) - resection).norm(), 1e-9);
    EXPECT_EQ(session_.undoText(), "Larger implant");
    QTest::keyClick(&view_, Qt::Key_PageDown);
    EXPECT_EQ(session_.state()->plan.size, "12");
    session_.undo();
    session_.undo();
    EXPECT_EQ(session_.state()->plan.size, "12");
    EXPECT_FALSE(session_.canUndo());
}

TEST_F(ImplantToolTest, BeyondTheLargestSizeItSaysSo) {
    session_.open(test::planningCase("8"));
    QSignalSpy refused(&tool_, &ImplantTool::refused);
    QTest::keyClick(&view_, Qt::Key_PageDown);
    ASSERT_EQ(refused.count(), 1);
    EXPECT_TRUE(refused[0][0].toString().contains("smallest")) << refused[0][0].toString().toStdString();
    EXPECT_FALSE(session_.canUndo());
}

TEST_F(ImplantToolTest, SnapsToTheCanal) {
    const Rigid3 before = pose();
    QTest::keyClick(&view_, Qt::Key_S);
    expectOneStep(before, "Snap implant to the canal");
    const CanalAxis canal = *session_.state()->canal;
    const Vector3 w = (canal.proximal - canal.distal).normalized();
    for (const double z : {0.0, -100.0})
        EXPECT_LT((pose() * Vector3(0, 0, z) - canal.distal).cross(w).norm(), 1e-9);

    CaseState unknown = *session_.state();
    unknown.canal.reset();
    session_.open(unknown);
    QSignalSpy refused(&tool_, &ImplantTool::refused);
    QTest::keyClick(&view_, Qt::Key_S);
    ASSERT_EQ(refused.count(), 1);
    EXPECT_TRUE(refused[0][0].toString().contains("axis"));
}

TEST_F(ImplantToolTest, ALockedPlanIsNotMovedAndSaysSo) {
    CaseState locked = *session_.state();
    locked.plan.locked = true;
    session_.open(locked);
    QSignalSpy refused(&tool_, &ImplantTool::refused);
    const DisplayWindow window = view_.displayWindow();
    test::sendMouse(view_, QEvent::MouseMove, at(middle_), Qt::NoButton, Qt::NoButton);
    EXPECT_EQ(view_.cursor().shape(), Qt::ForbiddenCursor);
    test::drag(view_, at(middle_), at(middle_) + QPointF(30, 0));
    for (const Qt::Key key : {Qt::Key_Left, Qt::Key_BracketLeft, Qt::Key_PageUp, Qt::Key_S})
        QTest::keyClick(&view_, key);
    EXPECT_EQ(refused.count(), 5);
    for (const auto& arguments : refused)
        EXPECT_TRUE(arguments[0].toString().contains("locked"));
    EXPECT_FALSE(session_.canUndo());
    EXPECT_EQ(view_.displayWindow(), window);
    EXPECT_TRUE(tool_.overlay(view_).curves.empty());
}

TEST_F(ImplantToolTest, AnUnregisteredViewSaysWhy) {
    ImplantTool tool(session_, {2});
    QSignalSpy refused(&tool, &ImplantTool::refused);
    view_.setTool(&tool);
    QTest::keyClick(&view_, Qt::Key_Left);
    ASSERT_EQ(refused.count(), 1);
    EXPECT_TRUE(refused[0][0].toString().contains("no corkscrew in the image"));
    EXPECT_FALSE(session_.canUndo());
    EXPECT_TRUE(tool.overlay(view_).empty());
    const ImagePlace nowhere{9};
    EXPECT_FALSE(whyNotMovable(*session_.state(), nowhere).isEmpty());
}

TEST_F(ImplantToolTest, TheCursorTellsWhatMayBeTaken) {
    const StemGrip grip = gripOf(session_.state()->plan);
    const auto shape = [&](const QPointF& place) {
        test::sendMouse(view_, QEvent::MouseMove, place, Qt::NoButton, Qt::NoButton);
        return view_.cursor().shape();
    };
    EXPECT_EQ(shape(at(middle_)), Qt::SizeAllCursor);
    EXPECT_EQ(shape(at(grip.tip)), Qt::PointingHandCursor);
    EXPECT_EQ(shape(at(middle_) + QPointF(150, 0)), Qt::CrossCursor);
}

TEST_F(ImplantToolTest, AnEditUnderTheHandEndsTheDrag) {
    const QPointF from = at(middle_);
    test::sendMouse(view_, QEvent::MouseButtonPress, from, Qt::LeftButton, Qt::LeftButton);
    test::sendMouse(view_, QEvent::MouseMove, from + QPointF(30, 0), Qt::NoButton, Qt::LeftButton);
    CaseState other = *session_.committed();
    other.patient = "Other";
    session_.commit("Rename", other);
    const Rigid3 before = pose();
    test::sendMouse(view_, QEvent::MouseMove, from + QPointF(60, 0), Qt::NoButton, Qt::LeftButton);
    test::sendMouse(view_, QEvent::MouseButtonRelease, from + QPointF(60, 0), Qt::LeftButton, Qt::NoButton);
    EXPECT_EQ(difference(pose(), before), 0);
    EXPECT_EQ(session_.undoText(), "Rename");
    EXPECT_FALSE(tool_.isHolding());
}

}  // namespace
}  // namespace fluorocut::ui
