#include "ui/scene/scene_camera.h"

#include <algorithm>
#include <cmath>

namespace fluorocut::ui {
namespace {

constexpr double kNearest_mm = 20, kFarthest_mm = 20000;  // that the viewer can go
constexpr double kHalfTurn = std::numbers::pi;

}  // namespace

Vector3 SceneCamera::towardViewer() const {
    return {std::sin(azimuth_rad) * std::cos(elevation_rad), -std::cos(azimuth_rad) * std::cos(elevation_rad),
            std::sin(elevation_rad)};
}

Vector3 SceneCamera::right() const {
    return {std::cos(azimuth_rad), std::sin(azimuth_rad), 0};
}

Vector3 SceneCamera::up() const {
    return towardViewer().cross(right());
}

Vector3 SceneCamera::seen(const Vector3& point) const {
    const Vector3 from_focus = point - focus;
    return {from_focus.dot(right()), from_focus.dot(up()), distance_mm - from_focus.dot(towardViewer())};
}

double SceneCamera::focalLengthPx(const QSizeF& picture) const {
    return 0.5 * picture.height() / std::tan(0.5 * view_angle_rad);
}

QPointF SceneCamera::project(const Vector3& point, const QSizeF& picture) const {
    const Vector3 p = seen(point);
    const double scale = focalLengthPx(picture) / p.z();
    return {0.5 * picture.width() + scale * p.x(), 0.5 * picture.height() - scale * p.y()};
}

Vector3 SceneCamera::rayThrough(const QPointF& place, const QSizeF& picture) const {
    const double f = focalLengthPx(picture);
    return (place.x() - 0.5 * picture.width()) / f * right() + (0.5 * picture.height() - place.y()) / f * up() -
           towardViewer();
}

SceneCamera::Depths SceneCamera::depths(const SceneBall& ball) const {
    const double middle = seen(ball.middle).z(), reach = 1.01 * ball.radius_mm + 1;
    const double far = std::max(middle + reach, 10.0);
    // A 24 bit depth buffer tells 0.1 mm apart at 1 m with a nearest plane of 5 mm.
    return {std::max(middle - reach, std::min(0.002 * far, 5.0)), far};
}

void SceneCamera::orbit(const QPointF& moved, const QSizeF& picture) {
    const double per_px = kHalfTurn / std::max(1.0, picture.height());
    azimuth_rad = std::remainder(azimuth_rad - per_px * moved.x(), 2 * kHalfTurn);
    elevation_rad = std::clamp(elevation_rad + per_px * moved.y(), -0.5 * kHalfTurn, 0.5 * kHalfTurn);
}

void SceneCamera::pan(const QPointF& moved, const QSizeF& picture) {
    const double mm_per_px = distance_mm / focalLengthPx(picture);
    focus += mm_per_px * (moved.y() * up() - moved.x() * right());
}

void SceneCamera::zoom(double factor) {
    distance_mm = std::clamp(distance_mm / factor, kNearest_mm, kFarthest_mm);
}

void SceneCamera::lookFrom(LookFrom side) {
    azimuth_rad = side == LookFrom::posterior ? kHalfTurn
                  : side == LookFrom::left    ? 0.5 * kHalfTurn
                  : side == LookFrom::right   ? -0.5 * kHalfTurn
                                              : 0;
    elevation_rad = side == LookFrom::superior ? 0.5 * kHalfTurn : 0;
}

void SceneCamera::fit(const SceneBall& ball, const QSizeF& picture) {
    if (!(ball.radius_mm > 0)) return;
    const double half_tangent = std::tan(0.5 * view_angle_rad) * std::min(1.0, picture.width() / picture.height());
    focus = ball.middle;
    distance_mm = std::clamp(ball.radius_mm / std::sin(std::atan(half_tangent)), kNearest_mm, kFarthest_mm);
}

}  // namespace fluorocut::ui
