#include "ui/scene/scene_camera.h"

#include <gtest/gtest.h>

namespace fluorocut::ui {
namespace {

constexpr double kPi = std::numbers::pi;
const QSizeF kPicture(400, 300);

TEST(SceneCamera, FromTheFrontThePatientsLeftIsOnTheRightAndTheHeadUp) {
    const SceneCamera camera;
    const QPointF middle = camera.project({0, 0, 0}, kPicture);
    EXPECT_NEAR(middle.x(), 200, 1e-12);
    EXPECT_NEAR(middle.y(), 150, 1e-12);
    EXPECT_GT(camera.project({10, 0, 0}, kPicture).x(), 200);
    EXPECT_LT(camera.project({0, 0, 10}, kPicture).y(), 150);
    EXPECT_NEAR((camera.position() - Vector3(0, -1000, 0)).norm(), 0, 1e-9);  // in front: A is -y
}

TEST(SceneCamera, AMillimetreAtTheFocusIsAsLongAsThePinholeSays) {
    SceneCamera camera;
    camera.focus = {5, 6, 7};
    camera.azimuth_rad = 0.7;
    camera.elevation_rad = -0.3;
    // Half the picture's height is tan(half the angle) of the distance.
    const double px_per_mm = 150 / (1000 * std::tan(0.5 * camera.view_angle_rad));
    const QPointF moved = camera.project(camera.focus + 20 * camera.right() + 10 * camera.up(), kPicture);
    EXPECT_NEAR(moved.x(), 200 + 20 * px_per_mm, 1e-9);
    EXPECT_NEAR(moved.y(), 150 - 10 * px_per_mm, 1e-9);
}

TEST(SceneCamera, RaysRunThroughTheirPixel) {
    SceneCamera camera;
    camera.azimuth_rad = 2;
    camera.elevation_rad = 0.5;
    const Vector3 ray = camera.rayThrough({37, 211}, kPicture);
    const QPointF back = camera.project(camera.position() + 321 * ray, kPicture);
    EXPECT_NEAR(back.x(), 37, 1e-9);
    EXPECT_NEAR(back.y(), 211, 1e-9);
}

TEST(SceneCamera, AnOrbitKeepsTheDistanceAndTheHeadUp) {
    SceneCamera camera;
    camera.orbit({100, 0}, kPicture);  // a third of the height: 60 degrees; the scene follows the hand
    EXPECT_NEAR(camera.azimuth_rad, -kPi / 3, 1e-12);
    camera.orbit({-1e4, 1e5}, kPicture);
    EXPECT_DOUBLE_EQ(camera.elevation_rad, 0.5 * kPi);
    EXPECT_LE(std::abs(camera.azimuth_rad), kPi);
    EXPECT_NEAR((camera.position() - camera.focus).norm(), 1000, 1e-9);
    EXPECT_NEAR(camera.right().z(), 0, 1e-12);
}

TEST(SceneCamera, APanFollowsTheHand) {
    SceneCamera camera;
    camera.azimuth_rad = 1;
    camera.elevation_rad = 0.4;
    const Vector3 point = camera.focus + 30 * camera.right() + 20 * camera.up();  // in the plane of the focus
    const QPointF before = camera.project(point, kPicture);
    camera.pan({17, -9}, kPicture);
    const QPointF after = camera.project(point, kPicture);
    EXPECT_NEAR(after.x() - before.x(), 17, 1e-9);
    EXPECT_NEAR(after.y() - before.y(), -9, 1e-9);
}

TEST(SceneCamera, LooksFromWhereItSays) {
    SceneCamera camera;
    const std::pair<LookFrom, Vector3> sides[] = {{LookFrom::anterior, {0, -1, 0}},
                                                  {LookFrom::posterior, {0, 1, 0}},
                                                  {LookFrom::left, {1, 0, 0}},
                                                  {LookFrom::right, {-1, 0, 0}},
                                                  {LookFrom::superior, {0, 0, 1}}};
    for (const auto& [side, toward] : sides) {
        camera.lookFrom(side);
        EXPECT_NEAR((camera.towardViewer() - toward).norm(), 0, 1e-12);
    }
    // From above, the front of the body is below in the picture, and its left still on the right.
    EXPECT_GT(camera.project({0, -10, 0}, kPicture).y(), 150);
    EXPECT_GT(camera.project({10, 0, 0}, kPicture).x(), 200);
}

TEST(SceneCamera, FitsABallInBothDirections) {
    for (const QSizeF& picture : {QSizeF(400, 300), QSizeF(200, 500)}) {
        SceneCamera camera;
        camera.fit({{1, 2, 3}, 80}, picture);
        // The ball's tangent cone touches the nearer border: it has the half angle there.
        const double side = std::min(picture.width(), picture.height());
        const double half = std::atan(0.5 * side / camera.focalLengthPx(picture));
        EXPECT_NEAR(std::asin(80 / camera.distance_mm), half, 1e-9);
        const SceneCamera::Depths depths = camera.depths({{1, 2, 3}, 80});
        EXPECT_LT(depths.near_mm, camera.distance_mm - 80);
        EXPECT_GT(depths.far_mm, camera.distance_mm + 80);
    }
    SceneCamera camera;
    camera.fit({}, kPicture);
    EXPECT_DOUBLE_EQ(camera.distance_mm, 1000);  // nothing there: nothing changes
}

TEST(SceneCamera, ZoomHasLimits) {
    SceneCamera camera;
    camera.zoom(2);
    EXPECT_DOUBLE_EQ(camera.distance_mm, 500);
    camera.zoom(1e9);
    EXPECT_DOUBLE_EQ(camera.distance_mm, 20);
    camera.zoom(1e-9);
    EXPECT_DOUBLE_EQ(camera.distance_mm, 20000);
    EXPECT_GT(camera.depths({{0, 0, 0}, 5}).near_mm, 0);
}

}  // namespace
}  // namespace fluorocut::ui
