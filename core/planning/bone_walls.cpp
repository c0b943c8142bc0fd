#include "core/planning/bone_walls.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "core/base/median.h"
#include "core/base/option_checks.h"
#include "core/base/parallel.h"
#include "core/geometry/primitives.h"
#include "core/image/distance_field.h"
#include "core/planning/bone_section.h"
#include "core/planning/cortex_profile.h"

namespace fluorocut {
namespace {

constexpr double kBeyondEnds = 40;  // mm by which the ends are continued
constexpr double kStepMm = 0.2;     // along a ray
constexpr double kThickMm = 3;      // a cortex whose middle shows its own density
constexpr double kOutlierMm = 1;    // from the median of its neighbours

struct Grid {
    std::size_t levels, rays;
    std::vector<double> value;  // NaN: not found

    double& operator()(std::size_t level, std::size_t ray) { return value[level * rays + ray]; }
    // Ends repeat themselves, rays close a circle.
    double at(long level, long ray) const {
        const long n = static_cast<long>(rays);
        const auto l = static_cast<std::size_t>(std::clamp(level, 0L, static_cast<long>(levels) - 1));
        return value[l * rays + static_cast<std::size_t>(((ray % n) + n) % n)];
    }
};

// What contradicts its neighbours, or is missing, becomes their median. How many.
std::size_t mend(Grid& grid) {
    Grid before = grid;
    std::size_t replaced = 0;
    for (std::size_t l = 0; l < grid.levels; ++l)
        for (std::size_t r = 0; r < grid.rays; ++r) {
            std::vector<double> around;
            for (long dl = -2; dl <= 2; ++dl)
                for (long dr = -3; dr <= 3; ++dr)
                    if (const double w = before.at(static_cast<long>(l) + dl, static_cast<long>(r) + dr);
                        std::isfinite(w))
                        around.push_back(w);
            const double middle = median(std::move(around));
            if (std::abs(grid(l, r) - middle) <= kOutlierMm) continue;
            grid(l, r) = middle;
            ++replaced;
        }
    return replaced;
}

// Binomial weights over three levels and three rays.
void smooth(Grid& grid) {
    const Grid before = grid;
    for (std::size_t l = 0; l < grid.levels; ++l)
        for (std::size_t r = 0; r < grid.rays; ++r) {
            double sum = 0;
            for (long dl = -1; dl <= 1; ++dl)
                for (long dr = -1; dr <= 1; ++dr)
                    sum += (dl == 0 ? 0.5 : 0.25) * (dr == 0 ? 0.5 : 0.25) *
                           before.at(static_cast<long>(l) + dl, static_cast<long>(r) + dr);
            grid(l, r) = sum;
        }
}

double percentile(std::vector<double> values, double part) {
    if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

// Where a ray from `start` leaves the solid for good: a gap of less than 1.5 mm is a crack.
double exitOf(const BoneSection& section, const Vector2& start, const Vector2& direction, double reach) {
    double last = 0;
    for (double r = 0; r < reach && r - last < 1.5; r += 0.5 * section.pixel_mm)
        if (section.covers(start + r * direction)) last = r;
    return last;
}

TriangleMesh skinOf(const BoneWalls& walls, bool outer) {
    std::vector<std::vector<Vector3>> rings;
    const auto add = [&](const WallLevel& level, double shift) {
        rings.emplace_back();
        for (std::size_t ray = 0; ray < level.outer_mm.size(); ++ray)
            rings.back().push_back((outer ? walls.outerPoint(level, ray) : walls.canalPoint(level, ray)) +
                                   shift * walls.axis.direction());
    };
    add(walls.levels.front(), -kBeyondEnds);
    for (const WallLevel& level : walls.levels)
        add(level, 0);
    add(walls.levels.back(), kBeyondEnds);
    return makeSkin(rings);
}

// Along u, v and the axis.
VolumeGrid fieldGrid(const BoneWalls& walls, double spacing) {
    VolumeGrid grid;
    grid.direction.col(0) = walls.u;
    grid.direction.col(1) = walls.v;
    grid.direction.col(2) = walls.axis.direction();
    grid.spacing_mm = Vector3::Constant(spacing);
    Vector3 low = Vector3::Constant(std::numeric_limits<double>::infinity()), high = -low;
    for (const WallLevel& level : walls.levels)
        for (std::size_t ray = 0; ray < level.outer_mm.size(); ++ray) {
            const Vector3 p = grid.direction.transpose() * walls.outerPoint(level, ray);
            low = low.cwiseMin(p);
            high = high.cwiseMax(p);
        }
    low -= Vector3::Constant(4);
    high += Vector3::Constant(4);
    for (int axis = 0; axis < 3; ++axis)
        grid.size[static_cast<std::size_t>(axis)] = 1 + static_cast<int>(std::ceil((high[axis] - low[axis]) / spacing));
    grid.origin_mm = grid.direction * low;
    return grid;
}

}  // namespace

Result<void> BoneWallOptions::validate() const {
    if (auto good = requireRanges({{"level_step_mm", level_step_mm, 0.5, 10, "mm"},
                                   {"rays", static_cast<double>(rays), 16, 720, ""},
                                   {"reach_mm", reach_mm, 15, 100, "mm"},
                                   {"near_mm", near_mm, 0, 50, "mm"},
                                   {"field_spacing_mm", field_spacing_mm, 0.3, 3, "mm"}});
        !good)
        return good;
    return cortical_hu ? requireRange("cortical_hu", *cortical_hu, 500, 3000, "HU") : Result<void>();
}

Vector3 BoneWalls::rayDirection(std::size_t ray) const {
    const double angle =
        2 * std::numbers::pi * static_cast<double>(ray) / static_cast<double>(levels.front().outer_mm.size());
    return std::cos(angle) * u + std::sin(angle) * v;
}

Vector3 BoneWalls::canalCenter(const WallLevel& level) const {
    // The centroid of the polygon, as triangles about the rays' start.
    Vector3 sum = Vector3::Zero();
    double weight = 0;
    const std::size_t n = level.canal_mm.size();
    for (std::size_t ray = 0; ray < n; ++ray) {
        const Vector3 a = canalPoint(level, ray) - level.center, b = canalPoint(level, (ray + 1) % n) - level.center;
        const double area = a.cross(b).dot(axis.direction());
        sum += area * (a + b) / 3;
        weight += area;
    }
    return level.center + sum / weight;
}

Result<BoneWalls> findBoneWalls(const Volume& ct, const AxisLine& axis, const BoneWallOptions& options,
                                Progress& progress) {
    constexpr const char* kStep = "finding the bone's walls";
    if (auto good = options.validate(); !good) return good.error();
    const double length = (axis.proximal - axis.distal).norm();
    if (!(length >= 10 && length <= 600))
        return invalidOption("axis", fmt::format("two points {:.3g} mm apart", length), "10 to 600 mm");

    BoneWalls walls;
    walls.axis = axis;
    const Vector3 w = axis.direction();
    // u near the patient's left, or whatever lies most across.
    const Vector3 across = std::abs(w.x()) < 0.9 ? Vector3::UnitX() : Vector3::UnitY();
    walls.u = (across - across.dot(w) * w).normalized();
    walls.v = w.cross(walls.u);

    // Where the bone is, from the far end upward: each level looks near the last one's marrow.
    const double pixel = std::clamp(ct.grid().spacing_mm.minCoeff(), 0.4, 1.0);
    const auto rays = static_cast<std::size_t>(options.rays);
    const auto count = static_cast<std::size_t>(std::floor(length / options.level_step_mm)) + 1;
    std::vector<BoneSection> sections;
    Vector2 place = Vector2::Zero();
    SectionThresholds thresholds;
    if (options.cortical_hu) thresholds.marrow_hu = 0.5 * *options.cortical_hu;
    for (std::size_t l = 0; l < count; ++l) {
        if (progress.isCancelled()) return cancelled(kStep);
        progress.report(0.3 * static_cast<double>(l) / static_cast<double>(count), kStep);
        WallLevel level;
        level.along_mm = static_cast<double>(l) * options.level_step_mm;
        const SectionPlane plane{axis.distal + level.along_mm * w, walls.u, walls.v};
        auto section = boneSection(ct, plane, options.reach_mm, pixel, place, l == 0 ? options.near_mm : 5, thresholds);
        if (!section) {
            const Vector3 p = plane.at(place);
            return noSolution(fmt::format("bone at {:.1f}, {:.1f}, {:.1f} mm", p.x(), p.y(), p.z()),
                              section ? fmt::format("bone that goes on beyond {:g} mm from the axis", options.reach_mm)
                                      : "no marrow inside a closed cortex",
                              "a section of the femur's shaft across the axis",
                              "give an axis inside the canal, ending below the neck and above the CT's end");
        }
        place = section->marrow_mm;
        level.center = plane.at(place);
        level.outer_mm.resize(rays);
        level.canal_mm.resize(rays);
        walls.levels.push_back(std::move(level));
        sections.push_back(std::move(*section));
    }

    // Profiles. What their walls are follows in two passes, since the second needs the whole bone's density and blur.
    std::vector<CortexProfile> profiles(count * rays);
    for (std::size_t l = 0; l < count; ++l) {
        if (progress.isCancelled()) return cancelled(kStep);
        const WallLevel& level = walls.levels[l];
        parallelFor(rays, 8, [&](std::size_t begin, std::size_t end) {
            for (std::size_t ray = begin; ray < end; ++ray) {
                const Vector3 d = walls.rayDirection(ray);
                const Vector3 start = level.center - (axis.distal + level.along_mm * w);
                const double exit = exitOf(sections[l], {start.dot(walls.u), start.dot(walls.v)},
                                           {d.dot(walls.u), d.dot(walls.v)}, options.reach_mm);
                CortexProfile& profile = profiles[l * rays + ray];
                profile.step_mm = kStepMm;
                profile.exit_mm = exit;
                for (double r = 0; r < exit + 5; r += kStepMm)
                    profile.hounsfield.push_back(
                        sampleLinear(ct, ct.grid().indexFromPoint(level.center + r * d), kAirHounsfield));
            }
        });
    }
    std::vector<double> peaks, plateaus, blurs;
    for (const CortexProfile& profile : profiles)
        peaks.push_back(profile.peak());
    const double first_guess = options.cortical_hu.value_or(percentile(peaks, 0.6));
    for (const CortexProfile& profile : profiles)
        if (const auto thick = profile.plateau(0.5 * first_guess, kThickMm)) {
            plateaus.push_back(thick->hounsfield);
            blurs.push_back(thick->blur_mm);
        }
    // Density as the shaft's thick cortex shows it; without one the highest peaks come nearest.
    walls.cortical_hu = options.cortical_hu.value_or(plateaus.size() >= 50 ? median(plateaus) : percentile(peaks, 0.9));
    walls.blur_mm = blurs.size() >= 50 ? std::clamp(median(blurs), 0.1, 2.0) : 0.5 * ct.grid().spacing_mm.mean();
    if (!options.cortical_hu && plateaus.size() < 50)
        walls.warnings.push_back(
            "no cortex thicker than 3 mm: its density is a guess, thin walls may be off by a third");

    Grid outer{count, rays, std::vector<double>(count * rays)}, canal = outer;
    for (std::size_t l = 0; l < count; ++l) {
        if (progress.isCancelled()) return cancelled(kStep);
        progress.report(0.3 + 0.3 * static_cast<double>(l) / static_cast<double>(count), kStep);
        parallelFor(rays, 8, [&](std::size_t begin, std::size_t end) {
            for (std::size_t ray = begin; ray < end; ++ray) {
                const CortexWalls found =
                    cortexWalls(profiles[l * rays + ray], walls.cortical_hu, walls.blur_mm, !options.half_maximum);
                // Into the neck a ray may find no end: the wall lies beyond its reach.
                const bool endless = profiles[l * rays + ray].exit_mm > options.reach_mm - 1;
                canal(l, ray) = endless ? std::min(found.inner_mm, options.reach_mm - 1) : found.inner_mm;
                outer(l, ray) = endless ? options.reach_mm : found.outer_mm;
            }
        });
    }
    walls.replaced = static_cast<double>(mend(outer) + mend(canal)) / static_cast<double>(2 * count * rays);
    smooth(outer);
    smooth(canal);
    for (std::size_t l = 0; l < count; ++l)
        for (std::size_t ray = 0; ray < rays; ++ray) {
            if (!(canal(l, ray) > 0.5 && outer(l, ray) > 0))
                return noSolution(
                    fmt::format("canal {:.0f} mm above the axis's distal point", walls.levels[l].along_mm), "no wall",
                    "a canal at least 1 mm wide");
            walls.levels[l].outer_mm[ray] = outer(l, ray);
            walls.levels[l].canal_mm[ray] = std::min(canal(l, ray), outer(l, ray) - 0.1);
        }
    if (walls.replaced > 0.15)
        walls.warnings.push_back(fmt::format("{:.0f} % of the walls were taken from their neighbours: look at the CT",
                                             100 * walls.replaced));

    walls.outer = skinOf(walls, true);
    walls.canal = skinOf(walls, false);
    const VolumeGrid grid = fieldGrid(walls, options.field_spacing_mm);
    SubProgress outer_progress(progress, 0.6, 0.8), canal_progress(progress, 0.8, 1);
    Result<Volume> outer_field =
        distanceField(walls.outer, grid, FieldBand(kOuterDepthMm, kWallBandMm), outer_progress, "outer wall");
    if (!outer_field) return outer_field.error();
    Result<Volume> canal_field = distanceField(walls.canal, grid, FieldBand(kWallBandMm), canal_progress, "canal");
    if (!canal_field) return canal_field.error();
    walls.outer_field = std::move(*outer_field);
    walls.canal_field = std::move(*canal_field);
    return walls;
}

}  // namespace fluorocut
