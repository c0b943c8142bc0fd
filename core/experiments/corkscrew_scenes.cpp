#include "core/experiments/corkscrew_scenes.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "core/base/median.h"
#include "core/base/option_checks.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/imaging/xray_physics.h"
#include "core/simulation/closed_form_projection.h"
#include "core/simulation/corkscrew_objects.h"

namespace fluorocut {
namespace {

constexpr int kSamples = 3;  // per pixel and axis, through the corkscrew
// Wires within 1 um (their facets) of the round shape, at a fifth of the time of the finest.
constexpr CorkscrewFineness kFineness{256, 96, 32, 5, 4};
constexpr double kFullScale = 65535;

enum class Stream : std::uint64_t { imagers, pose, clutter, exposure, dimensions };

Random streamOf(std::uint64_t seed, Stream stream) {
    return Random(seed).fork(static_cast<std::uint64_t>(stream));
}

// What absorbs along a ray: per mm of path through a part.
struct Part {
    PathLengths path_lengths;
    double mu_per_mm = 0;
};

// The C-arm with factor x factor pixels in each of its own: the inverse of CArm::binned.
CArm divided(CArm carm, int factor) {
    carm.columns *= factor;
    carm.rows *= factor;
    carm.pixel_mm /= factor;
    carm.principal_point_px = factor * carm.principal_point_px + Vector2::Constant(0.5 * (factor - 1));
    return carm;
}

// The part of the picture that the corkscrew may be seen in; empty when it is not.
std::optional<CArm> windowAround(const CorkscrewLayout& layout, const CArm& carm, const Rigid3& imager_from_corkscrew,
                                 Eigen::Vector2i& corner) {
    Vector2 low = Vector2::Constant(1e9), high = -low;
    const auto include = [&](double x, double radius) {
        for (int i = 0; i < 24; ++i) {
            const double a = 2 * std::numbers::pi * i / 24;
            const Vector2 at =
                carm.project(imager_from_corkscrew * Vector3(x, radius * std::cos(a), radius * std::sin(a)));
            low = low.cwiseMin(at);
            high = high.cwiseMax(at);
        }
    };
    for (int i = 0; i <= 8; ++i)  // also along it: distorted edges bulge
        include(layout.rod_x_mm[0] + (layout.rod_x_mm[1] - layout.rod_x_mm[0]) * i / 8, 1.01 * layout.rod_radius_mm);
    for (const double x : layout.shaft_x_mm)
        include(x, layout.shaft_radius_mm);
    constexpr double kMargin = 3;
    const Vector2 last(carm.columns - 1, carm.rows - 1);
    const Vector2 first = (low.array() - kMargin).floor().max(0).matrix();
    const Vector2 end = (high.array() + kMargin).ceil().min(last.array()).matrix();
    if (!(first.array() < end.array()).all()) return std::nullopt;
    corner = first.cast<int>();
    const Eigen::Vector2i size = end.cast<int>() - corner;
    return carm.cropped(corner.x(), corner.y(), size.x() + 1, size.y() + 1);
}

}  // namespace

Result<void> CorkscrewSceneOptions::validate() const {
    if (const Result<void> good = layout.validate(); !good) return good;
    if (const Result<void> good = imager.validate(); !good) return good;
    if (carm) {
        if (const Result<void> good = carm->validate(); !good) return good;
    }
    const double focal_length_mm = carm ? carm->focal_length_mm : imager.focal_length_mm;
    if (beads) {
        if (const Result<void> good = beads->validate(); !good) return good;
        for (const Bead& bead : beads->beads) {
            const double depth_mm = (imager_from_beads * bead.center_mm).z();
            if (depth_mm > bead.diameter_mm && depth_mm < focal_length_mm) continue;
            return invalidOption("imager_from_beads",
                                 fmt::format("bead {} {:.4g} mm in front of the source", bead.name, depth_mm),
                                 fmt::format("all beads between source and detector (0 to {:g} mm)", focal_length_mm));
        }
    }
    if (const Result<void> good = clutter.validate(); !good) return good;
    return requireRanges({{"imagers", static_cast<double>(imagers), 1, 1000, ""},
                          {"most_roll_rad", most_roll_rad, 0, 1.5, "rad"},
                          {"most_pitch_rad", most_pitch_rad, 0, std::numbers::pi, "rad"},
                          {"least_depth_mm", least_depth_mm, 50, focal_length_mm, "mm"},
                          {"most_depth_mm", most_depth_mm, least_depth_mm, focal_length_mm, "mm"},
                          {"least_visible", least_visible, 0, 1, ""},
                          {"most_covered", most_covered, 0, 1, ""},
                          {"photons", photons, 1, 1e7, ""},
                          {"blur_px", blur_px, 0, 20, "px"},
                          {"inverted", inverted, 0, 1, ""},
                          {"dimension_error", dimension_error, 0, 1, "mm"}});
}

double shareOfWires(const CorkscrewLayout& layout, const CArm& carm, const Rigid3& imager_from_corkscrew,
                    const std::function<bool(const Vector2&)>& sees, double least) {
    constexpr double kStepMm = 0.5;
    double all = layout.helix.length_mm(), missed = 0;
    for (const CorkscrewRing& ring : layout.rings)
        all += 2 * std::numbers::pi * ring.radius_mm;
    // False as soon as too much is missed.
    const auto walk = [&](double length_mm, const auto& point) {
        const int steps = std::max(1, static_cast<int>(std::lround(length_mm / kStepMm)));
        for (int i = 0; i < steps && missed <= (1 - least) * all; ++i) {
            if (!sees(carm.project(imager_from_corkscrew * point((i + 0.5) / steps)))) missed += length_mm / steps;
        }
    };
    const auto walkRing = [&](const CorkscrewRing& ring) {
        walk(2 * std::numbers::pi * ring.radius_mm, [&](double t) { return ring.point(2 * std::numbers::pi * t); });
    };
    walkRing(layout.rings.back());  // ends first: they leave the picture before the middle does
    for (std::size_t i = 0; i + 1 < layout.rings.size(); ++i)
        walkRing(layout.rings[i]);
    walk(layout.helix.length_mm(), [&](double t) { return layout.helix.point(t); });
    return std::max(0.0, 1 - missed / all);
}

struct CorkscrewScenes::Shared {
    CorkscrewSceneOptions options;
    std::vector<SimulatedImager> imagers;
    std::vector<Part> corkscrew;
    ClutterStock stock;

    // What lies in one picture beside the corkscrew.
    struct Setting {
        std::size_t imager = 0;
        Rigid3 imager_from_corkscrew;  // as drawn, in the true imager's frame
        PlacedClutter clutter;
        bool inverted = false;
    };
    // About this pose (in the true imager's frame), or about one that is drawn.
    Result<Setting> draw(std::uint64_t index, const std::optional<Rigid3>& imager_from_corkscrew = {}) const;
    Result<Rigid3> drawPose(const SimulatedImager& imager, Random random) const;
    Result<CorkscrewScene> picture(std::uint64_t index, const Setting& setting, const Rigid3& imager_from_corkscrew,
                                   std::uint64_t exposure) const;
    Image steelMm(const Setting& setting, const Rigid3& imager_from_corkscrew) const;
    double covered(const Setting& setting, const Rigid3& imager_from_corkscrew, const Image& steel_mm) const;
    void addCorkscrew(Image& line_integrals, const CArm& carm, const Rigid3& imager_from_corkscrew) const;
    CorkscrewLayout measuredLayout(std::uint64_t index) const;

    std::size_t imagerOf(std::uint64_t index) const { return static_cast<std::size_t>(index % imagers.size()); }
    // A pose from outside, in the true imager's frame.
    Result<Rigid3> checked(std::size_t imager, const Rigid3& known_imager_from_corkscrew) const;
};

Result<Rigid3> CorkscrewScenes::Shared::checked(std::size_t imager, const Rigid3& known_imager_from_corkscrew) const {
    const Rigid3 pose = imagers[imager].known_from_true.inverse() * known_imager_from_corkscrew;
    const double middle = pose.translation().z(), focal_length_mm = imagers[imager].truth.focal_length_mm;
    double reach_mm = 0;
    for (const double x : {options.layout.rod_x_mm[0], options.layout.rod_x_mm[1], options.layout.shaft_x_mm[0],
                           options.layout.shaft_x_mm[1]}) {
        reach_mm = std::max(reach_mm, std::hypot(x, options.layout.rod_radius_mm));
    }
    if (middle - reach_mm > 0 && middle + reach_mm < focal_length_mm) return pose;
    return invalidOption(
        "pose", fmt::format("a corkscrew of {:.0f} mm, {:.4g} mm in front of the source", 2 * reach_mm, middle),
        fmt::format("all of it between source and detector (0 to {:g} mm)", focal_length_mm));
}

// In the true imager's frame.
Result<Rigid3> CorkscrewScenes::Shared::drawPose(const SimulatedImager& imager, Random random) const {
    constexpr int kTries = 20000;
    for (int i = 0; i < kTries; ++i) {
        const double twist = random.uniform(-std::numbers::pi, std::numbers::pi);
        const double roll = random.uniform(-options.most_roll_rad, options.most_roll_rad);
        const double pitch = random.uniform(-options.most_pitch_rad, options.most_pitch_rad);
        const double depth = random.uniform(options.least_depth_mm, options.most_depth_mm);
        const Vector3 place = placeAt(imager.truth, anyPixel(imager.truth, 1, random), depth);
        const Rigid3 pose = Rigid3::fromTranslation(place) * Rigid3::fromTwistRollPitch(twist, roll, pitch);
        const double seen = shareOfWires(
            options.layout, imager.truth, pose, [&](const Vector2& pixel) { return imager.lit(pixel); },
            options.least_visible);
        if (seen >= options.least_visible) return pose;
    }
    return noSolution(
        "corkscrew scene",
        fmt::format("none of {} poses has {:.0f} % of the wires in the picture", kTries, 100 * options.least_visible),
        "poses that fit into the field", "allow a smaller least_visible or a greater depth");
}

Result<CorkscrewScenes::Shared::Setting> CorkscrewScenes::Shared::draw(
    std::uint64_t index, const std::optional<Rigid3>& imager_from_corkscrew) const {
    Setting setting;
    setting.imager = imagerOf(index);
    const SimulatedImager& imager = imagers[setting.imager];
    const Result<Rigid3> pose = imager_from_corkscrew
                                    ? *imager_from_corkscrew
                                    : drawPose(imager, streamOf(options.seed, Stream::pose).fork(index));
    if (!pose) return pose.error();
    setting.imager_from_corkscrew = *pose;

    for (std::uint64_t attempt = 0; attempt < 50; ++attempt) {
        Random random = streamOf(options.seed, Stream::clutter).fork(index).fork(attempt);
        setting.clutter = stock.draw(imager.truth, options.layout, *pose, random);
        setting.inverted = random.uniform() < options.inverted;
        if (covered(setting, *pose, steelMm(setting, *pose)) <= options.most_covered) return setting;
    }
    return noSolution("corkscrew scene", "clutter over the corkscrew in 50 draws",
                      fmt::format("at most {:.0f} % of the wires covered", 100 * options.most_covered),
                      "allow a larger most_covered or less clutter");
}

// Path lengths through steel, of the beads too.
Image CorkscrewScenes::Shared::steelMm(const Setting& setting, const Rigid3& imager_from_corkscrew) const {
    const SimulatedImager& imager = imagers[setting.imager];
    Image steel_mm = stock.steelMm(setting.clutter, imager.truth, imager_from_corkscrew);
    if (options.beads) {
        addScaled(steel_mm,
                  spherePathLengths(*options.beads, imager.truth,
                                    imager.known_from_true.inverse() * options.imager_from_beads),
                  1);
    }
    return steel_mm;
}

// Share of the wires' visible length.
double CorkscrewScenes::Shared::covered(const Setting& setting, const Rigid3& imager_from_corkscrew,
                                        const Image& steel_mm) const {
    const SimulatedImager& imager = imagers[setting.imager];
    const double opaque_mm = std::log(10.0) / attenuationPerMm(Material::steel);
    const auto share = [&](double from_mm) {
        return shareOfWires(options.layout, imager.truth, imager_from_corkscrew, [&](const Vector2& pixel) {
            return imager.lit(pixel) && steel_mm(static_cast<int>(std::lround(pixel.x())),
                                                 static_cast<int>(std::lround(pixel.y()))) >= from_mm;
        });
    };
    const double visible = share(0);
    return visible > 0 ? share(opaque_mm) / visible : 0;
}

// The mean transmission of a pixel's rays, as a line integral.
void CorkscrewScenes::Shared::addCorkscrew(Image& line_integrals, const CArm& carm,
                                           const Rigid3& imager_from_corkscrew) const {
    Eigen::Vector2i corner;
    const std::optional<CArm> window = windowAround(options.layout, carm, imager_from_corkscrew, corner);
    if (!window) return;
    const CArm fine = divided(*window, kSamples);
    Image t(fine.columns, fine.rows);
    for (const Part& part : corkscrew)
        addScaled(t, part.path_lengths(fine, imager_from_corkscrew, {}), part.mu_per_mm);
    const auto rows = static_cast<std::size_t>(window->rows);
    parallelFor(rows, 16, [&](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            float* const out = line_integrals.row(y + corner.y()) + corner.x();
            for (int x = 0; x < window->columns; ++x) {
                float through = 0;
                for (int j = 0; j < kSamples; ++j) {
                    const float* const from = t.row(kSamples * y + j) + kSamples * x;
                    for (int i = 0; i < kSamples; ++i)
                        through += std::exp(-from[i]);
                }
                out[x] -= std::log(through / static_cast<float>(kSamples * kSamples));
            }
        }
    });
}

CorkscrewLayout CorkscrewScenes::Shared::measuredLayout(std::uint64_t index) const {
    CorkscrewLayout layout = options.layout;
    if (options.dimension_error == 0) return layout;
    Random random = streamOf(options.seed, Stream::dimensions).fork(index);
    const auto wrong = [&](double& value) { value += options.dimension_error * random.normal(); };
    for (CorkscrewRing& ring : layout.rings) {
        wrong(ring.x_mm);
        wrong(ring.radius_mm);
    }
    wrong(layout.helix.x_start_mm);
    wrong(layout.helix.x_end_mm);
    wrong(layout.helix.radius_mm);
    layout.helix.phase_rad += options.dimension_error / layout.helix.radius_mm * random.normal();
    for (CorkscrewBead& bead : layout.beads)
        for (double& value : bead.center_mm)
            wrong(value);
    return layout;
}

Result<CorkscrewScene> CorkscrewScenes::Shared::picture(std::uint64_t index, const Setting& setting,
                                                        const Rigid3& imager_from_corkscrew,
                                                        std::uint64_t exposure) const {
    const SimulatedImager& imager = imagers[setting.imager];
    const CArm& carm = imager.truth;
    const Image steel_mm = steelMm(setting, imager_from_corkscrew);
    Image line_integrals = stock.tissue(setting.clutter, carm);
    addScaled(line_integrals, steel_mm, attenuationPerMm(Material::steel));
    // Automatic brightness, set without the corkscrew: pictures of one setting have one dose.
    std::vector<double> lit;
    for (int y = 0; y < line_integrals.height(); y += 4)
        for (int x = 0; x < line_integrals.width(); x += 4)
            if (imager.lit(Vector2(x, y))) lit.push_back(line_integrals(x, y));
    const double middling = median(lit);
    const double thinnest = *std::min_element(lit.begin(), lit.end());
    addCorkscrew(line_integrals, carm, imager_from_corkscrew);

    XrayOptions xray;
    xray.photons_per_pixel = options.photons * std::exp(middling);
    xray.detector_blur_px = options.blur_px;
    xray.object_depth_mm = imager_from_corkscrew.translation().z();
    if (std::isfinite(imager.lit_radius_mm)) xray.field_radius_mm = imager.lit_radius_mm;
    xray.bits = 16;
    const double brightest = 1.3 * xray.photons_per_pixel * std::exp(-thinnest);
    xray.gain = kFullScale / (brightest + 6 * std::sqrt(brightest) + 50);
    xray.seed = streamOf(options.seed, Stream::exposure).fork(index).fork(exposure).bits();
    Result<Exposure> exposed = expose(line_integrals, carm, xray);
    if (!exposed) return exposed.error();

    CorkscrewScene scene;
    scene.image = std::move(exposed->image);
    if (setting.inverted)
        for (float& level : scene.image.pixels())
            level = static_cast<float>(kFullScale) - level;
    scene.carm = imager.known;
    scene.layout = measuredLayout(index);
    scene.imager_from_corkscrew = imager.known_from_true * imager_from_corkscrew;
    scene.visible = shareOfWires(options.layout, carm, imager_from_corkscrew,
                                 [&](const Vector2& pixel) { return imager.lit(pixel); });
    scene.covered = covered(setting, imager_from_corkscrew, steel_mm);
    scene.inverted = setting.inverted;
    scene.imager = setting.imager;
    scene.map_error_mm = imager.map_error_mm;
    scene.objects = setting.clutter.objects;
    return scene;
}

Result<CorkscrewScenes> CorkscrewScenes::prepare(const CorkscrewSceneOptions& options, Progress& progress) {
    if (const Result<void> good = options.validate(); !good) return good.error();
    auto shared = std::make_unique<Shared>();
    shared->options = options;
    const SimulatedImagerOptions& how = options.imager;
    if (options.carm) shared->imagers.push_back({*options.carm, *options.carm, {}});
    const bool differ = how.bent || how.focal_length_error > 0 || how.principal_point_error_mm > 0;
    const int count = options.carm ? 0 : differ ? options.imagers : 1;
    for (int i = 0; i < count; ++i) {
        if (progress.isCancelled()) return cancelled("corkscrew scenes");
        progress.report(0.9 * i / count, "calibrating imagers");
        Random random = streamOf(options.seed, Stream::imagers).fork(static_cast<std::uint64_t>(i));
        Result<SimulatedImager> imager = simulateImager(how, random);
        if (!imager) return imager.error();
        shared->imagers.push_back(std::move(*imager));
    }
    Result<std::vector<HeldObject>> parts = heldCorkscrew("corkscrew", options.layout, HeldBy::robot, {}, kFineness);
    if (!parts) return parts.error();
    for (HeldObject& part : *parts) {
        const double displaced = part.displaces ? attenuationPerMm(*part.displaces) : 0;
        shared->corkscrew.push_back({part.path_lengths ? part.path_lengths : pathsThrough(std::move(part.mesh)),
                                     attenuationPerMm(part.material) - displaced});
    }
    SubProgress stocking(progress, 0.9, 1);
    Result<ClutterStock> stock = ClutterStock::prepare(options.clutter, options.seed, stocking);
    if (!stock) return stock.error();
    shared->stock = std::move(*stock);
    progress.report(1, "scenes prepared");
    return CorkscrewScenes(std::move(shared));
}

Result<CorkscrewScene> CorkscrewScenes::scene(std::uint64_t index) const {
    const Result<Shared::Setting> setting = shared_->draw(index);
    if (!setting) return setting.error();
    return shared_->picture(index, *setting, setting->imager_from_corkscrew, 0);
}

Result<CorkscrewScene> CorkscrewScenes::sceneAt(std::uint64_t index, const Rigid3& imager_from_corkscrew) const {
    const Result<Rigid3> pose = shared_->checked(shared_->imagerOf(index), imager_from_corkscrew);
    if (!pose) return pose.error();
    const Result<Shared::Setting> setting = shared_->draw(index, *pose);
    if (!setting) return setting.error();
    return shared_->picture(index, *setting, *pose, 0);
}

Result<CorkscrewScene> CorkscrewScenes::sceneWith(std::uint64_t index, const Rigid3& imager_from_corkscrew,
                                                  std::uint64_t exposure) const {
    const Result<Rigid3> pose = shared_->checked(shared_->imagerOf(index), imager_from_corkscrew);
    if (!pose) return pose.error();
    const Result<Shared::Setting> setting = shared_->draw(index);
    if (!setting) return setting.error();
    return shared_->picture(index, *setting, *pose, exposure);
}

CorkscrewScenes::CorkscrewScenes(std::unique_ptr<const Shared> shared) : shared_(std::move(shared)) {}
CorkscrewScenes::CorkscrewScenes(CorkscrewScenes&&) noexcept = default;
CorkscrewScenes& CorkscrewScenes::operator=(CorkscrewScenes&&) noexcept = default;
CorkscrewScenes::~CorkscrewScenes() = default;

}  // namespace fluorocut
