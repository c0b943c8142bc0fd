#include "ui/scene/scene_view.h"

#include <QSignalSpy>
#include <QTest>
#include <QToolButton>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/imaging/standard_views.h"
#include "tests/ui/hand.h"
#include "tests/ui/scene/scene_shapes.h"

namespace fluorocut::ui {
namespace {

// A canvas of 400 x 300 pixels with a red box of 40 mm, 100 mm to the patient's left. On the CPU: these tests are about
// the hand.
class CanvasTest : public testing::Test {
  protected:
    CanvasTest() : canvas_(SceneBackend::cpu) {
        canvas_.resize(400, 300);
        canvas_.setScene({{test::thing(makeBox({40, 40, 40}), Qt::red, Rigid3::fromTranslation({100, 0, 0}))}, {}});
    }
    QPointF onScreen(const Vector3& point) const { return canvas_.camera().project(point, canvas_.size()); }
    SceneCanvas canvas_;
};

TEST_F(CanvasTest, DrawsNothingBeforeItIsSeen) {
    EXPECT_FALSE(canvas_.hasStarted());
    canvas_.show();
    canvas_.grab();
    EXPECT_TRUE(canvas_.hasStarted());
}

TEST_F(CanvasTest, FitsTheFirstScene) {
    EXPECT_NEAR((canvas_.camera().focus - Vector3(100, 0, 0)).norm(), 0, 1e-9);
    const double half_diagonal = 20 * std::sqrt(3.0);
    const QPointF top = onScreen(Vector3(100, 0, 0) + half_diagonal * canvas_.camera().up());
    EXPECT_GT(top.y(), 0);
    EXPECT_LT(top.y(), 10);
}

TEST_F(CanvasTest, FitsWhatIsPlannedAndThenEverything) {
    Scene scene = canvas_.scene();
    SceneItem carm = test::thing(makeBox({40, 40, 40}), Qt::green, Rigid3::fromTranslation({-500, 0, 0}));
    carm.kind = SceneKind::views;
    scene.items.push_back(carm);
    canvas_.setScene(scene);
    EXPECT_NEAR((canvas_.camera().focus - Vector3(100, 0, 0)).norm(), 0, 1e-9);
    canvas_.fit();
    EXPECT_NEAR((canvas_.camera().focus - Vector3(-200, 0, 0)).norm(), 0, 1e-9);
    canvas_.fit();
    EXPECT_NEAR((canvas_.camera().focus - Vector3(100, 0, 0)).norm(), 0, 1e-9);
}

TEST_F(CanvasTest, ALeftDragWalksRoundAndThePatientStaysUpright) {
    test::drag(canvas_, {200, 150}, {260, 120});
    // The whole height is half a turn.
    EXPECT_NEAR(canvas_.camera().azimuth_rad, -std::numbers::pi * 60 / 300, 1e-9);
    EXPECT_NEAR(canvas_.camera().elevation_rad, -std::numbers::pi * 30 / 300, 1e-9);
}

TEST_F(CanvasTest, AMiddleDragPans) {
    const QPointF before = onScreen({100, 0, 0});
    test::drag(canvas_, {200, 150}, {230, 140}, Qt::MiddleButton);
    EXPECT_NEAR(onScreen({100, 0, 0}).x(), before.x() + 30, 1e-9);
    EXPECT_NEAR(onScreen({100, 0, 0}).y(), before.y() - 10, 1e-9);
    test::drag(canvas_, {230, 140}, {200, 150}, Qt::LeftButton, Qt::ShiftModifier);
    EXPECT_NEAR(onScreen({100, 0, 0}).x(), before.x(), 1e-9);
}

TEST_F(CanvasTest, TheWheelAndARightDragZoomAlike) {
    const double before = canvas_.camera().distance_mm;
    test::turnWheel(canvas_, {10, 10}, 2);
    EXPECT_NEAR(canvas_.camera().distance_mm, before / (1.2 * 1.2), 1e-9);
    test::drag(canvas_, {100, 100}, {100, 140}, Qt::RightButton);  // 40 down: two notches back
    EXPECT_NEAR(canvas_.camera().distance_mm, before, 1e-9);
}

TEST_F(CanvasTest, KeysLookFromTheStandardSides) {
    test::drag(canvas_, {200, 150}, {260, 120});
    QTest::keyClick(&canvas_, Qt::Key_A);
    EXPECT_NEAR((canvas_.camera().towardViewer() - Vector3(0, -1, 0)).norm(), 0, 1e-12);
    QTest::keyClick(&canvas_, Qt::Key_S);
    EXPECT_NEAR((canvas_.camera().towardViewer() - Vector3(0, 0, 1)).norm(), 0, 1e-12);
    canvas_.setOperatedSide(LookFrom::right);
    QTest::keyClick(&canvas_, Qt::Key_L);
    EXPECT_NEAR((canvas_.camera().towardViewer() - Vector3(-1, 0, 0)).norm(), 0, 1e-12);
    test::turnWheel(canvas_, {10, 10}, 7);
    QTest::keyClick(&canvas_, Qt::Key_F);
    EXPECT_NEAR((canvas_.camera().focus - Vector3(100, 0, 0)).norm(), 0, 1e-9);
}

TEST_F(CanvasTest, ADoubleClickBringsWhatIsUnderItToTheMiddle) {
    const Vector3 corner = Vector3(100 + 15, -20, 15);  // on the near face
    test::sendMouse(canvas_, QEvent::MouseButtonDblClick, onScreen(corner), Qt::LeftButton, Qt::LeftButton);
    EXPECT_NEAR((canvas_.camera().focus - corner).norm(), 0, 1e-6);
    const Vector3 kept = canvas_.camera().focus;
    test::sendMouse(canvas_, QEvent::MouseButtonDblClick, {2, 2}, Qt::LeftButton, Qt::LeftButton);  // beside it
    EXPECT_EQ(canvas_.camera().focus, kept);
}

TEST_F(CanvasTest, ADoubleClickReachesThroughGlass) {
    Scene scene = canvas_.scene();
    SceneItem shell = test::thing(makeBox({60, 60, 60}), Qt::white, Rigid3::fromTranslation({100, 0, 0}));
    shell.opacity = shell.rim_opacity = 0.3;
    scene.items.push_back(shell);
    canvas_.setScene(scene);
    test::sendMouse(canvas_, QEvent::MouseButtonDblClick, {200, 150}, Qt::LeftButton, Qt::LeftButton);
    EXPECT_NEAR(canvas_.camera().focus.y(), -20, 1e-6);
}

TEST_F(CanvasTest, AKindThatIsSwitchedOffIsNeitherDrawnNorFitted) {
    Scene scene = canvas_.scene();
    SceneItem far = test::thing(makeBox({10, 10, 10}), Qt::green, Rigid3::fromTranslation({-500, 0, 0}));
    far.kind = SceneKind::implant;
    scene.items.push_back(far);
    canvas_.setScene(scene);
    canvas_.setShown(SceneKind::implant, false);
    canvas_.fit();
    EXPECT_NEAR((canvas_.camera().focus - Vector3(100, 0, 0)).norm(), 0, 1e-9);
    canvas_.setShown(SceneKind::bone, false);
    const QRgb without = canvas_.snapshot({100, 80}).pixel(50, 40);
    canvas_.setShown(SceneKind::bone, true);
    const QRgb with = canvas_.snapshot({100, 80}).pixel(50, 40);
    EXPECT_GT(qRed(with), qRed(without) + 100);
}

TEST_F(CanvasTest, SaysWhyThereIsNoOpenGl) {
    qputenv("FLUOROCUT_SCENE", "cpu");
    SceneCanvas canvas;
    canvas.resize(400, 300);
    canvas.setScene(canvas_.scene());
    canvas.grab();
    qunsetenv("FLUOROCUT_SCENE");
    EXPECT_FALSE(canvas.whyNoOpenGL().isEmpty());
    // In the lower right corner, where a canvas that was told to be without has nothing.
    const QRect corner(250, 265, 145, 30);
    EXPECT_NE(canvas.grab(corner).toImage(), canvas_.grab(corner).toImage());
}

CaseState smallCase() {
    CaseState state;
    state.side = "right";
    VolumeGrid grid;
    grid.size = {30, 30, 30};
    grid.spacing_mm = {2, 2, 2};
    grid.origin_mm = {-29, -29, -29};
    Volume ct(grid);
    for (int k = 0; k < 30; ++k)
        for (int j = 0; j < 30; ++j)
            for (int i = 0; i < 30; ++i)
                ct(i, j, k) = grid.pointFromIndex(Vector3(i, j, k)).norm() < 20 ? 1000.0F : 0.0F;
    state.ct = std::make_shared<const Volume>(ct);
    state.plan.mesh = std::make_shared<const TriangleMesh>(makeBox({10, 10, 60}));
    CaseView view;
    view.name = "AP";
    view.carm = standardCArm();
    view.before.image = std::make_shared<const Image>(64, 64, 100.0F);
    view.before.imager_from_femur =
        Pose{Frame::imager, Frame::femur, standardView(StandardView::ap, {0, 0, 0}, 700), std::nullopt};
    state.views = {view};
    return state;
}

class SceneViewTest : public testing::Test {
  protected:
    void show() {
        view_.resize(640, 480);
        const QSignalSpy prepared(&view_, &SceneView::prepared);
        view_.show();
        for (int i = 0; i < 600 && prepared.isEmpty() && view_.isPreparing(); ++i)
            QTest::qWait(50);
        ASSERT_FALSE(view_.isPreparing());
    }
    bool has(SceneKind kind) {
        const auto& items = view_.canvas().scene().items;
        return std::any_of(items.begin(), items.end(), [&](const SceneItem& item) { return item.kind == kind; });
    }
    Session session_;
    SceneView view_{session_};
};

TEST_F(SceneViewTest, MakesTheBonesSurfaceBesideTheGuiAndShowsIt) {
    session_.open(smallCase());
    EXPECT_FALSE(view_.isPreparing());  // not before it is seen
    show();
    EXPECT_TRUE(has(SceneKind::bone) && has(SceneKind::implant) && has(SceneKind::views));
    EXPECT_TRUE(view_.button(SceneKind::bone)->isEnabled());
    EXPECT_FALSE(view_.button(SceneKind::robot)->isEnabled());
    view_.button(SceneKind::bone)->click();
    EXPECT_FALSE(view_.canvas().isShown(SceneKind::bone));
}

TEST_F(SceneViewTest, FollowsAPreviewWithoutMakingAnythingAnew) {
    session_.open(smallCase());
    show();
    const Scene before = view_.canvas().scene();
    CaseState next = *session_.state();
    next.plan.femur_from_implant = Rigid3::fromTranslation({3, 0, 0});
    session_.preview(next);
    const Scene after = view_.canvas().scene();
    ASSERT_EQ(after.items.size(), before.items.size());
    for (std::size_t i = 0; i < after.items.size(); ++i) {
        EXPECT_EQ(after.items[i].surface, before.items[i].surface);
        if (after.items[i].kind == SceneKind::implant) {
            EXPECT_EQ(after.items[i].femur_from_item.translation(), Vector3(3, 0, 0));
        }
    }
    session_.dropPreview();
    EXPECT_EQ(view_.canvas().scene().items.size(), before.items.size());
}

TEST_F(SceneViewTest, AnotherCaseWhileTheFirstIsPrepared) {
    session_.open(smallCase());
    view_.resize(640, 480);
    view_.show();
    CaseState without = smallCase();
    without.ct.reset();
    session_.open(without);
    for (int i = 0; i < 600 && view_.isPreparing(); ++i)
        QTest::qWait(50);
    EXPECT_FALSE(has(SceneKind::bone));
    EXPECT_TRUE(has(SceneKind::implant));
}

TEST_F(SceneViewTest, ASnapshotHasItsSizeAndTheSceneInIt) {
    session_.open(smallCase());
    show();
    const QImage picture = view_.snapshot({300, 200});
    EXPECT_EQ(picture.size(), QSize(300, 200));
    view_.canvas().setShown(SceneKind::bone, false);
    EXPECT_NE(view_.snapshot({300, 200}), picture);
}

TEST(SceneViewAlone, CanGoWhileItPrepares) {
    Session session;
    session.open(smallCase());
    auto view = std::make_unique<SceneView>(session);
    view->show();
    view.reset();
    SUCCEED();
}

// 1000 events of a restless hand, drawn now and then, with both renderers.
TEST(SceneViewAlone, SurvivesARestlessHand) {
    for (const SceneBackend backend : {SceneBackend::automatic, SceneBackend::cpu}) {
        Session session;
        session.open(smallCase());
        SceneView view(session, nullptr, backend);
        view.resize(320, 240);
        view.show();
        SceneCanvas& canvas = view.canvas();
        Random random(7);
        const auto pick = [&](int count) { return std::min(count - 1, static_cast<int>(random.uniform(0, count))); };
        const Qt::MouseButton buttons[] = {Qt::LeftButton, Qt::MiddleButton, Qt::RightButton};
        const int keys[] = {Qt::Key_A, Qt::Key_L, Qt::Key_S, Qt::Key_F, Qt::Key_X, Qt::Key_Escape};
        for (int i = 0; i < 1000; ++i) {
            const QPointF at(random.uniform(-50, 400), random.uniform(-50, 300));
            const Qt::MouseButton button = buttons[pick(3)];
            switch (pick(8)) {
                case 0:
                    test::sendMouse(canvas, QEvent::MouseButtonPress, at, button, button);
                    break;
                case 1:
                    test::sendMouse(canvas, QEvent::MouseButtonRelease, at, button, Qt::NoButton);
                    break;
                case 2:
                case 3:
                    test::sendMouse(canvas, QEvent::MouseMove, at, Qt::NoButton, button);
                    break;
                case 4:
                    test::turnWheel(canvas, at, pick(9) - 4);
                    break;
                case 5:
                    QTest::keyClick(&canvas, static_cast<Qt::Key>(keys[pick(6)]));
                    break;
                case 6:
                    test::sendMouse(canvas, QEvent::MouseButtonDblClick, at, button, button);
                    break;
                default:
                    view.button(static_cast<SceneKind>(pick(kSceneKinds)))->click();
                    view.resize(1 + pick(400), 1 + pick(300));
            }
            if (i % 25 == 0) view.grab();
            EXPECT_TRUE(canvas.camera().position().allFinite());
        }
    }
}

}  // namespace
}  // namespace fluorocut::ui
