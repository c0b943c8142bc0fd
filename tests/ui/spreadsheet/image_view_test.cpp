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

TEST_F(ImageViewTest, ADoubleClickFitsAgain) {
    test::turnWheel(view_, {10, 10}, 4);
    test::sendMouse(view_, QEvent::MouseButtonDblClick, {50, 50}, Qt::LeftButton, Qt::LeftButton);
    EXPECT_DOUBLE_EQ(view_.zoom(), 2);
    EXPECT_NEAR(view_.imageFromWidget({0, 50}).x(), -0.5, 1e-9);
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
