#include "core/experiments/operation_calibration.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "core/base/units.h"
#include "core/casestore/case_store.h"
#include "core/distortion/groove_detection.h"
#include "core/experiments/simulated_imager.h"
#include "core/fiducial/corkscrew_pose.h"
#include "core/fiducial/imager_calibration.h"
#include "core/io/resources.h"
#include "core/registration/hand_eye.h"
#include "core/simulation/calibration_objects.h"
#include "core/simulation/corkscrew_objects.h"
#include "core/simulation/truth.h"

namespace fluorocut {
namespace {

constexpr std::uint64_t kCalibrationOccasion = 1'000'000;
constexpr int kHandEyePoses = 12;

struct Technician {
    const Scenario& scenario;
    const OperationTheatre& theatre;
    VirtualOperatingRoom room;
    Random random;

    Result<Image> picture(const std::optional<CArmPosition>& position, Progress& progress) {
        ImageRequest request;
        request.position = position;
        auto acquired = room.acquire(request, progress);
        if (!acquired) return acquired.error();
        return std::move(acquired->image);
    }
    const ViewTruth& standing() const { return truthOf(room).views.back(); }

    Result<DistortionMap> map(const CArmPosition& position, Progress& progress);
    Result<ImagerCalibration> imager(const DistortionMap* map, Progress& progress);
    CArm imagerOfTruth(const DistortionMap* map);
    Result<HandEyeCalibration> handEye(const ProcedureView& view, double focal_sigma, double centre_sigma_px,
                                       Progress& progress);
};

Error during(const std::string& what, Error error) {
    error.where = fmt::format("{}: {}", what, error.where);
    return error;
}

Result<DistortionMap> Technician::map(const CArmPosition& position, Progress& progress) {
    const GroovedPlate plate;
    PlatePlacement placement;
    placement.shift_mm = {random.uniform(-3, 3), random.uniform(-3, 3)};
    placement.rotation_rad = random.uniform(-0.15, 0.15);
    auto held = heldPlate(plate, placement);
    if (!held) return held.error();
    const std::string name = held->name;
    if (auto ok = room.hold(std::move(*held)); !ok) return ok.error();
    const auto image = picture(position, progress);
    if (auto ok = room.release(name); !ok) return ok.error();
    if (!image) return image.error();
    const auto grooves = detectGrooves(*image, plate, {}, progress);
    if (!grooves) return grooves.error();
    const auto fitted = fitDistortion(grooves->points, {}, progress);
    if (!fitted) return fitted.error();
    return fitted->measured(position, utcNow());
}

// Where the C-arm stands: three pictures of the phantom.
Result<ImagerCalibration> Technician::imager(const DistortionMap* map, Progress& progress) {
    const auto file = findResource("phantoms", "two-plane");
    if (!file) return file.error();
    const auto layout = readBeadLayout(*file);
    if (!layout) return layout.error();
    auto held = heldBeads("phantom", *layout, HeldBy::room, Rigid3());
    if (!held) return held.error();
    if (auto ok = room.hold(std::move(*held)); !ok) return ok.error();

    ImagerCalibrationOptions options;
    options.nominal = theatre.room.nominal_carm;
    options.pixel_scale_source = PixelScaleSource::stated;
    if (map) {
        options.nominal.pixel_mm = Vector2::Constant(map->pixelMm());
        options.pixel_scale_source = PixelScaleSource::distortionMap;
        options.distortion = [map](const CArm& carm) { return distortionOf(*map, carm); };
    }
    BeadDetectionOptions detection;
    const double pixel_mm = options.nominal.pixel_mm.x();
    detection.least_diameter_px = std::max(2.0, 1.2 / pixel_mm);
    detection.most_diameter_px = 7.5 / pixel_mm;
    std::vector<PhantomView> views;
    // Its planes square to the beam, then tilted by some 20 degrees two ways.
    const Rigid3 beam_from_room(standing().imager_from_room.rotation(), Vector3::Zero());
    for (const Vector3& tilt : {Vector3(0.05, 0.02, 0), Vector3(0.35, 0.1, 0.3), Vector3(-0.15, 0.33, -0.2)}) {
        const Rigid3 room_from_phantom = beam_from_room.inverse() * Rigid3::fromRotationVector(tilt) *
                                         Rigid3::fromTranslation({random.uniform(-4, 4), random.uniform(-4, 4), 0});
        if (auto ok = room.move("phantom", room_from_phantom); !ok) return ok.error();
        const auto image = picture(std::nullopt, progress);
        if (!image) return image.error();
        auto beads = detectBeads(*image, detection, progress);
        if (!beads) return beads.error();
        PhantomView view{fmt::format("phantom {}", views.size() + 1), {}};
        for (const BeadDetection& bead : beads->beads)
            if (!map || map->covers(bead.center_px, bead.radius_px)) view.detections.push_back(bead);
        views.push_back(std::move(view));
    }
    if (auto ok = room.release("phantom"); !ok) return ok.error();
    return calibrateImager(views, *layout, options, progress);
}

// As a calibration with the stated standard deviations leaves it known, without its pictures.
CArm Technician::imagerOfTruth(const DistortionMap* map) {
    const CArm& truth = standing().carm;
    CArm known = theatre.room.nominal_carm;
    const Vector2 centre_error_mm =
        scenario.calibration.principal_point_sigma_mm * Vector2(random.normal(), random.normal());
    known.focal_length_mm = truth.focal_length_mm + scenario.calibration.focal_length_sigma_mm * random.normal();
    known.principal_point_px = truth.principal_point_px;
    if (map) {
        known.pixel_mm = Vector2::Constant(map->pixelMm());
        std::vector<Vector2> true_mm, mapped_mm;
        for (int v = 4; v < map->rows(); v += 16)
            for (int u = 4; u < map->columns(); u += 16)
                if (map->covers(Vector2(u, v))) {
                    true_mm.emplace_back(truth.detectorPoint(Vector2(u, v)).head<2>());
                    mapped_mm.push_back(map->detectorFromPixel(Vector2(u, v)));
                }
        const PlaneMotion map_from_truth = bestMotion(true_mm, mapped_mm);
        known.principal_point_px = map->middle() + map_from_truth.shift_mm.cwiseQuotient(known.pixel_mm);
    }
    known.principal_point_px += centre_error_mm.cwiseQuotient(known.pixel_mm);
    return known;
}

// The flange turned about the corkscrew's middle, so that it stays in the picture.
std::vector<Rigid3> handEyePoses(const OperationTheatre& theatre) {
    const Rigid3 flange = theatre.robot_from_cutter_imaging * theatre.flange_from_cutter.inverse();
    const Vector3 middle = flange * theatre.flange_from_corkscrew_nominal.translation();
    std::vector<Rigid3> poses;
    for (int n = 0; n < kHandEyePoses; ++n) {
        // Axes spread over the sphere (a Fibonacci lattice), turns of 12 to 26 degrees.
        const double z = 1 - (2 * n + 1.0) / kHandEyePoses, r = std::sqrt(1 - z * z), a = 2.399963 * n;
        const Vector3 axis(r * std::cos(a), r * std::sin(a), z);
        const double angle = radiansFromDegrees(12 + 7 * (n % 3));
        const Vector3 shift(6 * std::cos(1.3 * n), 6 * std::sin(1.3 * n), 4 * std::cos(2.1 * n));
        poses.push_back(Rigid3::fromTranslation(middle + shift) * Rigid3::fromRotationVector(angle * axis) *
                        Rigid3::fromTranslation(-middle) * flange);
    }
    return poses;
}

Result<HandEyeCalibration> Technician::handEye(const ProcedureView& view, double focal_sigma, double centre_sigma_px,
                                               Progress& progress) {
    auto parts = heldCorkscrew("corkscrew", theatre.layout, HeldBy::robot, Rigid3());
    if (!parts) return parts.error();
    std::vector<std::string> names;
    for (HeldObject& part : *parts) {
        names.push_back(part.name);
        if (auto ok = room.hold(std::move(part)); !ok) return ok.error();
    }
    const SimulatedRobot robot(theatre.robot);
    CorkscrewPoseOptions options;
    options.calibration.focal_length = focal_sigma;
    options.calibration.principal_point_mm = centre_sigma_px * view.carm.pixel_mm.x();
    options.calibration.distortion_mm = scenario.calibration.local_distortion_mm;
    std::vector<HandEyeObservation> observations;
    for (const Rigid3& robot_from_flange : handEyePoses(theatre)) {
        const double fraction = static_cast<double>(observations.size()) / kHandEyePoses;
        if (progress.isCancelled()) return cancelled("hand-eye calibration");
        progress.report(fraction, "corkscrew on the robot");
        // The encoders see the tremble, and nothing of the robot's own calibration error.
        const Rigid3 cutter = robot_from_flange * theatre.flange_from_cutter;
        const Rigid3 true_flange =
            cutter.perturbed(robot.calibrationErrorAt(cutter.translation())) * theatre.flange_from_cutter.inverse();
        for (const std::string& name : names)
            if (auto ok = room.move(name, true_flange * theatre.flange_from_corkscrew_mounted); !ok) return ok.error();
        const auto image =
            picture(observations.empty() ? std::optional(view.position) : std::nullopt, Progress::none());
        if (!image) return image.error();
        const auto pose = estimateCorkscrewPose(*image, view.carm, theatre.layout, options);
        if (!pose || !accepted(pose->acceptance)) continue;  // the technician takes another one
        HandEyeObservation observation;
        observation.name = fmt::format("corkscrew {}", observations.size() + 1);
        observation.imager = view.name;
        observation.robot_from_flange = robot_from_flange;
        observation.imager_from_corkscrew = pose->imager_from_corkscrew.target_from_source;
        observation.covariance = pose->imager_from_corkscrew.covariance;
        observations.push_back(std::move(observation));
    }
    for (const std::string& name : names)
        if (auto ok = room.release(name); !ok) return ok.error();
    HandEyeOptions how;
    how.robot_place_mm = 0.012;
    how.robot_rotation_rad = 1e-4;
    return calibrateHandEye(observations, how);
}

Matrix6 diagonal(double place_mm, double rotation_rad) {
    Vector6 variance;
    variance << Vector3::Constant(place_mm * place_mm), Vector3::Constant(rotation_rad * rotation_rad);
    return variance.asDiagonal();
}

}  // namespace

Result<OperationCalibration> calibrateOperation(const Scenario& scenario, const OperationTheatre& theatre,
                                                Progress& progress) {
    auto room = VirtualOperatingRoom::create(nullptr, theatre.room);
    if (!room) return room.error();
    room->beginOccasion(kCalibrationOccasion);
    Technician technician{scenario, theatre, std::move(*room), streamOf(scenario, ScenarioStream::calibration)};
    OperationCalibration result;
    const bool bent = scenario.carm.pincushion_mm + scenario.carm.s_shape_rad + scenario.carm.field_shift_mm > 0;
    const double share = 0.6 / static_cast<double>(scenario.views.size());
    for (const ScenarioView& wanted : scenario.views) {
        const double from = share * static_cast<double>(result.views.size());
        SubProgress part(progress, from, from + share);
        ProcedureView view;
        view.name = wanted.name;
        view.position = {radiansFromDegrees(wanted.orbital_deg), radiansFromDegrees(wanted.angulation_deg),
                         Vector3::Zero()};
        std::optional<DistortionMap> map;
        if (bent) {
            auto measured = technician.map(view.position, Progress::none());
            if (!measured) return during("plate, " + view.name, measured.error());
            map = std::move(*measured);
        } else if (auto empty = technician.picture(view.position, Progress::none()); !empty) {
            return empty.error();
        }
        part.report(0.4, "imager");
        if (scenario.calibration.pictures) {
            auto calibrated = technician.imager(map ? &*map : nullptr, Progress::none());
            if (!calibrated) return during("bead phantom, " + view.name, calibrated.error());
            view.carm = calibrated->carm;
            result.focal_length_sigma_mm = std::max(result.focal_length_sigma_mm, calibrated->focal_sigma_mm);
            result.image_centre_sigma_px =
                std::max(result.image_centre_sigma_px, calibrated->center_sigma_px.maxCoeff());
        } else {
            view.carm = technician.imagerOfTruth(map ? &*map : nullptr);
            result.focal_length_sigma_mm = scenario.calibration.focal_length_sigma_mm;
            result.image_centre_sigma_px = scenario.calibration.principal_point_sigma_mm / view.carm.pixel_mm.x();
        }
        if (map) {
            auto distortion = distortionOf(*map, view.carm);
            if (!distortion) return distortion.error();
            view.carm.distortion = std::move(*distortion);
        }
        view.carm.name = view.name;
        result.views.push_back(std::move(view));
        if (progress.isCancelled()) return cancelled("calibration");
    }

    Pose& mount = result.flange_from_corkscrew;
    mount = {Frame::flange, Frame::corkscrew, {}, {}};
    const ScenarioCalibration& stated = scenario.calibration;
    if (stated.pictures) {
        SubProgress part(progress, 0.6, 1);
        const ProcedureView& view = result.views.front();
        auto hand_eye = technician.handEye(view, result.focal_length_sigma_mm / view.carm.focal_length_mm,
                                           result.image_centre_sigma_px, part);
        if (!hand_eye) return during("hand-eye calibration", hand_eye.error());
        mount = hand_eye->flange_from_corkscrew;
    } else {
        const double rotation_rad = radiansFromDegrees(stated.hand_eye_rotation_sigma_deg);
        Vector6 error;
        for (int n = 0; n < 6; ++n)
            error[n] = (n < 3 ? stated.hand_eye_place_sigma_mm : rotation_rad) * technician.random.normal();
        mount.target_from_source = theatre.flange_from_corkscrew_mounted.perturbed(error);
        mount.covariance = diagonal(stated.hand_eye_place_sigma_mm, rotation_rad);
    }
    *mount.covariance += diagonal(scenario.corkscrew.knock_place_sigma_mm,
                                  radiansFromDegrees(scenario.corkscrew.knock_rotation_sigma_deg));
    progress.report(1, "calibrated");
    return result;
}

}  // namespace fluorocut
