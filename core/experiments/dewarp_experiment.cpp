#include "core/experiments/dewarp_experiment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include <fmt/format.h>

#include "core/base/median.h"
#include "core/base/option_checks.h"
#include "core/base/random.h"
#include "core/base/stopwatch.h"
#include "core/base/units.h"
#include "core/distortion/bead_test.h"
#include "core/distortion/distortion_map.h"
#include "core/distortion/groove_detection.h"
#include "core/experiments/simulated_imager.h"
#include "core/fiducial/bead_detection.h"
#include "core/simulation/calibration_objects.h"
#include "core/simulation/truth.h"

namespace fluorocut {
namespace {

constexpr double kCentreHalfMm = 60;  // the paper's centre: about 120 x 120 mm

// One trial's scene, as the options ask for and the dice fall.
struct Scene {
    OperatingRoomOptions room;
    CArmPosition position;
    GroovedPlate plate;
    PlatePlacement placement;
    std::vector<HeldObject> overlay;
    double photons = 0;
};

// An object held by the imager at a place in its detector's frame, turned about the beam.
Rigid3 beforeDetector(const Vector2& place_mm, double depth_mm, double turn_rad) {
    return Rigid3::fromTranslation({place_mm.x(), place_mm.y(), -depth_mm}) *
           Rigid3::fromRotationVector({0, 0, turn_rad});
}

std::vector<HeldObject> drawOverlay(Random& random, double half_field_mm) {
    LimbOptions limb;
    const double turn = random.uniform(-0.35, 0.35);  // it lies along the table, more or less
    limb.axis_in_room = Vector3(std::sin(turn), 0, std::cos(turn));
    limb.middle_in_room = Vector3(random.uniform(-20, 20), random.uniform(-20, 20), random.uniform(-20, 20));
    std::vector<HeldObject> overlay = heldLimb(limb).value();
    const Vector2 at(random.uniform(-0.4, 0.4) * half_field_mm, random.uniform(-0.4, 0.4) * half_field_mm);
    for (HeldObject& part : clamp("clamp", HeldBy::imager,
                                  beforeDetector(at, random.uniform(40, 120), random.uniform(0, 2 * std::numbers::pi))))
        overlay.push_back(std::move(part));
    for (int i = 0; i < 3; ++i) {
        const Vector2 tip(random.uniform(-0.7, 0.7) * half_field_mm, random.uniform(-0.7, 0.7) * half_field_mm);
        const Rigid3 lying = Rigid3::fromRotationVector({0.5 * std::numbers::pi - random.uniform(0, 0.5), 0, 0});
        overlay.push_back(
            screw(fmt::format("screw {}", i), 35, HeldBy::imager,
                  beforeDetector(tip, random.uniform(100, 300), random.uniform(0, 2 * std::numbers::pi)) * lying));
    }
    return overlay;
}

Scene drawScene(const DewarpExperimentOptions& options, Random& random) {
    Scene scene;
    CArm& carm = scene.room.nominal_carm;
    carm.columns = carm.rows = options.size_px;
    carm.pixel_mm = Vector2::Constant(options.pixel_mm);
    carm.principal_point_px = Vector2::Constant(0.5 * (options.size_px - 1));
    const double half_field_mm = 0.5 * options.size_px * options.pixel_mm;
    scene.room.intensifier.field_radius_mm = half_field_mm;
    scene.room.xray.field_radius_mm = 0.98 * half_field_mm;
    scene.room.xray.bits = 16;
    scene.room.samples_per_axis = 3;
    scene.room.seed = random.bits();
    scene.position.orbital_rad = random.uniform(-0.6, 1.8);
    scene.position.angulation_rad = random.uniform(-0.5, 0.5);
    const double contrast = random.uniform(options.least_contrast, options.most_contrast);
    scene.plate.groove_depth_mm *= contrast / scene.plate.grooveContrast();
    scene.placement.shift_mm = Vector2(random.uniform(-4, 4), random.uniform(-4, 4));
    scene.placement.rotation_rad = random.uniform(-std::numbers::pi, std::numbers::pi);
    scene.placement.mirrored = random.uniform() < 0.5;
    scene.photons = random.uniform(options.least_photons, options.most_photons);
    if (options.objects) scene.overlay = drawOverlay(random, half_field_mm);
    return scene;
}

struct Pictures {
    Image plate;
    Image beads;
    double bead_height_mm = 0;
    CArm true_carm;  // that of the first picture; the second was taken from the same place
};

Result<void> holdAll(VirtualOperatingRoom& room, const std::vector<HeldObject>& objects) {
    for (const HeldObject& object : objects)
        if (const auto held = room.hold(object); !held) return held.error();
    return {};
}

Result<VirtualOperatingRoom> furnishedRoom(const Scene& scene, const XrayOptions& xray) {
    OperatingRoomOptions setup = scene.room;
    setup.xray = xray;
    Result<VirtualOperatingRoom> room = VirtualOperatingRoom::create(nullptr, setup);
    if (!room) return room.error();
    Result<HeldObject> plate = heldPlate(scene.plate, scene.placement);
    if (!plate) return plate.error();
    if (const auto held = room->hold(std::move(*plate)); !held) return held.error();
    if (const auto held = holdAll(*room, scene.overlay); !held) return held.error();
    return room;
}

Result<Image> exposeAt(VirtualOperatingRoom& room, const std::optional<CArmPosition>& position) {
    ImageRequest request;
    request.position = position;
    Result<AcquiredImage> taken = room.acquire(request, Progress::none());
    if (!taken) return taken.error();
    return std::move(taken->image);
}

// Photons in the open beam that leave the wanted number in the mean over the lit picture of plate and objects.
Result<double> openBeam(const Scene& scene) {
    constexpr double kProbe = 1000;
    XrayOptions xray = scene.room.xray;
    xray.photons_per_pixel = kProbe;
    xray.quantum_noise = false;
    xray.electronic_noise_photons = 0;
    xray.gain = 1;
    xray.bits = 0;
    Result<VirtualOperatingRoom> room = furnishedRoom(scene, xray);
    if (!room) return room.error();
    const Result<Image> photons = exposeAt(*room, scene.position);
    if (!photons) return photons.error();
    double sum = 0;
    int lit = 0;
    for (const float value : photons->pixels()) {
        sum += static_cast<double>(value);
        lit += value > 0.5F ? 1 : 0;
    }
    return kProbe * scene.photons * std::max(lit, 1) / std::max(sum, 1e-9);
}

Result<Pictures> takePictures(const DewarpExperimentOptions& options, const Scene& scene) {
    const Result<double> photons = openBeam(scene);
    if (!photons) return photons.error();
    XrayOptions xray = scene.room.xray;
    xray.photons_per_pixel = *photons;
    Result<VirtualOperatingRoom> room = furnishedRoom(scene, xray);
    if (!room) return room.error();
    Result<Image> plate = exposeAt(*room, scene.position);
    if (!plate) return plate.error();

    for (const HeldObject& object : scene.overlay)
        if (const auto released = room->release(object.name); !released) return released.error();
    const double half_mm = 0.5 * options.size_px * options.pixel_mm;
    const Result<BeadLayout> layout =
        beadsOnPlate(options.bead_spacing_mm, options.bead_diameter_mm, half_mm, scene.plate);
    if (!layout) return layout.error();
    PlatePlacement upright = scene.placement;
    upright.mirrored = false;  // the beads lie on the side that faces the source, whichever that is
    Result<HeldObject> beads = heldBeads("beads", *layout, HeldBy::imager, placedPlate(upright));
    if (!beads) return beads.error();
    if (const auto held = room->hold(std::move(*beads)); !held) return held.error();
    Result<Image> with_beads = exposeAt(*room, std::nullopt);
    if (!with_beads) return with_beads.error();
    return Pictures{std::move(*plate), std::move(*with_beads), beadHeight(scene.plate, options.bead_diameter_mm),
                    truthOf(*room).views.front().carm};
}

// True plate coordinates, in pitches, of a pixel.
Vector2 truePitches(const Pictures& pictures, const Scene& scene, const Vector2& pixel) {
    const Vector3 at = pictures.true_carm.detectorPoint(pixel);
    const Vector3 in_plate = placedPlate(scene.placement).inverse() * Vector3(at.x(), at.y(), 0);
    return in_plate.head<2>() / scene.plate.pitch_mm;
}

// Points of one kind that do not lie on the groove they were given, when the true lattice is numbered along `axis`.
int misnumbered(const std::vector<GroovePoint>& points, const std::vector<Vector2>& truth, int axis, double sign) {
    std::vector<double> offsets;
    for (std::size_t i = 0; i < points.size(); ++i)
        offsets.push_back(points[i].index - sign * truth[i][axis]);
    if (offsets.empty()) return 0;
    const double shift = std::round(median(offsets));
    return static_cast<int>(std::count_if(offsets.begin(), offsets.end(),
                                          [&](double offset) { return !(std::abs(offset - shift) < 0.25); }));
}

// A lattice looks the same shifted by a pitch, turned by 90 degrees or turned over: the best numbering counts.
bool isWronglyNumbered(const GrooveDetection& found, const Pictures& pictures, const Scene& scene) {
    const auto truthOfPoints = [&](const std::vector<GroovePoint>& points) {
        std::vector<Vector2> truth;
        for (const GroovePoint& point : points)
            truth.push_back(truePitches(pictures, scene, point.pixel));
        return truth;
    };
    const std::vector<Vector2> along_y = truthOfPoints(found.points.along_y);
    const std::vector<Vector2> along_x = truthOfPoints(found.points.along_x);
    for (const int axis : {0, 1}) {
        int wrong = 0;
        wrong += std::min(misnumbered(found.points.along_y, along_y, axis, 1),
                          misnumbered(found.points.along_y, along_y, axis, -1));
        wrong += std::min(misnumbered(found.points.along_x, along_x, 1 - axis, 1),
                          misnumbered(found.points.along_x, along_x, 1 - axis, -1));
        // A few stray points are for the robust fit to drop; a misnumbered groove has many more.
        if (wrong <= 0.02 * static_cast<double>(along_y.size() + along_x.size())) return false;
    }
    return true;
}

struct MapErrors {
    std::vector<double> centre, margin;
};

// Against the truth after the best turn and shift, which no image of a plate can tell.
MapErrors mapErrors(const DistortionMap& map, const CArm& true_carm) {
    std::vector<Vector2> seen, truth;
    for (int v = 8; v < map.rows(); v += 16) {
        for (int u = 8; u < map.columns(); u += 16) {
            const Vector2 pixel(u, v);
            if (!map.covers(pixel)) continue;
            seen.push_back(map.detectorFromPixel(pixel));
            truth.emplace_back(true_carm.detectorPoint(pixel).head<2>());
        }
    }
    MapErrors errors;
    if (seen.size() < 3) return errors;
    const PlaneMotion truth_from_seen = bestMotion(seen, truth);
    for (std::size_t i = 0; i < seen.size(); ++i) {
        const double error = (truth_from_seen * seen[i] - truth[i]).norm();
        const bool centre = seen[i].cwiseAbs().maxCoeff() <= kCentreHalfMm;
        (centre ? errors.centre : errors.margin).push_back(error);
    }
    return errors;
}

struct ModelErrors {
    std::vector<double> beads_centre, beads_margin, map_centre, map_margin;
    int fits = 0;
    double coverage = 0;
};

void append(std::vector<double>& all, const std::vector<double>& more) {
    all.insert(all.end(), more.begin(), more.end());
}

Result<void> measure(const Pictures& pictures, const Scene& scene, const DewarpExperimentOptions& options,
                     const BeadDetections& beads, const DistortionMap& map, ModelErrors& errors) {
    const MapErrors of_map = mapErrors(map, pictures.true_carm);
    append(errors.map_centre, of_map.centre);
    append(errors.map_margin, of_map.margin);
    std::vector<Vector2> points;
    for (const BeadDetection& bead : beads.beads)
        if (map.covers(bead.center_px)) points.push_back(map.detectorFromPixel(bead.center_px));
    BeadTestOptions test;
    test.spacing_mm = options.bead_spacing_mm;
    test.centre_half_mm = kCentreHalfMm;
    test.bead_height_mm = pictures.bead_height_mm;
    test.source_mm = scene.room.nominal_carm.focal_length_mm;
    const Result<BeadTest> result = beadTest(points, test);
    if (!result) return result.error();
    append(errors.beads_centre, result->centre_errors_mm);
    append(errors.beads_margin, result->margin_errors_mm);
    return {};
}

}  // namespace

Result<void> DewarpExperimentOptions::validate() const {
    if (const auto ok = requireRanges({{"trials", static_cast<double>(trials), 1, 1e6, ""},
                                       {"size_px", static_cast<double>(size_px), 128, 4096, "px"},
                                       {"pixel_mm", pixel_mm, 0.05, 1, "mm"},
                                       {"least_photons", least_photons, 10, 1e6, "photons"},
                                       {"most_photons", most_photons, least_photons, 1e6, "photons"},
                                       {"least_contrast", least_contrast, 0.005, 0.35, ""},
                                       {"most_contrast", most_contrast, least_contrast, 0.35, ""},
                                       {"bead_spacing_mm", bead_spacing_mm, 5, 50, "mm"},
                                       {"bead_diameter_mm", bead_diameter_mm, 1, 5, "mm"}});
        !ok) {
        return ok;
    }
    for (const std::string& model : models) {
        const DistortionModelKind* kind = findDistortionModel(model);
        if (!kind || !kind->fit) return invalidOption("models", "\"" + model + "\"", "models that can be fitted");
    }
    return {};
}

Result<DewarpExperimentResult> runDewarpExperiment(const DewarpExperimentOptions& options, Progress& progress) {
    if (const auto good = options.validate(); !good) return good.error();
    DewarpExperimentResult result;
    std::vector<ModelErrors> errors(options.models.size());
    std::vector<double> detect_ms, fit_ms;
    const Random dice(options.seed);
    for (int trial = 0; trial < options.trials; ++trial) {
        if (progress.isCancelled()) return cancelled("dewarp experiment");
        progress.report(static_cast<double>(trial) / options.trials,
                        fmt::format("dewarp trial {} of {}", trial + 1, options.trials));
        Random random = dice.fork(static_cast<std::uint64_t>(trial));
        const Scene scene = drawScene(options, random);
        const Result<Pictures> pictures = takePictures(options, scene);
        if (!pictures) return pictures.error();

        ++result.trials;
        const Result<GrooveDetection> grooves = detectGrooves(pictures->plate, scene.plate, {}, Progress::none());
        if (!grooves) {
            if (grooves.error().code != ErrorCode::noSolution) return grooves.error();
            ++result.refused;
            continue;
        }
        detect_ms.push_back(grooves->elapsed_ms);
        if (isWronglyNumbered(*grooves, *pictures, scene)) ++result.wrong;
        const Result<BeadDetections> beads = detectBeads(pictures->beads);
        if (!beads) return beads.error();
        for (std::size_t m = 0; m < options.models.size(); ++m) {
            DistortionFitOptions fit;
            fit.model = options.models[m];
            const Stopwatch stopwatch;
            const Result<DistortionMap> map = fitDistortion(grooves->points, fit);
            const double took_ms = stopwatch.ms();
            if (!map) continue;
            if (m == 0) fit_ms.push_back(took_ms);
            if (const auto measured = measure(*pictures, scene, options, *beads, *map, errors[m]); !measured) continue;
            ++errors[m].fits;
            errors[m].coverage += map->quality().coverage;
        }
    }
    for (std::size_t m = 0; m < options.models.size(); ++m) {
        const ModelErrors& e = errors[m];
        result.models.push_back({options.models[m], figuresOf(e.beads_centre), figuresOf(e.beads_margin),
                                 figuresOf(e.map_centre), figuresOf(e.map_margin), e.fits,
                                 e.fits > 0 ? e.coverage / e.fits : 0});
    }
    result.detect_ms = median(detect_ms);
    result.fit_ms = median(fit_ms);
    return result;
}

}  // namespace fluorocut
