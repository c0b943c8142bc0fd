#include "core/experiments/operation_theatre.h"

#include <cmath>
#include <numbers>

#include "core/base/units.h"
#include "core/io/resources.h"

namespace fluorocut {
namespace {

// Of the corkscrew's middle from the cutter's tip, in the cutter's frame: on the spindle, a little up and aside.
const Vector3 kCorkscrewInCutter(6, -4, 8);
constexpr double kTwist = 0.4;
constexpr double kFlangeAboveCutter = 220;
constexpr double kMountMm = 1, kMountRad = 0.02;  // standard deviations of a mount as made from that as designed

// The direction across the cavity's axis that is as square to every beam as can be, in `room`.
Vector3 shaftDirection(const Scenario& scenario, const Rigid3& room_from_cavity) {
    Vector3 best = Vector3::UnitX();
    double least = 2;
    for (int n = 0; n < 180; ++n) {
        const double angle = radiansFromDegrees(n);
        const Vector3 shaft = room_from_cavity.rotate({std::cos(angle), std::sin(angle), 0});
        double worst = 0;
        for (const ScenarioView& view : scenario.views) {
            const CArmPosition position{radiansFromDegrees(view.orbital_deg), radiansFromDegrees(view.angulation_deg),
                                        Vector3::Zero()};
            const Rigid3 imager_from_room = nominalImagerFromRoom(position, scenario.carm.source_to_isocentre_mm);
            worst = std::max(worst, std::abs(imager_from_room.rotate(shaft).z()));
        }
        if (worst < least - 1e-9) {
            least = worst;
            best = shaft;
        }
    }
    return best;
}

// cutter_from_corkscrew: x along the shaft, turned about it so that no ring's bead hides behind the rod's middle.
Rigid3 cutterFromCorkscrew(const Vector3& shaft_in_cutter) {
    Matrix3 rotation;
    rotation.col(0) = shaft_in_cutter.normalized();
    rotation.col(1) = Vector3::UnitZ().cross(rotation.col(0)).normalized();
    rotation.col(2) = rotation.col(0).cross(rotation.col(1));
    return Rigid3(rotation, kCorkscrewInCutter) * Rigid3::fromRotationVector({kTwist, 0, 0});
}

Vector6 drawn(Random& random, double place_mm, double rotation_rad) {
    Vector6 error;
    for (int n = 0; n < 6; ++n)
        error[n] = (n < 3 ? place_mm : rotation_rad) * random.normal();
    return error;
}

void setCarm(const Scenario& scenario, OperatingRoomOptions& room) {
    const ScenarioCarm& carm = scenario.carm;
    CArm& nominal = room.nominal_carm;
    nominal.name = "simulated C-arm";
    nominal.columns = nominal.rows = carm.columns;
    nominal.pixel_mm = Vector2::Constant(carm.pixel_mm);
    nominal.principal_point_px = Vector2::Constant(0.5 * (carm.columns - 1));
    nominal.focal_length_mm = carm.focal_length_mm;
    room.source_to_isocentre_mm = carm.source_to_isocentre_mm;
    room.focal_length_error_mm = carm.focal_length_error_mm;
    room.focal_length_sag_mm = carm.focal_length_sag_mm;
    room.principal_point_error_px = carm.principal_point_error_px;
    const double field_mm = 0.5 * carm.columns * carm.pixel_mm;
    room.intensifier = IntensifierOptions::none();
    room.intensifier.field_radius_mm = field_mm;
    room.intensifier.pincushion_mm = carm.pincushion_mm;
    room.intensifier.s_shape_rad = carm.s_shape_rad;
    room.intensifier.field_shift_mm = carm.field_shift_mm;
    if (carm.pincushion_mm + carm.s_shape_rad + carm.field_shift_mm > 0)
        room.intensifier.sag_shift_mm = IntensifierOptions{}.sag_shift_mm;
    room.return_offset_mm = carm.return_offset_mm;
    room.return_rotation_rad = radiansFromDegrees(carm.return_rotation_deg);
    room.xray.photons_per_pixel = carm.photons;
    room.xray.detector_blur_px = carm.blur_px;
    if (!carm.scatter) room.xray.scatter_per_attenuation = room.xray.glare_fraction = 0;
    if (carm.round_field) room.xray.field_radius_mm = 0.985 * field_mm;
    room.xray.bits = 16;
    room.xray.brightness = 0.04;  // of 16 bits: the open beam stays below the limit
    room.projection = carm.exact_projection ? ProjectionMethod::exact : ProjectionMethod::fast;
}

}  // namespace

Random streamOf(const Scenario& scenario, ScenarioStream stream) {
    return Random(scenario.seed).fork(static_cast<std::uint64_t>(stream));
}

Result<OperationTheatre> theatreOf(const Scenario& scenario, const PlannedOperation& plan) {
    OperationTheatre theatre;
    const auto file = findResource("fiducials", scenario.corkscrew.layout);
    if (!file) return file.error();
    auto layout = readCorkscrew(*file);
    if (!layout) return layout.error();
    theatre.layout = std::move(*layout);

    OperatingRoomOptions& room = theatre.room;
    setCarm(scenario, room);
    room.seed = streamOf(scenario, ScenarioStream::room).bits();
    const double corkscrew_z = plan.top_mm + scenario.corkscrew.above_mm;
    // What is to be seen, from the cavity's bottom to the corkscrew's upper edge, about the isocentre.
    const double middle_z = 0.5 * (plan.bottom_mm + corkscrew_z + theatre.layout.rod_radius_mm);
    const Rigid3 room_from_femur = Rigid3::fromTranslation(-(plan.femur_from_cavity * Vector3(0, 0, middle_z)));
    room.planned_room_from_femur = room_from_femur;
    room.patient_offset_mm = scenario.patient_offset_mm;
    room.patient_rotation_rad = radiansFromDegrees(scenario.patient_rotation_deg);
    const Rigid3 room_from_cavity = room_from_femur * plan.femur_from_cavity;
    const Rigid3 cutter_from_corkscrew =
        cutterFromCorkscrew(room_from_cavity.inverse().rotate(shaftDirection(scenario, room_from_cavity)));
    const Rigid3 cavity_from_cutter = Rigid3::fromTranslation(Vector3(0, 0, corkscrew_z) - kCorkscrewInCutter);
    theatre.robot_from_cutter_imaging = Rigid3();
    room.planned_room_from_robot = room_from_cavity * cavity_from_cutter;
    room.robot_offset_mm = scenario.robot.offset_mm;
    room.robot_rotation_rad = radiansFromDegrees(scenario.robot.rotation_deg);

    theatre.flange_from_cutter = Rigid3::fromTranslation({0, 0, -kFlangeAboveCutter});
    theatre.flange_from_corkscrew_nominal = theatre.flange_from_cutter * cutter_from_corkscrew;
    Random mounting = streamOf(scenario, ScenarioStream::mount);
    theatre.flange_from_corkscrew_mounted =
        theatre.flange_from_corkscrew_nominal.perturbed(drawn(mounting, kMountMm, kMountRad));
    Random knocking = streamOf(scenario, ScenarioStream::knock);
    Vector6 knock = drawn(knocking, scenario.corkscrew.knock_place_sigma_mm,
                          radiansFromDegrees(scenario.corkscrew.knock_rotation_sigma_deg));
    if (scenario.corkscrew.knock) {
        knock = *scenario.corkscrew.knock;
        knock.tail<3>() *= radiansFromDegrees(1);
    }
    theatre.flange_from_corkscrew = theatre.flange_from_corkscrew_mounted.perturbed(knock);

    SimulatedRobotOptions& robot = theatre.robot;
    robot.seed = streamOf(scenario, ScenarioStream::robot).bits();
    robot.calibration_mm = scenario.robot.calibration_mm;
    robot.calibration_rad = radiansFromDegrees(scenario.robot.calibration_deg);
    robot.bone_point_mm = cavity_from_cutter.inverse() * Vector3(0, 0, middle_z);
    if (auto ok = robot.validate(); !ok) return ok.error();
    if (auto ok = room.validate(); !ok) return ok.error();
    return theatre;
}

}  // namespace fluorocut
