#include "core/simulation/intensifier_distortion.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "core/base/option_checks.h"

namespace fluorocut {
namespace {

constexpr double kReach = 2;         // in field radii: where the cubic becomes a straight line
constexpr double kLeastSlope = 0.1;  // of the radial term; at zero the picture folds over

// The radial term in units of the field radius, and its slope.
struct Radial {
    double value, slope;
};

Radial radial(double strength, double radius) {
    const double inside = std::min(radius, kReach);
    const double slope = 1 + 3 * strength * inside * inside;
    return {inside + strength * inside * inside * inside + slope * (radius - inside), slope};
}

Vector2 turned(const Vector2& v, double angle_rad) {
    return Eigen::Rotation2Dd(angle_rad) * v;
}

}  // namespace

Result<void> IntensifierDistortionParameters::validate() const {
    if (auto ok = requireRange("field_radius_mm", field_radius_mm, 10, 1000, "mm"); !ok) return ok;
    const double lowest = -(1 - kLeastSlope) / (3 * kReach * kReach) * field_radius_mm;
    if (!(pincushion_mm >= lowest && pincushion_mm <= field_radius_mm)) {
        return invalidOption("pincushion_mm", fmt::format("{}", pincushion_mm),
                             fmt::format("{:.3f} (below, the picture folds over) to {} mm", lowest, field_radius_mm));
    }
    return requireRanges({{"s_shape_rad", s_shape_rad, -1, 1, "rad"},
                          {"shift_mm[0]", shift_mm.x(), -100, 100, "mm"},
                          {"shift_mm[1]", shift_mm.y(), -100, 100, "mm"},
                          {"rotation_rad", rotation_rad, -1, 1, "rad"}});
}

Result<std::shared_ptr<const IntensifierDistortion>> IntensifierDistortion::create(
    const IntensifierDistortionParameters& parameters) {
    if (auto ok = parameters.validate(); !ok) return ok.error();
    return std::shared_ptr<const IntensifierDistortion>(new IntensifierDistortion(parameters));
}

Vector2 IntensifierDistortion::distorted(const Vector2& undistorted_mm) const {
    const IntensifierDistortionParameters& p = parameters_;
    const double radius = undistorted_mm.norm() / p.field_radius_mm;
    if (radius == 0) return p.shift_mm;
    const double scale = radial(p.pincushion_mm / p.field_radius_mm, radius).value / radius;
    return p.shift_mm + turned(undistorted_mm * scale, p.rotation_rad + p.s_shape_rad * radius * radius);
}

Vector2 IntensifierDistortion::undistorted(const Vector2& distorted_mm) const {
    const IntensifierDistortionParameters& p = parameters_;
    const Vector2 centered = distorted_mm - p.shift_mm;
    const double target = centered.norm() / p.field_radius_mm;
    if (target == 0) return Vector2::Zero();
    const double strength = p.pincushion_mm / p.field_radius_mm;
    // The term is convex or concave throughout, so Newton's method converges from anywhere; from here in three steps.
    const double inside = std::min(target, kReach);
    double radius = target / (1 + strength * inside * inside);
    for (int iteration = 0; iteration < 50; ++iteration) {
        const Radial at = radial(strength, radius);
        const double step = (at.value - target) / at.slope;
        radius -= step;
        if (std::abs(step) < 1e-8 * radius) break;  // it converges quadratically: the rest is rounding
    }
    return turned(centered * (radius / target), -(p.rotation_rad + p.s_shape_rad * radius * radius));
}

Result<void> IntensifierOptions::validate() const {
    if (auto ok = IntensifierDistortionParameters{field_radius_mm, pincushion_mm, s_shape_rad}.validate(); !ok) {
        return ok;
    }
    return requireRanges({{"field_shift_mm", field_shift_mm, -20, 20, "mm"},
                          {"field_dip_rad", field_dip_rad, -4, 4, "rad"},
                          {"field_heading_rad", field_heading_rad, -7, 7, "rad"},
                          {"sag_shift_mm", sag_shift_mm, -20, 20, "mm"},
                          {"sag_rotation_rad", sag_rotation_rad, -0.5, 0.5, "rad"},
                          {"repeatability_mm", repeatability_mm, 0, 1, "mm"}});
}

IntensifierOptions IntensifierOptions::none() {
    IntensifierOptions options;
    options.pincushion_mm = options.s_shape_rad = options.field_shift_mm = 0;
    options.sag_shift_mm = options.sag_rotation_rad = 0;
    return options;
}

IntensifierDistortionParameters intensifierAt(const IntensifierOptions& options, const Rigid3& imager_from_room) {
    const double dip = options.field_dip_rad, heading = options.field_heading_rad;
    const Vector3 field =
        imager_from_room.rotate({std::cos(dip) * std::sin(heading), std::sin(dip), std::cos(dip) * std::cos(heading)});
    const Vector3 gravity = imager_from_room.rotate(Vector3::UnitY());
    IntensifierDistortionParameters p;
    p.field_radius_mm = options.field_radius_mm;
    p.pincushion_mm = options.pincushion_mm;
    p.s_shape_rad = options.s_shape_rad * field.z();
    // The force on electrons that fly along the tube: -e z x B.
    p.shift_mm = options.field_shift_mm * Vector2(field.y(), -field.x()) + options.sag_shift_mm * gravity.head<2>();
    p.rotation_rad = options.sag_rotation_rad * gravity.x();
    return p;
}

IntensifierDistortionParameters disturbed(IntensifierDistortionParameters p, double repeatability_mm, Random& random) {
    const auto error = [&] { return repeatability_mm * random.normal(); };
    p.pincushion_mm += error();
    p.s_shape_rad += error() / p.field_radius_mm;
    p.shift_mm.x() += error();
    p.shift_mm.y() += error();
    p.rotation_rad += error() / p.field_radius_mm;
    return p;
}

}  // namespace fluorocut
