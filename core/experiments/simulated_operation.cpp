#include "core/experiments/simulated_operation.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "core/base/units.h"
#include "core/casestore/case_store.h"
#include "core/simulation/calibration_objects.h"
#include "core/simulation/corkscrew_objects.h"
#include "core/simulation/milled_bone.h"

namespace fluorocut {
namespace {

constexpr double kRecordEvery = 0.25;  // mm of the cutter's way, for the truth
// The corkscrew's rod stays this far above the cavity's top, or it is taken off for pictures: mm.
constexpr double kCorkscrewClear = 5;
constexpr double kHeartbeat = 0.01;  // s
// What locations of milled cavities were found wrong by, beyond their covariances: 0.1 mm, a tenth of a degree of tilt,
// and, in the thick of a thigh, up to a degree and a half about the axis of a slender stem's first stage.
constexpr double kLocationMm = 0.1, kLocationRad = 1.7e-3, kLocationRollRad = 0.013;

struct Cut {
    std::string stage;
    std::vector<Vector3> believed_in_robot, true_in_femur;
};

// Tells when a motion begins.
class ObservedRobot final : public SimulatedRobot {
  public:
    ObservedRobot(const SimulatedRobotOptions& options, RobotSurroundings surroundings,
                  std::function<void(const CheckedMotion&)> begins)
        : SimulatedRobot(options, std::move(surroundings)), begins_(std::move(begins)) {}

    Result<void> execute(const CheckedMotion& motion) override {
        auto done = SimulatedRobot::execute(motion);
        if (done) begins_(motion);
        return done;
    }

  private:
    std::function<void(const CheckedMotion&)> begins_;
};

// For motions that were checked before they were executed the first time.
class ReplayChecker final : public MotionChecker {
  public:
    explicit ReplayChecker(std::string name) : name_(std::move(name)) {}
    std::string name() const override { return name_; }

  private:
    Result<void> judge(const MotionProposal&) const override { return {}; }
    std::string name_;
};

}  // namespace

struct SimulatedOperation::World {
    Scenario scenario;
    PlannedOperation plan;
    OperationTheatre theatre;

    std::unique_ptr<VirtualOperatingRoom> room;
    std::unique_ptr<MilledBone> bone;
    std::unique_ptr<Supervisor> supervisor;
    SimulatedRobot* robot = nullptr;  // the supervisor's
    Rigid3 femur_from_robot;          // true
    std::vector<Cut> cuts;
    bool bone_changed = false;
    std::uint64_t motions = 0;  // executed
    std::vector<HeldObject> corkscrew;
    bool corkscrew_held = false;

    // The C-arm's pictures, of a room brought up to date.
    class Pictures final : public ImageSource {
      public:
        explicit Pictures(World& world) : world_(world) {}
        std::string name() const override { return world_.room->name(); }
        ImageSourceCapabilities capabilities() const override { return world_.room->capabilities(); }
        Result<AcquiredImage> acquire(const ImageRequest& request, Progress& progress) override {
            if (auto ok = world_.bringUpToDate(); !ok) return ok.error();
            auto acquired = world_.room->acquire(request, progress);
            if (!acquired) return acquired.error();
            acquired->provenance.identity =
                fmt::format("simulated exposure {} after {} motions", ++exposures_, world_.motions);
            return acquired;
        }
        void beginAgain() { exposures_ = 0; }

      private:
        World& world_;
        int exposures_ = 0;
    };
    Pictures pictures{*this};

    double moved(const Rigid3& before, const Rigid3& after) {
        const Rigid3 from = femur_from_robot * before, to = femur_from_robot * after;
        const double felt = bone->cut(from, to);
        if (!cuts.empty() && bone->nearMatter(to)) {
            Cut& cut = cuts.back();
            bone_changed = true;
            if (cut.true_in_femur.empty() || (to.translation() - cut.true_in_femur.back()).norm() >= kRecordEvery) {
                cut.true_in_femur.push_back(to.translation());
                // What the encoders say: the true place without the robot's own calibration error, of which they know
                // nothing (which differs by 1e-5 of itself from one of these places to the other).
                cut.believed_in_robot.push_back(after.translation() -
                                                robot->calibrationErrorAt(after.translation()).head<3>());
            }
        }
        return felt;
    }

    Rigid3 trueRobotFromCorkscrew() const {
        return robot->trueRobotFromCutter() * theatre.flange_from_cutter.inverse() * theatre.flange_from_corkscrew;
    }

    Result<void> bringUpToDate() {
        if (bone_changed) {
            if (auto ok = room->setPatient(bone->remaining()); !ok) return ok;
            bone_changed = false;
        }
        const Rigid3 robot_from_corkscrew = trueRobotFromCorkscrew();
        const Vector3 middle =
            plan.femur_from_cavity.inverse() * (femur_from_robot * robot_from_corkscrew.translation());
        // Once it cuts, the cutter is in the spindle, and stays there.
        const bool clear = motions == 0 && middle.z() - theatre.layout.rod_radius_mm > plan.top_mm + kCorkscrewClear;
        for (const HeldObject& part : corkscrew) {
            if (clear && !corkscrew_held) {
                if (auto ok = room->hold(part); !ok) return ok;
            }
            if (!clear && corkscrew_held) {
                if (auto ok = room->release(part.name); !ok) return ok;
            } else if (clear) {
                if (auto ok = room->move(part.name, robot_from_corkscrew); !ok) return ok;
            }
        }
        corkscrew_held = clear;
        return {};
    }

    void motionBegins(const std::string& stage) {
        ++motions;
        cuts.push_back({stage, {}, {}});
        room->beginOccasion(motions);
        pictures.beginAgain();
    }

    Result<void> furnish() {
        auto made = VirtualOperatingRoom::create(plan.ct, theatre.room);
        if (!made) return made.error();
        room = std::make_unique<VirtualOperatingRoom>(std::move(*made));
        femur_from_robot = truthOf(*room).room_from_femur.inverse() * truthOf(*room).room_from_robot;

        const Material displaced =
            scenario.patient.kind == PatientKind::acrylic ? Material::acrylic : Material::corticalBone;
        auto beads = heldBeads("beads", plan.beads, HeldBy::patient, Rigid3());
        if (!beads) return beads.error();
        beads->displaces = displaced;
        if (auto ok = room->hold(std::move(*beads)); !ok) return ok;
        auto parts = heldCorkscrew("corkscrew", theatre.layout, HeldBy::robot, Rigid3());
        if (!parts) return parts.error();
        corkscrew = std::move(*parts);

        MilledBoneOptions milling;
        milling.fill_hu = scenario.cut.fill_hu;
        bone = std::make_unique<MilledBone>(
            plan.ct, Cutter{scenario.cut.cutter_radius_mm, scenario.cut.cutter_length_mm}, milling);
        auto observed = std::make_unique<ObservedRobot>(
            theatre.robot, [this](const Rigid3& before, const Rigid3& after) { return moved(before, after); },
            [this](const CheckedMotion& motion) { motionBegins(motion.stage()); });
        robot = observed.get();
        supervisor = std::make_unique<Supervisor>(std::move(observed));
        return {};
    }
};

Rigid3 bestRigid(const std::vector<Vector3>& p, const std::vector<Vector3>& q) {
    if (p.size() != q.size() || p.size() < 3) throw std::logic_error("bestRigid: at least three pairs of points");
    Eigen::Matrix3Xd from(3, p.size()), to(3, q.size());
    for (std::size_t n = 0; n < p.size(); ++n) {
        from.col(static_cast<Eigen::Index>(n)) = p[n];
        to.col(static_cast<Eigen::Index>(n)) = q[n];
    }
    const Eigen::Matrix4d motion = Eigen::umeyama(from, to, false);
    return {Eigen::Quaterniond(Matrix3(motion.topLeftCorner<3, 3>())), Vector3(motion.topRightCorner<3, 1>())};
}

Result<SimulatedOperation> SimulatedOperation::create(const Scenario& scenario, Progress& progress) {
    auto world = std::make_unique<World>();
    world->scenario = scenario;
    SubProgress planning(progress, 0, 0.8);
    auto plan = planOperation(scenario, planning);
    if (!plan) return plan.error();
    world->plan = std::move(*plan);
    auto theatre = theatreOf(scenario, world->plan);
    if (!theatre) return theatre.error();
    world->theatre = std::move(*theatre);
    if (auto ok = world->furnish(); !ok) return ok.error();
    progress.report(1, "operating room");
    return SimulatedOperation(std::move(world));
}

const Scenario& SimulatedOperation::scenario() const {
    return world_->scenario;
}

const PlannedOperation& SimulatedOperation::plan() const {
    return world_->plan;
}

Result<ProcedureSetup> SimulatedOperation::calibrate(Progress& progress) const {
    const Scenario& scenario = world_->scenario;
    const PlannedOperation& plan = world_->plan;
    auto calibrated = calibrateOperation(scenario, world_->theatre, progress);
    if (!calibrated) return calibrated.error();

    ProcedureSetup setup;
    setup.patient.name = scenario.patient.name;
    setup.patient.side = std::string(name(scenario.patient.side));
    setup.patient.ct = plan.ct;
    setup.patient.beads = plan.beads;
    Random random = streamOf(scenario, ScenarioStream::beads);
    for (Bead& bead : setup.patient.beads.beads)
        bead.center_mm += scenario.beads.error_mm * Vector3(random.normal(), random.normal(), random.normal());

    setup.plan.implant = plan.implant;
    setup.plan.mesh = plan.mesh;
    setup.plan.femur_from_cavity = plan.femur_from_cavity;
    setup.plan.cavity.offset_mm = scenario.cut.offset_mm;
    setup.plan.cavity.cutter_radius_mm = scenario.cut.cutter_radius_mm;
    setup.plan.cavity.top_mm = plan.top_mm;
    setup.plan.path.cutter = {scenario.cut.cutter_radius_mm, scenario.cut.cutter_length_mm};
    setup.plan.path.most_cusp_mm = scenario.cut.most_cusp_mm;
    setup.plan.stages = scenario.cut.stages;
    setup.plan.insets_mm = scenario.cut.insets_mm;

    ProcedureCalibration& calibration = setup.calibration;
    calibration.corkscrew = world_->theatre.layout;
    calibration.flange_from_corkscrew = calibrated->flange_from_corkscrew;
    calibration.flange_from_cutter = world_->theatre.flange_from_cutter;
    calibration.focal_length_sigma_mm = calibrated->focal_length_sigma_mm;
    calibration.image_centre_sigma_px = calibrated->image_centre_sigma_px;
    calibration.bead_sigma_mm = std::max(scenario.beads.error_mm, 0.005);
    calibration.local_distortion_mm = scenario.calibration.local_distortion_mm;
    const double tremble_mm = world_->theatre.robot.tremble_mm, tremble_rad = world_->theatre.robot.tremble_rad;
    calibration.robot_sigma_mm = std::hypot(scenario.robot.calibration_mm, tremble_mm);
    calibration.robot_sigma_rad = std::hypot(radiansFromDegrees(scenario.robot.calibration_deg), tremble_rad);
    calibration.location_sigma_mm = kLocationMm;
    calibration.location_sigma_rad = kLocationRad;
    calibration.location_sigma_roll_rad = kLocationRollRad;
    calibration.calibrated_utc = utcNow();
    setup.views = std::move(calibrated->views);
    if (auto ok = setup.validate(); !ok) return ok.error();
    return setup;
}

ProcedureEquipment SimulatedOperation::equipment() {
    return {&world_->pictures, world_->supervisor.get()};
}

Result<void> SimulatedOperation::replay(const std::string& stage, const std::vector<MotionStep>& steps) {
    const auto proposal = std::make_shared<const MotionProposal>(MotionProposal{stage, "replayed", steps});
    const auto one = ReplayChecker("replay").check(proposal), two = ReplayChecker("executed before").check(proposal);
    if (!one) return one.error();
    if (!two) return two.error();
    const auto motion = CheckedMotion::make(*one, *two);
    if (!motion) return motion.error();
    SimulatedRobot& robot = *world_->robot;
    const bool connect = robot.state() == RobotState::disconnected;
    if (connect) {
        if (auto ok = robot.connect(); !ok) return ok;
    }
    if (robot.state() == RobotState::disabled) {
        if (auto ok = robot.enable(); !ok) return ok;
    }
    robot.heartbeat();
    robot.advance(kHeartbeat);
    robot.heartbeat();
    if (auto ok = robot.execute(*motion); !ok) return ok;
    while (robot.state() == RobotState::executing) {
        robot.heartbeat();
        robot.advance(kHeartbeat);
    }
    const RobotState state = robot.state();
    const std::vector<RobotFeedback> feedback = robot.takeFeedback();
    if (state != RobotState::enabled)
        return noSolution(
            fmt::format("replay of {}", stage),
            fmt::format("a robot in the state {}: {}", name(state), feedback.empty() ? "" : feedback.back().reason),
            "a motion that goes through as it did before");
    if (connect) {
        if (auto ok = robot.disconnect(); !ok) return ok;
    }
    return {};
}

Rigid3 SimulatedOperation::robotFromCutter() const {
    const Rigid3& pose = world_->robot->trueRobotFromCutter();
    return pose.perturbed(-world_->robot->calibrationErrorAt(pose.translation()));
}

Result<CutTruth> SimulatedOperation::truthOfCut(const std::string& stage, const Rigid3& robot_from_cavity) const {
    const auto& cuts = world_->cuts;
    const auto cut = std::find_if(cuts.rbegin(), cuts.rend(), [&](const Cut& one) {
        return one.stage == stage && one.true_in_femur.size() >= 100;
    });
    if (cut == cuts.rend()) return noSolution("truth of " + stage, "no such cut", "a cut that was made");
    CutTruth truth;
    const Rigid3 femur_from_robot = bestRigid(cut->believed_in_robot, cut->true_in_femur);
    truth.femur_from_cavity = femur_from_robot * robot_from_cavity;
    double squares = 0;
    for (std::size_t n = 0; n < cut->true_in_femur.size(); ++n)
        squares += (femur_from_robot * cut->believed_in_robot[n] - cut->true_in_femur[n]).squaredNorm();
    truth.rms_mm = std::sqrt(squares / static_cast<double>(cut->true_in_femur.size()));
    return truth;
}

std::shared_ptr<const Volume> SimulatedOperation::patientNow() const {
    return world_->bone->remaining();
}

Volume SimulatedOperation::removedFraction() const {
    return world_->bone->removedFraction();
}

Rigid3 SimulatedOperation::femurFromRobot() const {
    return world_->femur_from_robot;
}

const ViewTruth& SimulatedOperation::newestView() const {
    const Truth& truth = truthOf(*world_->room);
    if (truth.views.empty()) throw std::logic_error("newestView: no picture was taken");
    return truth.views.back();
}

SimulatedOperation::SimulatedOperation(std::unique_ptr<World> world) : world_(std::move(world)) {}
SimulatedOperation::SimulatedOperation(SimulatedOperation&&) noexcept = default;
SimulatedOperation& SimulatedOperation::operator=(SimulatedOperation&&) noexcept = default;
SimulatedOperation::~SimulatedOperation() = default;

}  // namespace fluorocut
