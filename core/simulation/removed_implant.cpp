#include "core/simulation/removed_implant.h"

#include <numbers>

#include "core/base/option_checks.h"
#include "core/base/random.h"
#include "core/simulation/implicit.h"

namespace fluorocut {

using namespace implicit;

namespace {

constexpr double kThinnestWall = 1.2;  // mm of cortex that the cavity and the defects leave
constexpr double kMantle = 2.6;        // mm, thickness of cement where it is whole
constexpr double kPlugLength = 12;     // mm

}  // namespace

Result<void> ImplantRemoval::validate() const {
    if (auto ok = requireRange("resection_height_mm", resection_height_mm, 2, 30, "mm"); !ok) return ok;
    if (auto ok = requireRange("stem_length_mm", stem_length_mm, 60, 250, "mm"); !ok) return ok;
    if (auto ok = requireRange("widening_mm", widening_mm, 0, 6, "mm"); !ok) return ok;
    if (auto ok = requireRange("cement_coverage", cement_coverage, 0, 1, ""); !ok) return ok;
    if (auto ok = requireRange("cement_hu", cement_hu, 0, 5000, "HU"); !ok) return ok;
    if (auto ok = requireRange("filling_hu", filling_hu, -1000, 500, "HU"); !ok) return ok;
    return requireRange("lytic_defects", lytic_defects, 0, 8, "defects");
}

RemovedImplant::RemovedImplant(const FemurShape& shape, const ImplantRemoval& options, double isthmus_canal_mm,
                               std::uint64_t seed)
    : shape_(shape), options_(options), noise_(seed ^ 0x27d4eb2fu) {
    const double s = shape.scale();
    // Walk along the lower wall of the neck until it has the height of the cut.
    const Vector3 neck = shape.neckDirection();
    const Vector3 below = (neck.z() * neck - Vector3::UnitZ()).normalized();
    double along = 0.1 * shape.neckLength();
    for (; along < 0.8 * shape.neckLength(); along += 0.25) {
        Vector3 wall = shape.neckBase() + along * neck;
        while (shape.outer(wall) < 0)
            wall += 0.25 * below;
        if (wall.z() >= options.resection_height_mm) break;
    }
    facts_.resection_point = shape.neckBase() + along * neck;
    facts_.resection_normal = neck;
    lateral_x_ = -5 * s;
    top_z_ = facts_.resection_point.z();
    tip_z_ = top_z_ - options.stem_length_mm;
    tip_radius_ = std::max(3.5 * s, 0.5 * isthmus_canal_mm - 1.2);
    for (double z = top_z_; z > tip_z_; z -= 10)
        facts_.cavity_axis.push_back(level(z).center);
    facts_.cavity_axis.push_back(level(tip_z_).center);

    Random random(seed + 77);
    for (int n = 0; n < options.lytic_defects; ++n) {
        const Level at = level(random.uniform(tip_z_ + 15, top_z_ - 15));
        const double angle = random.uniform(0, 2 * std::numbers::pi);
        const Vector3 wall = at.center + Vector3(at.half_x * std::cos(angle), at.half_y * std::sin(angle), 0);
        defects_.push_back({wall, s * Vector3(random.uniform(4, 7), random.uniform(4, 7), random.uniform(6, 12))});
    }
}

RemovedImplant::Level RemovedImplant::level(double z) const {
    // The stem follows the shaft below and leans along the medial cortex above, lateral edge straight, as stems do.
    const double s = shape_.scale();
    const double up = std::clamp((z - tip_z_) / (10 * s - tip_z_), 0.0, 1.3);
    const double radius = tip_radius_ + up * 2.2 * s;
    const double lean = std::max(0.0, (z + 30 * s) / (55 * s));
    const double medial = radius + 14 * s * lean * lean;
    Vector3 center = shape_.shaftAxis(std::min(z, -5 * s));
    center.z() = z;
    center.x() += 0.5 * (radius - medial);
    center.y() -= 0.2 * (medial - radius);  // turned forward with the neck
    return {center, 0.5 * (radius + medial), radius};
}

double RemovedImplant::resected(const Vector3& p) const {
    const double above = facts_.resection_normal.dot(facts_.resection_point - p);
    return smoothIntersection(above, p.x() - lateral_x_, 2);
}

double RemovedImplant::stemCavity(const Vector3& p) const {
    const Level at = level(p.z());
    double f = ellipse(p.x() - at.center.x(), p.y() - at.center.y(), at.half_x, at.half_y);
    f -= options_.widening_mm * (0.75 + 0.5 * noise_(p / 9));
    return smoothIntersection(f, tip_z_ - p.z(), tip_radius_);
}

double RemovedImplant::cavity(const Vector3& p, double outer_mm) const {
    double f = stemCavity(p);
    for (const Defect& defect : defects_)
        f = smoothUnion(f, ellipsoid(p, defect.center, defect.half, Matrix3::Identity()) + 1.2 * noise_(p / 5), 2);
    return std::max(f, outer_mm + kThinnestWall);
}

double RemovedImplant::filling(const Vector3& p) const {
    const double fluid = options_.filling_hu + (options_.filling_hu > -500 ? 8 * noise_(p / 4) : 0);
    if (!(options_.cement_coverage > 0)) return fluid;
    // Patches where the noise is above a level; they thin out toward their borders. At 1 the mantle is whole.
    const double patch = noise_({p.x() / 10 + 50, p.y() / 10, p.z() / 16}) + 0.35 * noise_(p / 4 + Vector3(8, 8, 8));
    const double level = 0.9 - 2.0 * options_.cement_coverage;
    const double thickness = kMantle * smoothStep(level - 0.05, level + 0.25, patch);
    const double depth = -stemCavity(p);
    const double cement = depth < -0.5 ? 0 : smoothStep(thickness + 0.3, thickness - 0.3, depth);
    // Barium sulphate is not evenly mixed.
    const double hu = options_.cement_hu * (1 + 0.1 * noise_(p / 2.2));
    return fluid + cement * (hu - fluid);
}

double RemovedImplant::plug(const Vector3& p) const {
    if (!(options_.cement_coverage > 0)) return 1e3;
    const double middle = tip_z_ - 0.5 * kPlugLength - 1.5;
    return std::abs(p.z() - middle + 1.5 * noise_(p / 5)) - 0.5 * kPlugLength;
}

double RemovedImplant::sclerosis(double distance_mm) const {
    return smoothStep(2.2, 0.4, distance_mm);
}

}  // namespace fluorocut
