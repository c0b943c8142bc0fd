// An operation made from a scenario, without the procedure: what it gives away, what a cut does to the patient, and
// whether its truth is true.
#include "core/experiments/simulated_operation.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/units.h"
#include "core/fiducial/femur_beads.h"
#include "core/planning/cavity.h"
#include "core/procedure/cutting_motion.h"
#include "core/simulation/cutting.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

// A small block, a small pocket, small pictures.
Scenario smallScenario() {
    Scenario scenario;
    scenario.name = "test";
    scenario.patient.name = "Block";
    scenario.patient.kind = PatientKind::acrylic;
    scenario.patient.bone_above_hu = 80;
    scenario.patient.block_mm = {44, 44, 50};
    scenario.implant.stem.clear();
    scenario.implant.cuboid_mm = Vector3(18, 16, 20);
    scenario.cut.cutter_radius_mm = 3;
    scenario.cut.stages = 1;
    scenario.carm.columns = 320;
    scenario.carm.pixel_mm = 0.6;
    scenario.carm.pincushion_mm = scenario.carm.s_shape_rad = scenario.carm.field_shift_mm = 0;
    scenario.carm.round_field = false;
    scenario.calibration.pictures = false;
    scenario.corkscrew.layout = "corkscrew-paper";
    return scenario;
}

SimulatedOperation make(const Scenario& scenario) {
    auto operation = SimulatedOperation::create(scenario);
    if (!operation) throw std::runtime_error(operation.error().message());
    return std::move(*operation);
}

// The whole cavity, sent where `robot_from_cavity` says.
std::vector<MotionStep> motionFor(const SimulatedOperation& operation, const ProcedureSetup& setup,
                                  const Rigid3& robot_from_cavity, Cavity& cavity) {
    auto planned = planCavity(setup.plan.mesh, setup.plan.cavity);
    if (!planned) throw std::runtime_error(planned.error().message());
    auto path = planToolPath(planned->field, planned->mesh, planned->top_mm, setup.plan.path);
    if (!path) throw std::runtime_error(path.error().message());
    auto steps = cuttingMotion(
        *path, {robot_from_cavity, operation.robotFromCutter(), setup.plan.path.openPlane(planned->top_mm)});
    if (!steps) throw std::runtime_error(steps.error().message());
    cavity = std::move(*planned);
    return std::move(*steps);
}

Image picture(SimulatedOperation& operation, const ProcedureView& view) {
    ImageRequest request;
    request.position = view.position;
    auto acquired = operation.equipment().images->acquire(request, Progress::none());
    if (!acquired) throw std::runtime_error(acquired.error().message());
    return std::move(acquired->image);
}

TEST(SimulatedOperation, TheSameScenarioGivesTheSameSetupAndPictures) {
    const Scenario scenario = smallScenario();
    SimulatedOperation one = make(scenario), two = make(scenario);
    const auto a = one.calibrate(), b = two.calibrate();
    ASSERT_OK(a);
    ASSERT_OK(b);
    const auto& mount = a->calibration.flange_from_corkscrew.target_from_source;
    EXPECT_EQ(mount.deltaFrom(b->calibration.flange_from_corkscrew.target_from_source).norm(), 0);
    for (std::size_t n = 0; n < a->patient.beads.beads.size(); ++n)
        EXPECT_EQ(a->patient.beads.beads[n].center_mm, b->patient.beads.beads[n].center_mm);
    EXPECT_EQ(picture(one, a->views[0]), picture(two, b->views[0]));
    Scenario other = scenario;
    other.seed = 2;
    SimulatedOperation three = make(other);
    const auto c = three.calibrate();
    ASSERT_OK(c);
    EXPECT_GT(mount.deltaFrom(c->calibration.flange_from_corkscrew.target_from_source).norm(), 1e-3);
}

// What the setup states as unknown is: none of it is the truth, all of it within five standard deviations.
TEST(SimulatedOperation, TheSetupHoldsNoTruth) {
    SimulatedOperation operation = make(smallScenario());
    const auto setup = operation.calibrate();
    ASSERT_OK(setup);
    const BeadLayout& truth = operation.plan().beads;
    ASSERT_EQ(setup->patient.beads.beads.size(), truth.beads.size());
    for (std::size_t n = 0; n < truth.beads.size(); ++n) {
        const double error = (setup->patient.beads.beads[n].center_mm - truth.beads[n].center_mm).norm();
        EXPECT_GT(error, 0);
        EXPECT_LT(error, 5 * std::sqrt(3.0) * setup->calibration.bead_sigma_mm);
    }
    EXPECT_EQ(setup->patient.beads.beads.size(), 8U);
    ASSERT_TRUE(setup->calibration.flange_from_corkscrew.covariance.has_value());
    const Scenario scenario = smallScenario();
    const double place =
        std::hypot(scenario.calibration.hand_eye_place_sigma_mm, scenario.corkscrew.knock_place_sigma_mm);
    EXPECT_NEAR((*setup->calibration.flange_from_corkscrew.covariance)(0, 0), place * place, 1e-12);
}

TEST(SimulatedOperation, BeadsLieInTheBlockAndClearOfTheCavity) {
    const SimulatedOperation operation = make(smallScenario());
    const PlannedOperation& plan = operation.plan();
    for (const Bead& bead : plan.beads.beads) {
        const Vector3 p = plan.femur_from_cavity.inverse() * bead.center_mm;
        const Vector3 block = bead.center_mm.cwiseAbs();
        EXPECT_LT(block.maxCoeff() + 1, 25);
        const bool beside = std::abs(p.x()) > 9 + 4 || std::abs(p.y()) > 8 + 4 || p.z() < -20 - 4;
        EXPECT_TRUE(beside) << p.transpose();
    }
}

// Sent to a wrong place by a known error: the truth says by how much, and so does the hole itself.
TEST(SimulatedOperationSlow, TheTruthOfACutIsTheErrorItWasSentWith) {
    Scenario scenario = smallScenario();
    scenario.robot.calibration_mm = scenario.robot.calibration_deg = 0;
    SimulatedOperation operation = make(scenario);
    const auto setup = operation.calibrate();
    ASSERT_OK(setup);
    const Image before = picture(operation, setup->views[0]);
    const Rigid3 planned = setup->plan.femur_from_cavity;
    Vector6 error;
    error << 0.8, -0.5, 0.3, 0.01, -0.02, 0.015;
    const Rigid3 wrong = planned.perturbed(error);
    const Rigid3 sent = operation.femurFromRobot().inverse() * wrong;
    Cavity cavity;
    const auto steps = motionFor(operation, *setup, sent, cavity);
    const auto cut = operation.replay("stage 1 of 1", steps);
    ASSERT_OK(cut);

    const auto truth = operation.truthOfCut("stage 1 of 1", sent);
    ASSERT_OK(truth);
    // A robot without calibration error: its tremble of 12 um is told by encoders, and the fit is of a thousand places.
    const Vector6 found = truth->femur_from_cavity.deltaFrom(planned);
    EXPECT_LT((found - error).head<3>().norm(), 0.002);
    EXPECT_LT((found - error).tail<3>().norm(), 1e-4);
    EXPECT_LT(truth->rms_mm, 0.001);
    EXPECT_FALSE(operation.truthOfCut("stage 2 of 2", sent).ok());

    // The paper's calipers: the walls' thickness on either side, 8 mm below the face, from the voxels that are left.
    const Volume gone = operation.removedFraction();
    const VolumeGrid& grid = gone.grid();
    Vector2 sum = Vector2::Zero();
    double weight = 0;
    const int k = static_cast<int>(std::lround(grid.indexFromPoint(planned * Vector3(0, 0, -8)).z()));
    for (int j = 0; j < grid.size[1]; ++j)
        for (int i = 0; i < grid.size[0]; ++i) {
            sum += gone(i, j, k) * grid.pointFromIndex(Vector3(i, j, k)).head<2>();
            weight += gone(i, j, k);
        }
    const Vector3 level = grid.pointFromIndex(Vector3(0, 0, k));
    // Where the wrong cavity's axis passes that level.
    const Vector3 axis = wrong.rotate(Vector3::UnitZ());
    const Vector3 expected = wrong.translation() + axis * ((level.z() - wrong.translation().z()) / axis.z());
    // Cusps of 0.05 mm, not the same on both sides of a section.
    EXPECT_LT((sum / weight - expected.head<2>()).norm(), 0.02);

    // All of it: what is gone is the cavity's mesh at the wrong place.
    const auto mesh_cut = cutMesh(*setup->patient.ct, cavity.mesh, wrong);
    ASSERT_OK(mesh_cut);
    double squares = 0, volume = 0, expected_volume = 0;
    std::size_t count = 0;
    for (std::size_t n = 0; n < gone.voxels().size(); ++n) {
        if (setup->patient.ct->voxels()[n] < 120) continue;  // the open end, and air
        const double a = gone.voxels()[n], b = mesh_cut->removed_fraction.voxels()[n];
        volume += a;
        expected_volume += b;
        if (a + b > 0) {
            squares += (a - b) * (a - b);
            ++count;
        }
    }
    EXPECT_NEAR(volume, expected_volume, 0.012 * expected_volume);     // cusps, 0.03 mm of 1600 mm2
    EXPECT_LT(std::sqrt(squares / static_cast<double>(count)), 0.04);  // of a voxel: 0.03 mm

    const Image after = picture(operation, setup->views[0]);
    EXPECT_NE(before, after);

    // After a kill: the same world, the same cut, and so the same patient.
    SimulatedOperation again = make(scenario);
    const auto replayed = again.replay("stage 1 of 1", steps);
    ASSERT_OK(replayed);
    const Volume gone_again = again.removedFraction();
    double most = 0;
    for (std::size_t n = 0; n < gone.voxels().size(); ++n)
        most = std::max(most, static_cast<double>(std::abs(gone.voxels()[n] - gone_again.voxels()[n])));
    EXPECT_EQ(most, 0);
    EXPECT_EQ(picture(again, setup->views[0]), after);
}

TEST(SimulatedOperation, BestRigidFindsAKnownMotion) {
    Random random(3);
    const Rigid3 motion(expRotation({0.3, -0.2, 0.9}), Vector3(10, -20, 30));
    std::vector<Vector3> p, q;
    for (int n = 0; n < 20; ++n) {
        p.emplace_back(random.normal(), 10 * random.normal(), 40 * random.normal());
        q.push_back(motion * p.back());
    }
    EXPECT_LT(bestRigid(p, q).deltaFrom(motion).norm(), 1e-9);  // rounding
    p.resize(2);
    q.resize(2);
    EXPECT_THROW(bestRigid(p, q), std::logic_error);
}

// A CT with nothing hard in it, a stem that no canal takes: words, not crashes.
TEST(SimulatedOperation, SaysWhyItCannotBeMade) {
    Scenario scenario = smallScenario();
    scenario.patient.bone_above_hu = 2000;
    const auto no_bone = SimulatedOperation::create(scenario);
    ASSERT_FALSE(no_bone.ok());
    EXPECT_NE(no_bone.error().message().find("beads"), std::string::npos);
    scenario = smallScenario();
    scenario.corkscrew.layout = "no such corkscrew";
    EXPECT_FALSE(SimulatedOperation::create(scenario).ok());
    scenario = smallScenario();
    scenario.patient.kind = PatientKind::ct;
    scenario.patient.ct = "/no/such/file.nii";
    EXPECT_FALSE(SimulatedOperation::create(scenario).ok());
}

}  // namespace
}  // namespace fluorocut
