#include "core/fiducial/sphere_shadow.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

namespace fluorocut {
namespace {

constexpr int kOutlinePoints = 8;  // exact for distortions up to the seventh order across the shadow

Vector2 meanOf(const std::vector<Vector2>& points) {
    Vector2 sum = Vector2::Zero();
    for (const Vector2& point : points)
        sum += point;
    return sum / static_cast<double>(points.size());
}

double angleOf(int i, int count) {
    return 2 * std::numbers::pi * i / count;
}

}  // namespace

Vector2 SphereShadow::at(double angle_rad) const {
    const Vector2 tangential(-radial_direction.y(), radial_direction.x());
    return center_mm + radial_mm * std::cos(angle_rad) * radial_direction +
           tangential_mm * std::sin(angle_rad) * tangential;
}

SphereShadow sphereShadow(const Vector3& center_in_imager, double radius_mm, double focal_length_mm) {
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    const double z = center_in_imager.z();
    if (!(radius_mm >= 0 && z > radius_mm)) return {{kNaN, kNaN}, {kNaN, kNaN}, kNaN, kNaN};
    const Vector2 off = center_in_imager.head<2>();
    const double denominator = z * z - radius_mm * radius_mm;
    SphereShadow shadow;
    shadow.center_mm = focal_length_mm * z / denominator * off;
    shadow.radial_direction = off.norm() > 0 ? Vector2(off.normalized()) : Vector2(1, 0);
    shadow.radial_mm =
        focal_length_mm * radius_mm * std::sqrt(center_in_imager.squaredNorm() - radius_mm * radius_mm) / denominator;
    shadow.tangential_mm = focal_length_mm * radius_mm / std::sqrt(denominator);
    return shadow;
}

std::vector<Vector2> shadowOutline(const CArm& carm, const Vector3& center_in_imager, double radius_mm, int points) {
    if (points < 1) throw std::logic_error("shadowOutline: no points");
    const SphereShadow shadow = sphereShadow(center_in_imager, radius_mm, carm.focal_length_mm);
    std::vector<Vector2> outline;
    for (int i = 0; i < points; ++i) {
        const Vector2 ideal_px = shadow.at(angleOf(i, points)).cwiseQuotient(carm.pixel_mm) + carm.principal_point_px;
        outline.push_back(carm.distortedPixel(ideal_px));
    }
    return outline;
}

Vector2 shadowCenter(const CArm& carm, const Vector3& center_in_imager, double radius_mm) {
    if (carm.distortion) return meanOf(shadowOutline(carm, center_in_imager, radius_mm, kOutlinePoints));
    return sphereShadow(center_in_imager, radius_mm, carm.focal_length_mm).center_mm.cwiseQuotient(carm.pixel_mm) +
           carm.principal_point_px;
}

Vector2 idealShadowCenter(const CArm& carm, const Vector2& center_px, double radius_px) {
    if (!carm.distortion) return center_px;
    // The circle's mean moves by the mean of the map's bend over it; half of the way there and back again differ in the
    // third order only.
    std::vector<Vector2> outline;
    for (int i = 0; i < kOutlinePoints; ++i) {
        const double angle = angleOf(i, kOutlinePoints);
        outline.push_back(carm.idealPixel(center_px + radius_px * Vector2(std::cos(angle), std::sin(angle))));
    }
    return meanOf(outline);
}

}  // namespace fluorocut
