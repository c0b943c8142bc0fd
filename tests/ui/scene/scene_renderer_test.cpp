// Pictures held against what the pinhole says of them, for both renderers, and the two against each other.
#include "ui/scene/scene_renderer.h"

#include <gtest/gtest.h>

#include "tests/support/program.h"
#include "tests/ui/scene/scene_shapes.h"

namespace fluorocut::ui {
namespace {

using test::Covered;
using test::difference;
using test::square;
using test::thing;

const QSize kSize(240, 160);

// At 1 m a millimetre is two pixels.
SceneCamera twoPixelsAMillimetre() {
    SceneCamera camera;
    camera.view_angle_rad = 2 * std::atan(0.5 * kSize.height() / (2 * camera.distance_mm));
    return camera;
}

QRgb mixed(double share, QRgb front, QRgb back) {
    const auto part = [&](int (*of)(QRgb)) {
        return static_cast<int>(share * of(front) + (1 - share) * of(back) + 0.5);
    };
    return qRgb(part(qRed), part(qGreen), part(qBlue));
}

SceneItem glass(SceneItem item, double opacity) {
    item.opacity = item.rim_opacity = opacity;
    return item;
}

class Renderer : public testing::TestWithParam<SceneBackend> {
  protected:
    void SetUp() override {
        renderer_ = makeSceneRenderer(GetParam()).renderer;
        if (!renderer_) GTEST_SKIP() << "this machine has no EGL";
    }
    QImage draw(const std::vector<SceneItem>& items, const SceneCamera& camera = twoPixelsAMillimetre()) {
        return renderer_->render(items, camera, kSize).convertToFormat(QImage::Format_RGB32);
    }
    std::unique_ptr<SceneRenderer> renderer_;
};

TEST_P(Renderer, ASquareCoversExactlyItsPixels) {
    // From the middle of the picture 20 mm to the right and up: 40 x 40 pixels, their borders between pixels.
    const QImage picture = draw({square(20, Qt::red)});
    ASSERT_EQ(picture.size(), kSize);
    const Covered covered(picture, draw({}));
    for (int y = 0; y < kSize.height(); ++y)
        for (int x = 0; x < kSize.width(); ++x)
            ASSERT_EQ(covered(x, y), x >= 120 && x < 160 && y >= 40 && y < 80) << x << " " << y;
    // Face on: ambient and diffuse light add up to the whole colour.
    EXPECT_LE(difference(picture.pixel(140, 60), qRgb(255, 0, 0)), 2);
}

TEST_P(Renderer, ACubeCoversTheOutlineOfItsNearFace) {
    // Its near face, 990 mm away, hides the rest: half of it is 10 mm * 2000 / 990 = 20.2 pixels.
    const Covered covered(draw({thing(makeBox({20, 20, 20}), Qt::white)}), draw({}));
    for (int y = 0; y < kSize.height(); ++y)
        for (int x = 0; x < kSize.width(); ++x)
            ASSERT_EQ(covered(x, y), std::abs(x + 0.5 - 120) < 20.2 && std::abs(y + 0.5 - 80) < 20.2) << x << " " << y;
}

TEST_P(Renderer, WhatIsNearerHidesWhatIsBehind) {
    const SceneItem far = square(20, Qt::red), near = square(10, Qt::blue, Rigid3::fromTranslation({0, -50, 0}));
    for (const auto& items : {std::vector{far, near}, std::vector{near, far}}) {
        const QImage picture = draw(items);
        EXPECT_LE(difference(picture.pixel(125, 75), qRgb(0, 0, 255)), 2);
        EXPECT_LE(difference(picture.pixel(155, 45), qRgb(255, 0, 0)), 2);
    }
}

TEST_P(Renderer, GlassMixesWithWhatIsBehindIt) {
    const SceneItem pane = glass(square(20, QColor(0, 255, 0)), 0.25);
    const QRgb behind = draw({}).pixel(130, 70);
    const QRgb once = mixed(0.25, qRgb(0, 255, 0), behind);
    EXPECT_LE(difference(draw({pane}).pixel(130, 70), once), 2);
    // Over a solid thing, whatever their order.
    const SceneItem solid = square(20, Qt::red, Rigid3::fromTranslation({0, 30, 0}));
    for (const auto& items : {std::vector{pane, solid}, std::vector{solid, pane}})
        EXPECT_LE(difference(draw(items).pixel(130, 70), mixed(0.25, qRgb(0, 255, 0), qRgb(255, 0, 0))), 2);
    // Behind one: not seen.
    const SceneItem before = square(20, Qt::red, Rigid3::fromTranslation({0, -30, 0}));
    EXPECT_LE(difference(draw({pane, before}).pixel(130, 70), qRgb(255, 0, 0)), 2);
    // Two panes, the inner one first.
    const SceneItem outer = glass(square(20, QColor(0, 0, 255), Rigid3::fromTranslation({0, -30, 0})), 0.5);
    EXPECT_LE(difference(draw({pane, outer}).pixel(130, 70), mixed(0.5, qRgb(0, 0, 255), once)), 2);
}

TEST_P(Renderer, OfGlassOnlyTheNearestLayerIsSeen) {
    const SceneItem box = glass(thing(makeBox({20, 20, 20}), Qt::green), 0.25);
    const SceneItem pane = glass(square(20, Qt::green, Rigid3::fromTranslation({-10, -10, -10})), 0.25);
    EXPECT_LE(difference(draw({box}).pixel(120, 80), draw({pane}).pixel(120, 80)), 1);
}

TEST_P(Renderer, ARimIsDenserThanAFace) {
    SceneItem ball = thing(makeSphere(30, 5), Qt::white);
    ball.opacity = 0.2;
    ball.rim_opacity = 0.9;
    const QImage picture = draw({ball}), empty = draw({});
    const auto expected = [&](double n, QRgb back) {
        const double opacity = 0.9 + n * (0.2 - 0.9), bright = 255 * (ball.ambient + (1 - ball.ambient) * n);
        return opacity * bright + (1 - opacity) * qRed(back);
    };
    EXPECT_NEAR(qRed(picture.pixel(120, 80)), expected(1, empty.pixel(120, 80)), 3);
    // Half way out n is sqrt(3) / 2, but for the perspective (3 % of the radius) and facets of 1 degree.
    EXPECT_NEAR(qRed(picture.pixel(150, 80)), expected(std::sqrt(0.75), empty.pixel(150, 80)), 6);
}

TEST_P(Renderer, APictureLiesTheRightWayRound) {
    SceneItem item = square(20, Qt::white);
    auto picture = std::make_shared<ScenePicture>();
    picture->image = QImage(2, 2, QImage::Format_RGB32);
    picture->image.setPixel(0, 0, qRgb(255, 0, 0));
    picture->image.setPixel(1, 0, qRgb(0, 255, 0));
    picture->image.setPixel(0, 1, qRgb(0, 0, 255));
    picture->image.setPixel(1, 1, qRgb(255, 255, 255));
    // The square's vertices: lower left, lower right, upper right, upper left.
    picture->places = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
    item.picture = picture;
    item.one_sided = true;
    const QImage drawn = draw({item});
    EXPECT_LE(difference(drawn.pixel(122, 42), qRgb(255, 0, 0)), 2);
    EXPECT_LE(difference(drawn.pixel(157, 42), qRgb(0, 255, 0)), 2);
    EXPECT_LE(difference(drawn.pixel(122, 77), qRgb(0, 0, 255)), 2);
    EXPECT_LE(difference(drawn.pixel(157, 77), qRgb(255, 255, 255)), 2);
    // Not from behind.
    SceneCamera behind = twoPixelsAMillimetre();
    behind.lookFrom(LookFrom::posterior);
    EXPECT_EQ(draw({item}, behind), draw({}, behind));
}

TEST_P(Renderer, ALineIsWhereItsEndsAre) {
    SceneItem item;
    item.lines = std::make_shared<const SceneLines>(SceneLines{{{-20, 0, 10.25}, {20, 0, 10.25}}});
    item.color = Qt::white;
    measure(item);
    const Covered covered(draw({item}), draw({}));
    // The middle of row 59, from column 80 to 160; a pixel more or less at the ends.
    for (int x = 82; x < 158; ++x)
        EXPECT_TRUE(covered(x, 59)) << x;
    EXPECT_FALSE(covered(77, 59) || covered(163, 59) || covered(120, 56) || covered(120, 62));
}

TEST_P(Renderer, AMovedThingIsDrawnWhereItIsNow) {
    SceneItem item = square(20, Qt::red);
    const QImage before = draw({item});
    item.femur_from_item = Rigid3::fromTranslation({-30, 0, -10});  // 60 pixels to the left, 20 down
    const QImage moved = draw({item});
    EXPECT_LE(difference(moved.pixel(80, 80), qRgb(255, 0, 0)), 2);
    EXPECT_EQ(moved.pixel(150, 50), draw({}).pixel(150, 50));
}

TEST_P(Renderer, WhatReachesBehindTheViewerIsCutOff) {
    // Inside a long tunnel: its walls fill the picture's corners, and nothing wraps round.
    const Covered covered(draw({thing(makeBox({30, 4000, 30}), Qt::white)}), draw({}));
    EXPECT_TRUE(covered(5, 5) && covered(235, 155) && covered(235, 5) && covered(5, 155));
}

TEST_P(Renderer, AnEmptySizeGivesNoPicture) {
    EXPECT_TRUE(renderer_->render({}, {}, QSize(0, 10)).isNull());
}

INSTANTIATE_TEST_SUITE_P(Scene, Renderer, testing::Values(SceneBackend::openGL, SceneBackend::cpu),
                         [](const auto& backend) { return backend.param == SceneBackend::cpu ? "Cpu" : "OpenGl"; });

TEST(Renderers, AgreeOnSilhouettes) {
    const auto opengl = makeSceneRenderer(SceneBackend::openGL).renderer;
    if (!opengl) GTEST_SKIP() << "this machine has no EGL";
    const auto cpu = makeSceneRenderer(SceneBackend::cpu).renderer;
    SceneItem shell = glass(thing(makeSphere(25, 4), Qt::white, Rigid3::fromTranslation({20, 5, -10})), 0.3);
    shell.rim_opacity = 0.9;
    const Rigid3 tilted = Rigid3::fromTranslation({0, 0, 50}) * Rigid3::fromRotationVector({0.4, 0.3, 0.2});
    const std::vector<SceneItem> items{thing(makeStem(), QColor(86, 180, 233), tilted), shell};
    for (const double azimuth : {0.0, 1.0, 2.5}) {
        SceneCamera camera;
        camera.azimuth_rad = azimuth;
        camera.elevation_rad = 0.3;
        camera.fit(ballAround(items), kSize);
        const auto draw = [&](SceneRenderer& renderer) {
            return Covered(renderer.render(items, camera, kSize), renderer.render({}, camera, kSize));
        };
        const Covered a = draw(*opengl), b = draw(*cpu);
        // A pixel may differ only where the other picture's border is within one pixel.
        const auto near = [](const Covered& mask, int x, int y, bool value) {
            for (int j = std::max(0, y - 1); j <= std::min(kSize.height() - 1, y + 1); ++j)
                for (int i = std::max(0, x - 1); i <= std::min(kSize.width() - 1, x + 1); ++i)
                    if (mask(i, j) == value) return true;
            return false;
        };
        int covering = 0;
        for (int y = 0; y < kSize.height(); ++y)
            for (int x = 0; x < kSize.width(); ++x) {
                covering += a(x, y);
                EXPECT_TRUE(near(b, x, y, a(x, y)) && near(a, x, y, b(x, y))) << x << " " << y << " at " << azimuth;
            }
        EXPECT_GT(covering, 2000);  // there is something to compare
    }
}

TEST(Renderers, PicturesAreTheSameFromRunToRun) {
    for (const SceneBackend backend : {SceneBackend::openGL, SceneBackend::cpu}) {
        const auto one = makeSceneRenderer(backend).renderer, other = makeSceneRenderer(backend).renderer;
        if (!one || !other) continue;
        const std::vector<SceneItem> items{thing(makeSphere(20, 4), Qt::yellow)};
        EXPECT_EQ(one->render(items, {}, kSize), other->render(items, {}, kSize));
    }
}

TEST(Renderers, TheEnvironmentSwitchesOpenGlOff) {
    qputenv("FLUOROCUT_SCENE", "cpu");
    const ChosenRenderer chosen = makeSceneRenderer(SceneBackend::automatic);
    qunsetenv("FLUOROCUT_SCENE");
    EXPECT_FALSE(chosen.renderer->usesOpenGL());
    EXPECT_FALSE(chosen.why_no_opengl.isEmpty());
}

// Once more in a process of its own, whose EGL has no implementation to hand over to.
TEST(Renderers, WithoutEglTheCpuDraws) {
    if (qEnvironmentVariableIsEmpty("FLUOROCUT_TEST_WITHOUT_EGL")) {
        qputenv("FLUOROCUT_TEST_WITHOUT_EGL", "1");
        qputenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nonexistent.json");
        const auto run = test::runProgram("/proc/self/exe", {"--gtest_filter=Renderers.WithoutEglTheCpuDraws"});
        qunsetenv("FLUOROCUT_TEST_WITHOUT_EGL");
        qunsetenv("__EGL_VENDOR_LIBRARY_FILENAMES");
        EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
        return;
    }
    const ChosenRenderer chosen = makeSceneRenderer(SceneBackend::automatic);
    ASSERT_TRUE(chosen.renderer);
    EXPECT_FALSE(chosen.renderer->usesOpenGL());
    EXPECT_FALSE(chosen.why_no_opengl.isEmpty());
    EXPECT_FALSE(makeSceneRenderer(SceneBackend::openGL).renderer);
    EXPECT_EQ(chosen.renderer->render({square(20, Qt::red)}, {}, kSize).size(), kSize);
}

}  // namespace
}  // namespace fluorocut::ui
