#include "ui/spreadsheet/image_view.h"

#include <QSignalSpy>
#include <QTest>

#include <gtest/gtest.h>

#include "tests/ui/hand.h"

namespace fluorocut::ui {
namespace {

// Values 0 ... 1000 from left to right, so that the range is known.
std::shared_ptr<const Image> ramp(int width, int height) {
    Image image(width, height);
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x)
            image(x, y) = 1000.0F * static_cast<float>(x) / static_cast<float>(width - 1);
    }
    return std::make_shared<const Image>(std::move(image));
}

class ImageViewTest : public testing::Test {
  protected:
    ImageViewTest() {
        view_.resize(400, 300);
        view_.show();
        view_.setImage(ramp(200, 100), "AP");
    }
    ImageView view_;
};

TEST_F(ImageViewTest, FitsTheImageInTheMiddle) {
    EXPECT_DOUBLE_EQ(view_.zoom(), 2);  // 400 / 200 is less than 300 / 100
    // The middle of the image, between pixels 99 and 100, lies in the middle of the view.
    const QPointF middle = view_.widgetFromImage({99.5, 49.5});
    EXPECT_NEAR(middle.x(), 200, 1e-9);
    EXPECT_NEAR(middle.y(), 150, 1e-9);
    // Pixel centres are at integers: the left edge of the image is at -0.5.
    EXPECT_NEAR(view_.widgetFromImage({-0.5, -0.5}).x(), 0, 1e-9);
}

TEST_F(ImageViewTest, StaysFittedWhenResized) {
    view_.resize(800, 800);
    EXPECT_DOUBLE_EQ(view_.zoom(), 4);
    test::turnWheel(view_, {10, 10}, 1);
    const double zoomed = view_.zoom();
    view_.resize(500, 500);
    EXPECT_DOUBLE_EQ(view_.zoom(), zoomed);
}

TEST_F(ImageViewTest, TheWheelZoomsAboutTheCursor) {
    const QPointF cursor(123, 88);
    const QPointF before = view_.imageFromWidget(cursor);
    test::turnWheel(view_, cursor, 3);
    EXPECT_GT(view_.zoom(), 3);
    EXPECT_NEAR(view_.imageFromWidget(cursor).x(), before.x(), 1e-9);
    EXPECT_NEAR(view_.imageFromWidget(cursor).y(), before.y(), 1e-9);
    test::turnWheel(view_, cursor, -3);
    EXPECT_NEAR(view_.zoom(), 2, 1e-9);
    EXPECT_NEAR(view_.imageFromWidget({0, 0}).x(), -0.5, 1e-9);
}

TEST_F(ImageViewTest, ZoomHasLimits) {
    for (int i = 0; i < 200; ++i)
        test::turnWheel(view_, {200, 150}, 1);
    EXPECT_LE(view_.zoom(), 64);
    for (int i = 0; i < 400; ++i)
        test::turnWheel(view_, {200, 150}, -1);
    EXPECT_GE(view_.zoom(), 0.49);  // a quarter of the fitting zoom
}

TEST_F(ImageViewTest, ALeftDragChangesWindowAndLevel) {
    const QSignalSpy changed(&view_, &ImageView::displayWindowChanged);
    view_.setDisplayWindow({500, 800});
    test::drag(view_, {100, 100}, {180, 140});
    // 400 screen pixels are the range of 1000: 80 to the right widen by 200, 40 down lower the level by 100.
    EXPECT_NEAR(view_.displayWindow().width, 1000, 1e-6);
    EXPECT_NEAR(view_.displayWindow().center, 400, 1e-6);
    EXPECT_GT(changed.count(), 1);
    EXPECT_DOUBLE_EQ(view_.zoom(), 2);
}

TEST_F(ImageViewTest, TheWindowNeverClosesOrTurnsOver) {
    test::drag(view_, {390, 100}, {-2000, 100});
    EXPECT_GT(view_.displayWindow().width, 0);
}

TEST_F(ImageViewTest, AMiddleDragPansAndKeepsTheWindow) {
    const DisplayWindow window = view_.displayWindow();
    const QPointF under = view_.imageFromWidget({100, 100});
    test::drag(view_, {100, 100}, {130, 90}, Qt::MiddleButton);
    EXPECT_NEAR(view_.imageFromWidget({130, 90}).x(), under.x(), 1e-9);
    EXPECT_NEAR(view_.imageFromWidget({130, 90}).y(), under.y(), 1e-9);
    EXPECT_EQ(view_.displayWindow(), window);
    test::drag(view_, {130, 90}, {100, 100}, Qt::LeftButton, Qt::ShiftModifier);
    EXPECT_NEAR(view_.imageFromWidget({100, 100}).x(), under.x(), 1e-9);
    EXPECT_EQ(view_.displayWindow(), window);
}

TEST_F(ImageViewTest, ADoubleClickAsksToBeShownAlone) {
    const QSignalSpy asked(&view_, &ImageView::maximiseRequested);
    test::sendMouse(view_, QEvent::MouseButtonDblClick, {50, 50}, Qt::LeftButton, Qt::LeftButton);
    EXPECT_EQ(asked.count(), 1);
}

TEST_F(ImageViewTest, TheKeyFFitsAgain) {
    test::turnWheel(view_, {10, 10}, 4);
    QTest::keyClick(&view_, Qt::Key_F);
    EXPECT_DOUBLE_EQ(view_.zoom(), 2);
    EXPECT_NEAR(view_.imageFromWidget({0, 50}).x(), -0.5, 1e-9);
}

TEST_F(ImageViewTest, ARightDragZoomsAboutWhereItBegan) {
    const QPointF under = view_.imageFromWidget({120, 90});
    test::drag(view_, {120, 90}, {120, 50}, Qt::RightButton);  // 40 up: two notches of the wheel
    EXPECT_NEAR(view_.zoom(), 2 * 1.2 * 1.2, 1e-9);
    EXPECT_NEAR(view_.imageFromWidget({120, 90}).x(), under.x(), 1e-9);
    EXPECT_NEAR(view_.imageFromWidget({120, 90}).y(), under.y(), 1e-9);
}

TEST_F(ImageViewTest, MirroringKeepsTheImagesCoordinatesAndSaysSo) {
    test::turnWheel(view_, {300, 100}, 2);
    const QPointF middle = view_.imageFromWidget({200, 150});
    const QImage before = view_.grab().toImage();
    QTest::keyClick(&view_, Qt::Key_M);
    EXPECT_TRUE(view_.isMirrored());
    EXPECT_NEAR(view_.imageFromWidget({200, 150}).x(), middle.x(), 1e-9);
    // What lay 50 to the right of the middle lies 50 to its left.
    EXPECT_NEAR(view_.imageFromWidget({150, 150}).x() - middle.x(), 50 / view_.zoom(), 1e-9);
    const QPointF place(57, 31), there = view_.widgetFromImage(place);
    EXPECT_NEAR(view_.imageFromWidget(there).x(), place.x(), 1e-9);
    EXPECT_NEAR(view_.widgetFromImage().map(place).x(), there.x(), 1e-9);
    EXPECT_NE(view_.grab().toImage(), before);
    test::turnWheel(view_, {123, 88}, 1);
    test::drag(view_, {100, 100}, {130, 90}, Qt::MiddleButton);
    QTest::keyClick(&view_, Qt::Key_F);
    EXPECT_NEAR(view_.imageFromWidget({400, 50}).x(), -0.5, 1e-9);
}

TEST_F(ImageViewTest, InvertingTurnsGreyOver) {
    view_.setDisplayWindow({500, 1000});
    const QPoint place = view_.widgetFromImage({140, 50}).toPoint();
    const int grey = qRed(view_.grab().toImage().pixel(place));
    QTest::keyClick(&view_, Qt::Key_I);
    EXPECT_EQ(qRed(view_.grab().toImage().pixel(place)), 255 - grey);
}

TEST_F(ImageViewTest, PresetsNarrowTheWindowTowardTheDarkEnd) {
    const DisplayWindow all = view_.displayWindow();
    QTest::keyClick(&view_, Qt::Key_3);
    EXPECT_LT(view_.displayWindow().width, 0.2 * all.width);
    EXPECT_NEAR(view_.displayWindow().center - 0.5 * view_.displayWindow().width, all.center - 0.5 * all.width, 1e-6);
    QTest::keyClick(&view_, Qt::Key_1);
    EXPECT_EQ(view_.displayWindow(), all);
}

TEST_F(ImageViewTest, AnImageOfTheSameSizeStaysWhereTheOneBeforeWas) {
    test::turnWheel(view_, {10, 10}, 3);
    const double zoom = view_.zoom();
    view_.setImage(ramp(200, 100), "AP, after cut 1");
    EXPECT_DOUBLE_EQ(view_.zoom(), zoom);
    view_.setImage(ramp(100, 100), "other");
    EXPECT_DOUBLE_EQ(view_.zoom(), 3);
}

TEST_F(ImageViewTest, AGlanceGoesFromOneViewToAnother) {
    ImageView other;
    other.resize(800, 600);
    other.setImage(ramp(200, 100), "lateral");
    test::turnWheel(view_, {90, 110}, 3);
    other.setGlance(view_.glance());
    EXPECT_NEAR(other.glance().middle.x(), view_.glance().middle.x(), 1e-9);
    EXPECT_NEAR(other.zoom(), 2 * view_.zoom(), 1e-9);  // it is twice as large
}

TEST_F(ImageViewTest, WithShiftHeldItTellsWhereTheCursorPoints) {
    std::vector<std::optional<QPointF>> places;
    QObject::connect(&view_, &ImageView::pointedAt, [&](std::optional<QPointF> at) { places.push_back(at); });
    test::sendMouse(view_, QEvent::MouseMove, {100, 100}, Qt::NoButton, Qt::NoButton);
    EXPECT_TRUE(places.empty());
    test::sendMouse(view_, QEvent::MouseMove, {100, 100}, Qt::NoButton, Qt::NoButton, Qt::ShiftModifier);
    ASSERT_EQ(places.size(), 1U);
    EXPECT_NEAR(places[0]->x(), view_.imageFromWidget({100, 100}).x(), 1e-12);
    test::sendMouse(view_, QEvent::MouseMove, {101, 100}, Qt::NoButton, Qt::NoButton);
    ASSERT_EQ(places.size(), 2U);
    EXPECT_FALSE(places[1]);
}

class Recorder : public ViewTool {
  public:
    bool press(ImageView&, const Touch& touch) override {
        at.push_back(touch.at_px);
        return touch.at_px.x() < 100;
    }
    void drag(ImageView&, const Touch& touch) override { at.push_back(touch.at_px); }
    void release(ImageView&, const Touch&) override { ++released; }
    Qt::CursorShape hover(ImageView&, const Touch&) override { return Qt::SizeAllCursor; }
    bool key(ImageView&, int key, Qt::KeyboardModifiers) override { return key == Qt::Key_F && ++keys; }
    Overlay overlay(const ImageView&) const override {
        return {{{Ink::handle, {{20, 20}, {20, 80}}, false, false}}, {}};
    }

    std::vector<Vector2> at;
    int released = 0, keys = 0;
};

TEST_F(ImageViewTest, AToolTakesTheLeftButtonFirst) {
    Recorder tool;
    view_.setTool(&tool);
    const DisplayWindow window = view_.displayWindow();
    test::drag(view_, {100, 100}, {140, 100});
    EXPECT_EQ(view_.displayWindow(), window);
    EXPECT_EQ(tool.released, 1);
    EXPECT_NEAR(tool.at.back().x() - tool.at.front().x(), 20, 1e-9);  // 40 screen pixels at a zoom of 2
    test::drag(view_, {300, 100}, {340, 100});                        // not the tool's
    EXPECT_NE(view_.displayWindow(), window);
    EXPECT_EQ(tool.released, 1);
}

TEST_F(ImageViewTest, AToolTakesKeysFirstAndIsDrawnAboveTheImage) {
    Recorder tool;
    view_.setDisplayWindow({5000, 1});  // black
    const auto handle = [&] {
        return qRed(view_.grab().toImage().pixel(view_.widgetFromImage(QPointF(20, 50)).toPoint()));
    };
    EXPECT_LT(handle(), 30);
    view_.setTool(&tool);
    EXPECT_GT(handle(), 150);
    test::turnWheel(view_, {100, 100}, 2);
    const double zoomed = view_.zoom();
    QTest::keyClick(&view_, Qt::Key_F);  // the tool's: does not fit
    EXPECT_EQ(tool.keys, 1);
    EXPECT_EQ(view_.zoom(), zoomed);
    QTest::keyClick(&view_, Qt::Key_I);  // not the tool's
    EXPECT_TRUE(view_.isInverted());
}

// The drawn contour against the place that was asked for, on the screen.
TEST_F(ImageViewTest, AnOverlayIsDrawnWhereItsPixelsAre) {
    view_.setDisplayWindow({5000, 1});  // black
    Overlay overlay;
    overlay.curves.push_back({Ink::stage, {{20, 20}, {20, 80}}, false, false});
    overlay.curves.push_back({Ink::implant, {{150, 20}, {std::nan(""), 0}, {150, 80}}, false, false});  // interrupted
    view_.setOverlay(overlay);
    for (const int notches : {0, 3, 2}) {
        test::turnWheel(view_, view_.widgetFromImage({20, 50}), notches);
        const QImage picture = view_.grab().toImage();
        const QPointF middle = view_.widgetFromImage({20, 50});
        // A dashed line: look along it for the columns that are yellow anywhere.
        double sum = 0, weight = 0;
        for (int x = static_cast<int>(middle.x()) - 8; x < middle.x() + 8; ++x) {
            for (int y = static_cast<int>(middle.y()) - 20; y < middle.y() + 20; ++y) {
                const QRgb c = picture.pixel(x, y);
                const double yellow = std::max(0, std::min(qRed(c), qGreen(c)) - qBlue(c));
                sum += yellow * (x + 0.5);
                weight += yellow;
            }
        }
        ASSERT_GT(weight, 100);
        EXPECT_NEAR(sum / weight, middle.x(), 0.2) << notches;  // the halo lies a pixel to the right, and is dark
    }
}

TEST(ScaleBar, IsARoundLengthThatFits) {
    EXPECT_DOUBLE_EQ(scaleBarLength(2, 160), 50);   // 80 mm would fit
    EXPECT_DOUBLE_EQ(scaleBarLength(2, 40), 20);    // exactly
    EXPECT_DOUBLE_EQ(scaleBarLength(10, 160), 10);  // 16 mm would fit
    EXPECT_DOUBLE_EQ(scaleBarLength(1000, 160), 0.1);
    EXPECT_DOUBLE_EQ(scaleBarLength(0, 160), 0);
}

TEST_F(ImageViewTest, TheKeyRBringsTheAutomaticWindowBack) {
    const DisplayWindow automatic = view_.displayWindow();
    test::drag(view_, {100, 100}, {180, 140});
    ASSERT_NE(view_.displayWindow(), automatic);
    QTest::keyClick(&view_, Qt::Key_R);
    EXPECT_EQ(view_.displayWindow(), automatic);
}

TEST_F(ImageViewTest, ReadsOutThePixelUnderTheCursor) {
    EXPECT_EQ(view_.readOut(view_.widgetFromImage({0, 0})), "x 0  y 0   0");
    EXPECT_EQ(view_.readOut(view_.widgetFromImage({199, 99})), "x 199  y 99   1000");
    EXPECT_EQ(view_.readOut(view_.widgetFromImage({-1, 5})), "");
    EXPECT_EQ(view_.readOut(view_.widgetFromImage({5, 100})), "");
}

TEST_F(ImageViewTest, PaintsTheGreyOfTheWindow) {
    view_.setDisplayWindow({500, 1000});
    const QImage picture = view_.grab().toImage();
    // A pixel's grey is 255 * value / 1000; the image is smoothed at this zoom, hence 3 grey levels.
    for (const int x : {60, 100, 140}) {
        const QPoint place = view_.widgetFromImage({static_cast<double>(x), 50}).toPoint();
        EXPECT_NEAR(qRed(picture.pixel(place)), 255.0 * x / 199, 3) << x;
    }
}

TEST(ImageView, WithoutAnImageItSaysWhatItWaitsFor) {
    ImageView view;
    view.resize(300, 200);
    const QImage empty = view.grab().toImage();
    view.setMessage("Projecting", 0.5);
    EXPECT_NE(view.grab().toImage(), empty);
    test::drag(view, {10, 10}, {90, 90});
    test::turnWheel(view, {10, 10}, 2);
    EXPECT_EQ(view.readOut({10, 10}), "");
}

}  // namespace
}  // namespace fluorocut::ui
