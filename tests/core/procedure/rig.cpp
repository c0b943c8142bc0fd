#include "tests/core/procedure/rig.h"

#include <stdexcept>

#include "core/base/random.h"
#include "core/base/units.h"
#include "core/cutting/removal.h"
#include "core/geometry/primitives.h"
#include "core/io/resources.h"
#include "core/simulation/acrylic_phantom.h"
#include "core/simulation/corkscrew_objects.h"
#include "core/simulation/truth.h"

namespace fluorocut::test {
namespace {

constexpr double kTop_mm = 25;  // of the block

template <class T>
T need(Result<T> result) {
    if (!result) throw std::logic_error(result.error().message());
    return std::move(*result);
}

TriangleMesh makeBoxAt(const Vector3& size_mm, const Vector3& middle_mm) {
    TriangleMesh mesh = makeBox(size_mm);
    for (Vector3& vertex : mesh.vertices)
        vertex += middle_mm;
    return mesh;
}

Vector3 normals(Random& random, double sigma) {
    return sigma * Vector3(random.normal(), random.normal(), random.normal());
}

}  // namespace

Rig::Rig(const RigOptions& options) : options_(options) {
    Random random(options.seed);
    AcrylicOptions acrylic;
    acrylic.size_mm = {38, 38, 2 * kTop_mm};
    acrylic.voxel_mm = 0.8;
    acrylic.beads = 9;
    acrylic.bead_diameter_mm = 2.4;
    AcrylicPhantom block = need(generateAcrylicBlock(acrylic));
    block_ = std::move(block.ct);

    setup_.patient = {"P-1", "left", std::make_shared<const Volume>(block_), 0.02, {}};
    setup_.patient.beads.frame = Frame::femur;
    for (const Vector3& place : block.bead_centers_mm) {
        setup_.patient.beads.beads.push_back(
            {"b" + std::to_string(setup_.patient.beads.beads.size() + 1), place, acrylic.bead_diameter_mm});
    }
    setup_.plan.implant = "cuboid 14";
    // Up into the air: where the mesh ends in the block's own face, a voxel there would be half block and half cavity,
    // and the part of it that is both is not known.
    setup_.plan.mesh = makeBoxAt({14, 14, 18}, {0, 0, -7});
    setup_.plan.femur_from_cavity = Rigid3::fromTranslation({0, 0, kTop_mm});
    setup_.plan.cavity.cutter_radius_mm = setup_.plan.path.cutter.radius_mm = 3;
    setup_.plan.path.cutter.length_mm = 60;
    setup_.plan.path.removal_rate_mm3_s = 150;
    setup_.plan.stages = static_cast<int>(options.insets_mm.size());
    setup_.plan.insets_mm = options.insets_mm;

    // The patient lies a little off; the robot's base stands so that its cutter waits above the block.
    room_options_.nominal_carm.columns = room_options_.nominal_carm.rows = options.pixels;
    const double pixel_mm = 210.0 / options.pixels;
    room_options_.nominal_carm.pixel_mm = {pixel_mm, pixel_mm};
    const double middle = 0.5 * (options.pixels - 1);
    room_options_.nominal_carm.principal_point_px = {middle, middle};
    room_options_ = room_options_.withoutErrors();
    room_options_.xray = XrayOptions{};
    room_options_.return_offset_mm = 8;
    room_options_.return_rotation_rad = radiansFromDegrees(2);
    room_options_.patient_offset_mm = 3;
    room_options_.patient_rotation_rad = radiansFromDegrees(2);
    room_options_.planned_room_from_robot = room_from_robot_ = Rigid3::fromTranslation({5, -4, 150});
    room_options_.seed = options.seed;

    ProcedureCalibration& calibration = setup_.calibration;
    calibration.corkscrew = need(readCorkscrew(need(findResource("fiducials", "corkscrew"))));
    calibration.flange_from_cutter = Rigid3::fromTranslation({10, 0, 80});
    Matrix3 upright;  // x of the corkscrew along the block's long axis
    upright << 0, 1, 0, 0, 0, 1, 1, 0, 0;
    const Rigid3 room_from_corkscrew = Rigid3::fromTranslation({52, 2, -3}) * Rigid3(upright, Vector3::Zero()) *
                                       Rigid3::fromTwistRollPitch(0.4, 0.1, 0.05);
    robot_from_corkscrew_ = room_from_robot_.inverse() * room_from_corkscrew;
    Vector6 off;
    off << normals(random, options.mount_mm), normals(random, options.mount_rad);
    Vector6 sigma;
    sigma << Vector3::Constant(options.mount_mm), Vector3::Constant(options.mount_rad);
    if (!options.honest_mount) sigma *= 0.01;
    // The robot stands at its workspace's middle, which is its origin.
    calibration.flange_from_corkscrew = {Frame::flange, Frame::corkscrew,
                                         (calibration.flange_from_cutter * robot_from_corkscrew_).perturbed(off),
                                         Matrix6(sigma.cwiseAbs2().asDiagonal())};
    calibration.focal_length_sigma_mm = 0.3;
    calibration.image_centre_sigma_px = 0.2;
    calibration.bead_sigma_mm = 0.01;
    calibration.calibrated_utc = utcNow();

    makeRoom();
    femur_from_robot_ = truthOf(*room_).room_from_femur.inverse() * truthOf(*room_).room_from_robot;
    for (const double orbital_deg : {-28.0, 30.0}) {
        ProcedureView view;
        view.name = orbital_deg < 0 ? "right" : "left";
        view.position.orbital_rad = radiansFromDegrees(orbital_deg);
        view.carm = room_options_.nominal_carm;
        setup_.views.push_back(view);
    }
    restart();
}

void Rig::restart() {
    SimulatedRobotOptions options;
    options.seed = options_.seed;
    auto robot = std::make_unique<SimulatedRobot>(options, [this](const Rigid3&, const Rigid3& now) {
        // Where the cutter truly is, every 0.1 mm.
        if (passed_.empty() || (passed_.back().translation() - now.translation()).norm() > 0.1) passed_.push_back(now);
        return 0.0;
    });
    robot_ = robot.get();
    supervisor_ = std::make_unique<Supervisor>(std::move(robot));
}

void Rig::makeRoom() {
    room_ = need(VirtualOperatingRoom::create(std::make_shared<const Volume>(block_), room_options_));
    for (HeldObject& part :
         need(heldCorkscrew("corkscrew", setup_.calibration.corkscrew, HeldBy::robot, robot_from_corkscrew_))) {
        if (auto held = room_->hold(std::move(part)); !held) throw std::logic_error(held.error().message());
    }
}

void Rig::cutWhatWasPassed() {
    ToolPath path;
    path.cutter = setup_.plan.path.cutter;
    for (std::size_t i = 1; i < passed_.size(); ++i) {
        const double reach = (femur_from_robot_ * passed_[i].translation()).z() - path.cutter.radius_mm;
        if (reach > kTop_mm + 1) continue;  // in air
        path.moves.push_back(
            {{passed_[i - 1].translation(), passed_[i].translation(), passed_[i].rotate(Vector3::UnitZ())},
             ToolMotion::cut,
             1});
    }
    passed_.clear();
    if (path.moves.empty()) return;
    const Volume gone = removedFraction(path, femur_from_robot_, block_.grid());
    for (std::size_t i = 0; i < gone.voxels().size(); ++i)
        block_.voxels()[i] += gone.voxels()[i] * (-1000 - block_.voxels()[i]);
    // Another room of the same seed would repeat its C-arm's visits: another C-arm's seed, the patient where it lies.
    const Rigid3 room_from_femur = truthOf(*room_).room_from_femur;
    room_options_.planned_room_from_femur = room_from_femur;
    room_options_.patient_offset_mm = room_options_.patient_rotation_rad = 0;
    ++room_options_.seed;
    makeRoom();
}

Result<AcquiredImage> Rig::acquire(const ImageRequest& request, Progress& progress) {
    if (repeat_last && last_) return *last_;
    cutWhatWasPassed();
    ++images_taken;
    ImageRequest asked = request;
    if (exchange_views && asked.position) {
        for (const ProcedureView& view : setup_.views)
            if (!(view.position == *request.position)) asked.position = view.position;
    }
    Result<AcquiredImage> image = room_->acquire(asked, progress);
    if (image) last_ = *image;
    return image;
}

CaseStore newCase(const std::filesystem::path& file) {
    return need(CaseStore::create(file, "rig"));
}

CaseStore openCase(const std::filesystem::path& file) {
    return need(CaseStore::open(file, CaseStore::Access::write));
}

}  // namespace fluorocut::test
