#include "core/experiments/corkscrew_clutter.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/base/option_checks.h"
#include "core/geometry/primitives.h"
#include "core/imaging/mesh_projector.h"
#include "core/imaging/standard_views.h"
#include "core/simulation/calibration_objects.h"
#include "core/simulation/femur_phantom.h"

namespace fluorocut {
namespace {

std::string counted(std::size_t count, const std::string& what) {
    return count == 1 ? what : fmt::format("{} {}s", count, what);
}

Rigid3 anyTurn(Random& random) {
    const Eigen::Quaterniond turn(random.normal(), random.normal(), random.normal(), random.normal());
    return {turn.normalized(), Vector3::Zero()};
}

}  // namespace

PathLengths pathsThrough(TriangleMesh mesh) {
    auto projector = std::make_shared<const MeshProjector>(MeshProjector::prepare(std::move(mesh)).value());
    return [projector](const CArm& carm, const Rigid3& imager_from_mesh, const MeshProjectionOptions& how) {
        return projector->project(carm, imager_from_mesh, how);
    };
}

void addScaled(Image& sum, const Image& image, double factor) {
    const float times = static_cast<float>(factor);
    for (std::size_t i = 0; i < sum.size(); ++i)
        sum.pixels()[i] += times * image.pixels()[i];
}

// In front of the imager: the point that pixel `at_px` sees at that depth.
Vector3 placeAt(const CArm& carm, const Vector2& at_px, double depth_mm) {
    return carm.detectorPoint(at_px) * (depth_mm / carm.focal_length_mm);
}

Vector2 anyPixel(const CArm& carm, double share, Random& random) {
    return {carm.columns * (0.5 + 0.5 * share * random.uniform(-1, 1)),
            carm.rows * (0.5 + 0.5 * share * random.uniform(-1, 1))};
}

Result<void> CorkscrewClutter::validate() const {
    return requireRanges({{"clutter.hip", hip, 0, 1, ""},
                          {"clutter.screws", screws, 0, 1, ""},
                          {"clutter.clamp", clamp, 0, 1, ""},
                          {"clutter.spindle", spindle, 0, 1, ""},
                          {"clutter.retractor", retractor, 0, 1, ""}});
}

Result<ClutterStock> ClutterStock::prepare(const CorkscrewClutter& likelihoods, std::uint64_t seed,
                                           Progress& progress) {
    if (const Result<void> good = likelihoods.validate(); !good) return good.error();
    ClutterStock stock;
    stock.likelihoods_ = likelihoods;
    stock.screw_ = pathsThrough(screw("screw", 40, HeldBy::imager, {}).mesh);
    const std::vector<HeldObject> halves = clamp("clamp", HeldBy::imager, {});
    stock.clamp_ = [lower = pathsThrough(halves[0].mesh), upper = pathsThrough(halves[1].mesh)](
                       const CArm& carm, const Rigid3& imager_from_clamp, const MeshProjectionOptions& how) {
        Image sum = lower(carm, imager_from_clamp, how);
        addScaled(sum, upper(carm, imager_from_clamp, how), 1);
        return sum;
    };
    stock.retractor_ = pathsThrough(makeBox({120, 14, 5}));
    if (likelihoods.hip > 0) {
        FemurOptions femur;
        femur.voxel_mm = 1;
        femur.seed = seed;
        progress.report(0, "generating a hip");
        const Result<FemurPhantom> phantom = generateFemur(femur);
        if (!phantom) return phantom.error();
        Result<VolumeProjector> projector = VolumeProjector::prepare(std::make_shared<const Volume>(phantom->ct));
        if (!projector) return projector.error();
        stock.hip_.emplace(std::move(*projector));
        stock.hip_center_ = phantom->landmarks.lesser_trochanter_mm;
    }
    return stock;
}

PlacedClutter ClutterStock::draw(const CArm& carm, const CorkscrewLayout& layout, const Rigid3& pose,
                                 Random& random) const {
    PlacedClutter placed;
    std::vector<std::string> objects;
    const auto happens = [&](double likelihood) { return random.uniform() < likelihood; };
    if (happens(likelihoods_.hip)) {
        const Rigid3 view = standardView(StandardView::ap, hip_center_, 0.65 * carm.focal_length_mm);
        const Vector3 shift(random.uniform(-35, 35), random.uniform(-35, 35), random.uniform(-20, 20));
        const Rigid3 turn = Rigid3::fromRotationVector({0, 0, random.uniform(-0.6, 0.6)}) *
                            Rigid3::fromRotationVector({random.uniform(-0.4, 0.4), random.uniform(-1.2, 1.2), 0});
        const Rigid3 about = Rigid3::fromTranslation({0, 0, 0.65 * carm.focal_length_mm});
        placed.imager_from_hip = Rigid3::fromTranslation(shift) * about * turn * about.inverse() * view;
        objects.push_back("hip");
    }
    if (happens(likelihoods_.screws)) {
        const std::size_t count = 1 + random.below(3);
        for (std::size_t i = 0; i < count; ++i) {
            const Vector3 tip =
                placeAt(carm, anyPixel(carm, 0.8, random), random.uniform(600, 740) / 1000 * carm.focal_length_mm);
            placed.steel.emplace_back(screw_, Rigid3::fromTranslation(tip) * anyTurn(random));
        }
        objects.push_back(counted(count, "screw"));
    }
    if (happens(likelihoods_.clamp)) {
        const Vector3 pin = placeAt(carm, anyPixel(carm, 0.9, random), 0.6 * carm.focal_length_mm);
        const Rigid3 lying = Rigid3::fromRotationVector({random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5), 0}) *
                             Rigid3::fromRotationVector({0, 0, random.uniform(-std::numbers::pi, std::numbers::pi)});
        placed.steel.emplace_back(clamp_, Rigid3::fromTranslation(pin) * lying);
        objects.push_back("clamp");
    }
    if (happens(likelihoods_.spindle)) {
        constexpr double kLengthMm = 120;
        const double radius = random.uniform(6, 8);
        const bool in_line = random.uniform() < 0.5;
        const double angle = random.uniform(-std::numbers::pi, std::numbers::pi);
        const double aside = in_line ? 0 : layout.rod_radius_mm + radius + random.uniform(2, 15);
        const double from_x =
            in_line ? std::max(layout.shaft_x_mm[1], layout.rod_x_mm[1]) : layout.rod_x_mm[0] + random.uniform(-40, 60);
        const Vector3 middle(from_x + 0.5 * kLengthMm, aside * std::cos(angle), aside * std::sin(angle));
        placed.spindle.emplace(
            pathsThrough(makeCylinder(radius, kLengthMm, 96)),
            Rigid3::fromTranslation(middle) * Rigid3::fromRotationVector({0, 0.5 * std::numbers::pi, 0}));
        objects.push_back(in_line ? "spindle in line" : "spindle beside");
    }
    if (happens(likelihoods_.retractor)) {
        // Over a point of the corkscrew's axis, nearer to the source, across it more or less.
        const double x = random.uniform(layout.rod_x_mm[0], layout.rod_x_mm[1]);
        const Vector3 over = pose * Vector3(x, 0, 0);
        const Vector3 along = pose.rotate(Vector3::UnitX());
        const double across = std::atan2(along.y(), along.x()) + 0.5 * std::numbers::pi + random.uniform(-0.6, 0.6);
        placed.steel.emplace_back(retractor_, Rigid3::fromTranslation(0.85 * over) *
                                                  Rigid3::fromRotationVector({0, 0, across}) *
                                                  Rigid3::fromTranslation({random.uniform(-30, 30), 0, 0}));
        objects.push_back("retractor");
    }
    placed.objects = fmt::format("{}", fmt::join(objects, ", "));
    return placed;
}

Image ClutterStock::tissue(const PlacedClutter& placed, const CArm& carm) const {
    return placed.imager_from_hip ? hip_->project(carm, *placed.imager_from_hip) : Image(carm.columns, carm.rows);
}

Image ClutterStock::steelMm(const PlacedClutter& placed, const CArm& carm, const Rigid3& imager_from_corkscrew) const {
    Image sum(carm.columns, carm.rows);
    for (const auto& [paths, imager_from_object] : placed.steel)
        addScaled(sum, paths(carm, imager_from_object, {}), 1);
    if (placed.spindle) {
        const auto& [paths, corkscrew_from_spindle] = *placed.spindle;
        addScaled(sum, paths(carm, imager_from_corkscrew * corkscrew_from_spindle, {}), 1);
    }
    return sum;
}

}  // namespace fluorocut
