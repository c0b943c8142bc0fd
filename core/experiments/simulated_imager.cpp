#include "core/experiments/simulated_imager.h"

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "core/base/option_checks.h"
#include "core/distortion/groove_detection.h"
#include "core/simulation/calibration_objects.h"
#include "core/simulation/closed_form_projection.h"
#include "core/simulation/intensifier_distortion.h"

namespace fluorocut {
namespace {

Rigid3 anyTurn(Random& random) {
    const Eigen::Quaterniond turn(random.normal(), random.normal(), random.normal(), random.normal());
    return {turn.normalized(), Vector3::Zero()};
}

// The plate alone, on the detector, as its calibration sees it.
Result<Image> plateImage(const CArm& carm, const GroovedPlate& plate, double lit_radius_mm, double photons,
                         Random& random) {
    PlatePlacement placement;
    placement.shift_mm = {random.uniform(-4, 4), random.uniform(-4, 4)};
    placement.rotation_rad = random.uniform(-std::numbers::pi, std::numbers::pi);
    const Rigid3 imager_from_plate = Rigid3::fromTranslation({0, 0, carm.focal_length_mm}) * placedPlate(placement);
    Image line_integrals = platePathLengths(plate, PlateFacing::source, carm, imager_from_plate, {3});
    const float mu = static_cast<float>(attenuationPerMm(plate.material));
    for (float& value : line_integrals.pixels())
        value *= mu;
    XrayOptions xray;
    xray.photons_per_pixel = photons;
    xray.focal_spot_mm = 0;  // the plate lies on the detector
    xray.field_radius_mm = lit_radius_mm;
    xray.bits = 16;
    xray.seed = random.bits();
    Result<Exposure> exposure = expose(line_integrals, carm, xray);
    if (!exposure) return exposure.error();
    return std::move(exposure->image);
}

// Gives the known C-arm the map as its distortion, and the frame that goes with it.
Result<void> calibrate(SimulatedImager& imager, const DistortionMap& map, const Vector2& principal_point_error_px) {
    std::vector<Vector2> truth, mapped;
    for (int v = 4; v < map.rows(); v += 8) {
        for (int u = 4; u < map.columns(); u += 8) {
            const Vector2 pixel(u, v);
            if (!imager.lit(pixel)) continue;
            truth.emplace_back(imager.truth.detectorPoint(pixel).head<2>());
            mapped.push_back(map.detectorFromPixel(pixel));
        }
    }
    const PlaneMotion map_from_truth = bestMotion(truth, mapped);
    double squares = 0;
    for (std::size_t i = 0; i < truth.size(); ++i)
        squares += (map_from_truth * truth[i] - mapped[i]).squaredNorm();
    imager.map_error_mm = std::sqrt(squares / static_cast<double>(truth.size()));
    imager.known_from_true = Rigid3::fromRotationVector({0, 0, map_from_truth.rotation_rad});
    // Where the true principal axis, (0, 0) of the truth, lies in the map's straight picture.
    imager.known.principal_point_px =
        map.middle() + map_from_truth.shift_mm.cwiseQuotient(imager.known.pixel_mm) + principal_point_error_px;
    Result<std::shared_ptr<const Distortion>> distortion = distortionOf(map, imager.known);
    if (!distortion) return distortion.error();
    imager.known.distortion = std::move(*distortion);
    return {};
}

}  // namespace

Result<void> SimulatedImagerOptions::validate() const {
    return requireRanges({{"size_px", static_cast<double>(size_px), 64, 4096, "px"},
                          {"pixel_mm", pixel_mm, 0.02, 5, "mm"},
                          {"focal_length_mm", focal_length_mm, 200, 5000, "mm"},
                          {"plate_photons", plate_photons, 50, 1e7, ""},
                          {"plate_contrast", plate_contrast, 0.01, 0.3, ""},
                          {"focal_length_error", focal_length_error, 0, 0.1, ""},
                          {"principal_point_error_mm", principal_point_error_mm, 0, 20, "mm"}});
}

bool SimulatedImager::lit(const Vector2& pixel) const {
    if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() > truth.columns - 1 || pixel.y() > truth.rows - 1) return false;
    const Vector2 from_middle = pixel - 0.5 * Vector2(truth.columns - 1, truth.rows - 1);
    return from_middle.cwiseProduct(truth.pixel_mm).norm() < lit_radius_mm;
}

PlaneMotion bestMotion(const std::vector<Vector2>& from, const std::vector<Vector2>& to) {
    if (from.size() != to.size() || from.size() < 2) throw std::logic_error("bestMotion: too few points");
    const double share = 1.0 / static_cast<double>(from.size());
    Vector2 from_mean = Vector2::Zero(), to_mean = Vector2::Zero();
    for (std::size_t i = 0; i < from.size(); ++i) {
        from_mean += share * from[i];
        to_mean += share * to[i];
    }
    double cosine = 0, sine = 0;
    for (std::size_t i = 0; i < from.size(); ++i) {
        const Vector2 a = from[i] - from_mean, b = to[i] - to_mean;
        cosine += a.dot(b);
        sine += a.x() * b.y() - a.y() * b.x();
    }
    PlaneMotion motion;
    motion.rotation_rad = std::atan2(sine, cosine);
    motion.shift_mm = to_mean - motion.rotation() * from_mean;
    return motion;
}

Result<SimulatedImager> simulateImager(const SimulatedImagerOptions& options, Random& random) {
    if (const Result<void> good = options.validate(); !good) return good.error();
    SimulatedImager imager;
    CArm& truth = imager.truth;
    truth.columns = truth.rows = options.size_px;
    truth.pixel_mm = Vector2::Constant(options.pixel_mm);
    truth.focal_length_mm = options.focal_length_mm;
    truth.principal_point_px = Vector2::Constant(0.5 * (options.size_px - 1));
    const Vector2 error_px =
        options.principal_point_error_mm / options.pixel_mm * Vector2(random.normal(), random.normal());
    imager.known = truth;
    imager.known.focal_length_mm *= 1 + options.focal_length_error * random.normal();
    imager.known.principal_point_px += error_px;
    if (options.bent) {
        truth.principal_point_px += Vector2(random.uniform(-5, 5), random.uniform(-5, 5));
        const double half_field_mm = 0.5 * options.size_px * options.pixel_mm;
        imager.lit_radius_mm = 0.98 * half_field_mm;
        IntensifierOptions tube;
        tube.field_radius_mm = half_field_mm;
        auto distortion = IntensifierDistortion::create(intensifierAt(tube, anyTurn(random)));
        if (!distortion) return distortion.error();
        truth.distortion = std::move(*distortion);
        GroovedPlate plate;
        plate.groove_depth_mm *= options.plate_contrast / plate.grooveContrast();
        const Result<Image> image = plateImage(truth, plate, imager.lit_radius_mm, options.plate_photons, random);
        if (!image) return image.error();
        const Result<GrooveDetection> grooves = detectGrooves(*image, plate, {}, Progress::none());
        if (!grooves) return grooves.error();
        const Result<DistortionMap> map = fitDistortion(grooves->points, {});
        if (!map) return map.error();
        if (const Result<void> done = calibrate(imager, *map, error_px); !done) return done.error();
    }
    return imager;
}

}  // namespace fluorocut
