#include "core/simulation/femur_tissue.h"

#include <limits>

#include "core/simulation/implicit.h"

namespace fluorocut {

using namespace implicit;

namespace {

constexpr int kCurvePoints = 24;

// Cubic Bezier.
std::vector<Vector2> arch(const Vector2& a, const Vector2& b, const Vector2& c, const Vector2& d) {
    std::vector<Vector2> points;
    for (int n = 0; n <= kCurvePoints; ++n) {
        const double t = double(n) / kCurvePoints, s = 1 - t;
        points.push_back(s * s * s * a + 3 * s * s * t * b + 3 * s * t * t * c + t * t * t * d);
    }
    return points;
}

}  // namespace

FemurTissue::FemurTissue(const FemurShape& shape, const BoneDensities& densities, std::uint64_t seed)
    : shape_(shape), densities_(densities), fine_(seed), coarse_(seed ^ 0x5bd1e995u) {
    medial_ = Vector3(shape.neckDirection().x(), shape.neckDirection().y(), 0).normalized();
    across_ = Vector3::UnitZ().cross(medial_);
    const double s = shape.scale(), r = shape.headRadius();
    const Vector2 head(shape.headCenter().dot(medial_), shape.headCenter().z());
    const double neck_up = head.y() + 0.25 * r;  // level of the upper neck
    groups_ = {
        // Principal compressive.
        {arch({15 * s, -12 * s}, {0.45 * head.x(), 14 * s}, head + Vector2(0.02 * r, -0.7 * r),
              head + Vector2(-0.05 * r, 1.02 * r)),
         3.5 * s, 13 * s, 0.8},
        // Principal tensile.
        {arch({-15 * s, -8 * s}, {-14 * s, neck_up - 2 * s}, {0.45 * head.x(), neck_up + 7 * s},
              head + Vector2(0.95 * r, -0.55 * r)),
         4.5 * s, 7 * s, 0.55},
        // Secondary compressive: from below the lesser trochanter up into the greater.
        {arch({14 * s, -15 * s}, {6 * s, 10 * s}, {-4 * s, 25 * s}, {-12 * s, 50 * s}), 3.5 * s, 8 * s, 0.3},
        // Greater trochanter.
        {arch({-17 * s, 12 * s}, {-22 * s, 25 * s}, {-20 * s, 42 * s}, {-8 * s, 58 * s}), 4 * s, 5 * s, 0.3},
    };
}

FemurTissue::Place FemurTissue::locate(const Group& group, const Vector2& at) {
    Place place{0, 0, 0};
    double nearest = std::numeric_limits<double>::infinity(), walked = 0, total = 0;
    for (std::size_t n = 0; n + 1 < group.curve.size(); ++n) {
        const Vector2& a = group.curve[n];
        const Vector2 step = group.curve[n + 1] - a;
        const double length = step.norm();
        const double t = std::clamp((at - a).dot(step) / (length * length), 0.0, 1.0);
        const Vector2 away = at - a - t * step;
        if (away.squaredNorm() < nearest) {
            nearest = away.squaredNorm();
            place.along = walked + t * length;
            place.across = std::copysign(away.norm(), step.x() * away.y() - step.y() * away.x());
        }
        walked += length;
    }
    total = walked;
    place.fraction = place.along / total;
    return place;
}

double FemurTissue::cortical(const Vector3& p) const {
    // Haversian porosity: streaks along the shaft.
    const double streak = coarse_({p.x() / 2.5, p.y() / 2.5, p.z() / 18});
    const double patch = coarse_(p / 9 + Vector3(31, 7, 3));
    // The thin shells of the metaphysis and the head are less mineralised than the shaft.
    const double shell = smoothStep(15, 45, p.z() / shape_.scale());
    return densities_.cortical_hu * (1 - 0.22 * shell) + 60 * streak + 60 * patch;
}

double FemurTissue::inside(const Vector3& p, double depth_mm) const {
    const double s = shape_.scale(), z = p.z() / s;
    const double marrow = densities_.marrow_hu + 8 * coarse_(p / 6);
    // Trabeculae fill everything above the lesser trochanter and retreat toward the endosteum below it.
    const double reach = 14 * s * smoothStep(-75, 5, z) - 1.5;
    const double filled = z > 15 ? 1 : std::max(smoothStep(-2, 15, z), smoothStep(reach + 3, reach - 3, depth_mm));
    if (filled < 1e-3) return marrow;

    const Vector2 at(p.dot(medial_), p.z());
    const double w = p.dot(across_);
    const double in_head = smoothStep(6 * s, -4 * s, (p - shape_.headCenter()).norm() - shape_.headRadius());
    const double low = 0.45 + 0.4 * smoothStep(8, 0, depth_mm / s);  // between the groups, of the mean
    double relative = low + (0.65 - low) * in_head;
    // Each group is dense near its middle; its lines go on far beyond, fading.
    double lines = 0, weights = 0.25;
    for (std::size_t n = 0; n < groups_.size(); ++n) {
        const Group& group = groups_[n];
        const Place place = locate(group, at);
        const double width = group.width_begin + place.fraction * (group.width_end - group.width_begin);
        const double shape = place.across / width;
        if (std::abs(shape) > 6) continue;
        relative += group.strength * (1 - 0.6 * place.fraction) * std::exp(-0.5 * shape * shape);
        const double weight = group.strength * std::exp(-0.1 * shape * shape);
        const double spacing = s * (1.15 + 0.3 * place.fraction);
        const double offset = 50.0 * static_cast<double>(n);
        const double sheet = fine_({place.across / spacing + offset, place.along / (9 * s), w / 12});
        const double rod = fine_({place.across / spacing * 1.7 + offset, place.along / (5 * s), w / 6 + 30});
        lines += weight * (1.0 - 3.2 * std::abs(sheet) + 0.8 * rod);  // thin bright lines: ridges of the noise
        weights += weight;
    }
    const double crumbs =
        fine_({at.x() / 1.5, at.y() / 1.9, w / 8}) + 0.35 * fine_({at.x() / 3.1 + 40, at.y() / 4, w / 12});
    relative *= 1 + (0.9 - 0.25 * in_head) * lines / weights + 0.35 * crumbs;
    const double bone = densities_.trabecular_hu - densities_.marrow_hu;
    return marrow + filled * std::max(0.0, relative) * bone;
}

}  // namespace fluorocut
