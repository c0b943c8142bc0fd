#include "ui/spreadsheet/sheet.h"

#include <QMenu>
#include <QSettings>
#include <QSignalSpy>
#include <QTest>
#include <QToolButton>
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/geometry/primitives.h"
#include "tests/support/fixtures.h"
#include "tests/ui/hand.h"
#include "tests/ui/sample_case.h"
#include "ui/spreadsheet/header_strip.h"

namespace fluorocut::ui {
namespace {

class SheetTest : public testing::Test {
  protected:
    explicit SheetTest(CaseState state = test::sampleCase(2, 128)) : sheet_(session_) {
        sheet_.resize(1100, 620);
        sheet_.show();
        session_.open(std::move(state));
        settle();
    }
    void settle() {
        ASSERT_TRUE(QTest::qWaitFor([this] { return sheet_.engine().isIdle(); }, 60000));
    }
    ImageView& cell(std::size_t view, const std::string& column) { return *sheet_.cell(view, column); }
    // Where a point of the femur lies in a cell's widget.
    QPointF placeOf(ImageView& view, const Vector3& in_femur) {
        const Picture picture = *sheet_.pictureOf(view);
        const Vector2 px = picture.carm.project(picture.imager_from_femur->target_from_source * in_femur);
        return view.widgetFromImage({px.x(), px.y()});
    }
    void choose(const std::string& column, const char* action) {
        const std::unique_ptr<QMenu> menu(sheet_.makeColumnMenu(column));
        auto* chosen = menu->findChild<QAction*>(action);
        ASSERT_NE(chosen, nullptr) << action;
        ASSERT_TRUE(chosen->isEnabled()) << action;
        chosen->trigger();
        QApplication::processEvents();
    }

    Session session_;
    Sheet sheet_;
};

TEST_F(SheetTest, HasARowForEachViewAndACellForEachColumn) {
    EXPECT_EQ(sheet_.cells().size(), 2U * 4U);
    EXPECT_EQ(cell(0, "xray").image(), session_.state()->views[0].before.image);
    EXPECT_NE(cell(1, "predicted").image(), nullptr);
    EXPECT_EQ(cell(0, "after").message(), "No cut yet.");
    EXPECT_EQ(sheet_.viewOf(cell(1, "plan")), 1U);
    CaseState state = *session_.state();
    state.views.pop_back();
    session_.commit("remove view", state);
    EXPECT_EQ(sheet_.cell(1, "xray"), nullptr);
    session_.undo();
    EXPECT_NE(sheet_.cell(1, "xray"), nullptr);
}

TEST_F(SheetTest, ACellSaysWhyItHasNoImage) {
    CaseState state = *session_.state();
    state.views[1].before.imager_from_femur.reset();
    state.views[1].before.unregistered_because = "the corkscrew is covered";
    session_.commit("lose", state);
    EXPECT_EQ(cell(1, "predicted").message(), "View is not registered: the corkscrew is covered");
    EXPECT_EQ(cell(1, "predicted").image(), nullptr);
    EXPECT_NE(cell(1, "xray").image(), nullptr);
}

TEST_F(SheetTest, ADoubleClickMaximisesAndAnotherOneBringsTheOthersBack) {
    ImageView& one = cell(1, "plan");
    const QSize before = one.size();
    test::sendMouse(one, QEvent::MouseButtonDblClick, {50, 50}, Qt::LeftButton, Qt::LeftButton);
    EXPECT_EQ(sheet_.maximised(), (CellKey{1, "plan"}));
    EXPECT_GT(one.width(), 2 * before.width());
    EXPECT_FALSE(cell(0, "plan").isVisible());
    EXPECT_EQ(one.title(), "View 2, Plan");
    test::sendMouse(one, QEvent::MouseButtonDblClick, {50, 50}, Qt::LeftButton, Qt::LeftButton);
    EXPECT_EQ(one.size(), before);
    EXPECT_TRUE(cell(0, "plan").isVisible());

    sheet_.setCurrent({0, "xray"});
    QTest::keyClick(&cell(0, "xray"), Qt::Key_Return);
    EXPECT_EQ(sheet_.maximised(), (CellKey{0, "xray"}));
    QTest::keyClick(&cell(0, "xray"), Qt::Key_Escape);
    EXPECT_FALSE(sheet_.maximised());
}

TEST_F(SheetTest, ArrowKeysGoFromCellToCell) {
    const QSignalSpy moved(&sheet_, &Sheet::currentChanged);
    sheet_.setCurrent({0, "xray"});
    QTest::keyClick(&cell(0, "xray"), Qt::Key_Right);
    EXPECT_EQ(sheet_.current(), (CellKey{0, "plan"}));
    QTest::keyClick(&cell(0, "plan"), Qt::Key_Down);
    EXPECT_EQ(sheet_.current(), (CellKey{1, "plan"}));
    QTest::keyClick(&cell(1, "plan"), Qt::Key_Down);  // the last row
    EXPECT_EQ(sheet_.current(), (CellKey{1, "plan"}));
    QTest::keyClick(&cell(1, "plan"), Qt::Key_Left);
    EXPECT_EQ(sheet_.current(), (CellKey{1, "xray"}));
    EXPECT_EQ(moved.count(), 4);
}

TEST_F(SheetTest, ZoomAndWindowFollowAlongTheRowTheColumnOrNot) {
    const auto zoomed = [&](std::size_t view, const char* column) {
        return cell(view, column).glance().relative_zoom > 1.1;
    };
    test::turnWheel(cell(0, "xray"), {80, 80}, 3);
    EXPECT_TRUE(zoomed(0, "plan"));
    EXPECT_TRUE(zoomed(0, "predicted"));
    EXPECT_FALSE(zoomed(1, "xray"));
    EXPECT_NEAR(cell(0, "plan").glance().middle.x(), cell(0, "xray").glance().middle.x(), 1e-9);
    test::drag(cell(0, "xray"), {80, 80}, {120, 100});
    EXPECT_EQ(cell(0, "plan").displayWindow(), cell(0, "xray").displayWindow());
    EXPECT_FALSE(cell(1, "xray").displayWindow() == cell(0, "xray").displayWindow());

    QTest::mouseClick(sheet_.findChild<QToolButton*>("link-column"), Qt::LeftButton);
    EXPECT_EQ(sheet_.link(), Sheet::Link::column);
    test::turnWheel(cell(0, "xray"), {80, 80}, 1);
    EXPECT_TRUE(zoomed(1, "xray"));
    EXPECT_FALSE(zoomed(1, "plan"));

    QTest::mouseClick(sheet_.findChild<QToolButton*>("link-none"), Qt::LeftButton);
    const double other = cell(1, "xray").zoom();
    test::turnWheel(cell(0, "xray"), {80, 80}, 1);
    EXPECT_EQ(cell(1, "xray").zoom(), other);
}

TEST_F(SheetTest, AWindowSetByHandStaysWhenThePictureIsWorkedOutAnew) {
    test::drag(cell(0, "predicted"), {80, 80}, {140, 120});
    const DisplayWindow window = cell(0, "predicted").displayWindow();
    const auto before = cell(0, "predicted").image();
    CaseState state = *session_.state();
    state.plan.femur_from_implant = Rigid3::fromTranslation({3, 0, 0});
    session_.commit("move", state);
    settle();
    EXPECT_NE(cell(0, "predicted").image(), before);
    EXPECT_EQ(cell(0, "predicted").displayWindow(), window);
}

TEST_F(SheetTest, ABorderBetweenHeadersIsDragged) {
    auto* header = sheet_.findChildren<HeaderStrip*>().at(0);
    for (HeaderStrip* each : sheet_.findChildren<HeaderStrip*>())
        if (each->height() < 50) header = each;
    const int before = cell(0, "xray").width(), next = cell(0, "plan").width();
    const int border = header->spans()[0].end;
    test::drag(*header, QPointF(border, 10), QPointF(border + 40, 10));
    EXPECT_NEAR(cell(0, "xray").width(), before + 40, 4);  // whole pixels, eight steps
    EXPECT_NEAR(cell(0, "plan").width(), next - 40, 4);
    test::drag(*header, QPointF(border + 40, 10), QPointF(border - 900, 10));
    EXPECT_GE(cell(0, "xray").width(), 190);  // never too small to be seen
}

TEST_F(SheetTest, ColumnsAreHiddenMovedRemovedAndAdded) {
    choose("plan", "hide");
    EXPECT_EQ(sheet_.cell(0, "plan"), nullptr);
    choose("xray", "right");
    const auto place = [&](const char* id) { return sheet_.cell(0, id) ? cell(0, id).x() : -1; };
    EXPECT_GT(place("xray"), place("predicted"));
    sheet_.addColumn({.id = "", .kind = "difference", .against = Against::prediction});
    sheet_.addColumn({.id = "", .kind = "difference", .cut = 1});
    EXPECT_EQ(sheet_.columns().back().id, "difference-3");  // the first is the standard one, hidden
    choose("difference-3", "remove");
    EXPECT_EQ(sheet_.cell(0, "difference-3"), nullptr);
    EXPECT_NE(sheet_.cell(0, "difference-2"), nullptr);

    const test::ScratchFolder folder;
    QSettings settings(QString::fromStdString((folder / "settings.ini").string()), QSettings::IniFormat);
    sheet_.setLink(Sheet::Link::none);
    sheet_.setShown(OverlayKind::stages, false);
    sheet_.save(settings);
    settings.sync();
    QSettings again(settings.fileName(), QSettings::IniFormat);
    Sheet other(session_);
    ASSERT_OK(other.restore(again));
    EXPECT_EQ(other.columns(), sheet_.columns());
    EXPECT_EQ(other.link(), Sheet::Link::none);
    EXPECT_FALSE(other.isShown(OverlayKind::stages));
    EXPECT_TRUE(other.isShown(OverlayKind::implant));
    again.setValue("spreadsheet/columns", "[{]");
    EXPECT_FALSE(other.restore(again).ok());
    EXPECT_EQ(other.columns(), sheet_.columns());
}

TEST_F(SheetTest, OverlaysAreSwitchedByKind) {
    ASSERT_TRUE(QTest::qWaitFor([&] { return cell(0, "predicted").overlay().curves.size() > 0; }, 60000));
    auto* button = sheet_.findChild<QToolButton*>("overlay-implant");
    QTest::mouseClick(button, Qt::LeftButton);
    EXPECT_TRUE(cell(0, "predicted").overlay().curves.empty());
    EXPECT_EQ(cell(0, "plan").overlay().marks.size(), 3U);  // the beads stay
    QTest::mouseClick(button, Qt::LeftButton);
    EXPECT_FALSE(cell(0, "predicted").overlay().curves.empty());
}

TEST_F(SheetTest, AnEllipseOfThePlanIsThatOfTheViewsPose) {
    Column only{.id = "u", .kind = "plan", .overlays = {OverlayKind::uncertainty}};
    CaseState state = *session_.state();
    state.beads.clear();
    session_.open(state);
    sheet_.setColumns({only});
    const Overlay& overlay = cell(0, "u").overlay();
    ASSERT_EQ(overlay.curves.size(), 2U);  // tip and reference point
    // At the reference point: 0.2 mm in the image plane at its depth, times sqrt(5.99146), and a little for the depth.
    double low = 1e9, high = -1e9;
    for (const Vector2& p : overlay.curves[1].points_px) {
        low = std::min(low, p.x());
        high = std::max(high, p.x());
    }
    const CaseView& view = session_.state()->views[0];
    const double depth = view.before.imager_from_femur->target_from_source.translation().z();
    const double expected = 2 * 0.2 * 2.44775 * view.carm.focal_length_mm / (depth * view.carm.pixel_mm.x());
    EXPECT_NEAR(high - low, expected, 0.02 * expected);  // 48 corners: within 0.2 % of the ellipse's width
}

// A point of space pointed at in one view, then, Shift still held, in the other.
TEST_F(SheetTest, PointingInTwoViewsFixesAPointInSpace) {
    std::vector<std::optional<Vector3>> points;
    QObject::connect(&sheet_, &Sheet::pointedAt, [&](std::optional<Vector3> p) { points.push_back(p); });
    const Vector3 truth(6, -4, -35);
    const auto point = [&](ImageView& at, const Vector3& p) {
        test::sendMouse(at, QEvent::MouseMove, placeOf(at, p), Qt::NoButton, Qt::NoButton, Qt::ShiftModifier);
    };
    const QImage before = cell(1, "plan").grab().toImage();
    point(cell(0, "plan"), truth);
    ASSERT_FALSE(points.empty());
    EXPECT_FALSE(points.back());
    EXPECT_NE(cell(1, "plan").grab().toImage(), before);  // the line
    QEvent leave(QEvent::Leave);
    QApplication::sendEvent(&cell(0, "plan"), &leave);
    point(cell(1, "xray"), truth);
    ASSERT_TRUE(points.back());
    // The mouse's events carry fractions of pixels: rounding only.
    EXPECT_LT((*points.back() - truth).norm(), 1e-3);
    point(cell(1, "xray"), truth + Vector3(0, 0, 40));  // rays that do not meet
    EXPECT_FALSE(points.back());
    test::sendMouse(cell(1, "xray"), QEvent::MouseMove, {60, 60}, Qt::NoButton, Qt::NoButton);  // Shift let go
    EXPECT_FALSE(points.back());
    EXPECT_EQ(cell(1, "plan").grab().toImage(), before);
}

class StubTool : public ViewTool {
  public:
    bool press(ImageView&, const Touch&) override { return true; }
    void drag(ImageView&, const Touch&) override {}
    void release(ImageView&, const Touch&) override {}
    Qt::CursorShape hover(ImageView&, const Touch&) override { return Qt::SizeAllCursor; }
    bool key(ImageView&, int key, Qt::KeyboardModifiers modifiers) override {
        return key == Qt::Key_Right && !(modifiers & Qt::AltModifier);
    }
};

TEST_F(SheetTest, CellsBeforeTheCutsHaveATool) {
    CaseState state = *session_.state();
    state.views[0].after.push_back(state.views[0].before);
    session_.commit("cut", state);
    std::vector<std::size_t> made;
    sheet_.setTools([&](std::size_t view) {
        made.push_back(view);
        return std::make_unique<StubTool>();
    });
    EXPECT_EQ(std::count(made.begin(), made.end(), 0U), 3);
    ASSERT_NE(cell(0, "plan").tool(), nullptr);
    EXPECT_NE(cell(0, "plan").tool(), cell(1, "plan").tool());
    EXPECT_EQ(cell(0, "after").tool(), nullptr);
    // Arrows that the tool takes are its own; with Alt they travel.
    sheet_.setCurrent({0, "xray"});
    QTest::keyClick(&cell(0, "xray"), Qt::Key_Right);
    EXPECT_EQ(sheet_.current(), (CellKey{0, "xray"}));
    QTest::keyClick(&cell(0, "xray"), Qt::Key_Right, Qt::AltModifier);
    EXPECT_EQ(sheet_.current(), (CellKey{0, "plan"}));
    sheet_.setTools(nullptr);
    EXPECT_EQ(cell(0, "plan").tool(), nullptr);
}

// ---- overlay truth

CaseState ballCase() {
    CaseState state = test::sampleCase(1, 512);
    state.ct.reset();
    state.beads.clear();
    state.canal.reset();
    state.plan.cavities.clear();
    // 20,480 facets: they lie within 0.006 mm of the sphere.
    state.plan.mesh = std::make_shared<const TriangleMesh>(makeSphere(22, 5));
    state.plan.femur_from_implant = Rigid3::fromTranslation({18, 12, -62});
    state.views[0].before.image = std::make_shared<const Image>(512, 512, 0.0F);
    return state;
}

class SheetTruthTest : public SheetTest {
  protected:
    SheetTruthTest() : SheetTest(ballCase()) {}
};

// The picture of a sphere: rays at the angle asin(r / |c|) about the direction of its centre c.
TEST_F(SheetTruthTest, TheDrawnContourOfASphereIsItsProjectionWithinHalfAPixelAtThreeScalings) {
    sheet_.setColumns({{.id = "ball", .kind = "plan", .overlays = {OverlayKind::implant}}});
    ImageView& view = cell(0, "ball");
    ASSERT_TRUE(QTest::qWaitFor([&] { return view.overlay().curves.size() == 1; }, 60000));
    const Picture picture = *sheet_.pictureOf(view);
    const Vector3 centre = picture.imager_from_femur->target_from_source * Vector3(18, 12, -62);
    const double angle = std::asin(22 / centre.norm());
    const Vector3 along = centre.normalized(), u = along.unitOrthogonal(), v = along.cross(u);
    const auto contour = [&](double turn) {
        const Vector3 ray = std::cos(angle) * along + std::sin(angle) * (std::cos(turn) * u + std::sin(turn) * v);
        const Vector2 px = picture.carm.project(ray);
        const QPointF place = view.widgetFromImage({px.x(), px.y()});
        return Vector2(place.x(), place.y());
    };
    view.setDisplayWindow({1e6, 1});  // black
    view.setMarks({});
    for (const double scaling : {1.0, 1.5, 2.0}) {
        QImage drawn((view.size() * scaling), QImage::Format_RGB32);
        drawn.setDevicePixelRatio(scaling);
        static_cast<QWidget&>(view).render(&drawn);
        double worst = 0;
        int looked_at = 0;
        for (int i = 0; i < 72; ++i) {
            const double turn = i * 2 * 3.14159265358979 / 72;
            const Vector2 place = scaling * contour(turn);
            const Vector2 tangent = (contour(turn + 1e-4) - contour(turn - 1e-4)).normalized();
            const Vector2 normal(-tangent.y(), tangent.x());
            double sum = 0, weight = 0;
            for (double off = -5; off <= 5; off += 0.05) {
                const Vector2 at = place + off * normal;
                const QRgb c = drawn.pixel(static_cast<int>(at.x()), static_cast<int>(at.y()));
                const double blue = std::max(0, qBlue(c) - qRed(c) - 10);  // the ink's hue, not the halo or the ground
                sum += blue * off;
                weight += blue;
            }
            ASSERT_GT(weight, 100) << scaling << " at " << turn;
            worst = std::max(worst, std::abs(sum / weight));
            ++looked_at;
        }
        EXPECT_EQ(looked_at, 72);
        EXPECT_LT(worst, 0.5) << "device pixels, scaling " << scaling;
    }
}

}  // namespace
}  // namespace fluorocut::ui
