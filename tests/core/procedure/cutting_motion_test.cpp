#include "core/procedure/cutting_motion.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/cutting/envelope_check.h"
#include "core/geometry/primitives.h"
#include "core/procedure/stage_plan.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

TriangleMesh makeBoxAt(const Vector3& size_mm, const Vector3& middle_mm) {
    TriangleMesh mesh = makeBox(size_mm);
    for (Vector3& vertex : mesh.vertices)
        vertex += middle_mm;
    return mesh;
}

// A pocket of 12 x 12 x 8 mm, somewhere in the robot's frame, and the cutter standing aside.
class CuttingMotion : public testing::Test {
  protected:
    void SetUp() override {
        CavityOptions cavity;
        cavity.cutter_radius_mm = 3;
        Result<Cavity> final = planCavity(makeBoxAt({12, 12, 8}, {0, 0, -4}), cavity);
        ASSERT_OK(final);
        Result<PlannedCut> cut = planCut(*final, 0, options_);
        ASSERT_OK(cut);
        path_ = cut->path.path();
        place_.open_mm = options_.openPlane(cut->cavity.top_mm);
        place_.robot_from_cavity = Rigid3(expRotation({0.3, -0.2, 0.5}), {20, -30, 10});
        place_.robot_from_cutter = place_.robot_from_cavity * Rigid3(expRotation({0.2, 0.1, -1}), {60, 20, 25});
        Result<TriangleMesh> envelope = openedUpward(cut->cavity.mesh, place_.open_mm);
        ASSERT_OK(envelope);
        envelope_ = {options_.cutter, *envelope, place_.open_mm, place_.robot_from_cavity};
    }

    std::vector<MotionStep> steps() const { return cuttingMotion(path_, place_).value(); }
    // Whether by mesh, by voxels; asked together, since they must agree.
    std::pair<bool, bool> verdicts(const std::vector<MotionStep>& steps) const {
        const auto proposal = std::make_shared<const MotionProposal>(MotionProposal{"stage 1", "r", steps});
        return {MeshMotionChecker(envelope_).check(proposal).ok(), VoxelMotionChecker(envelope_).check(proposal).ok()};
    }
    static constexpr std::pair<bool, bool> kBoth{true, true}, kNeither{false, false};

    Vector3 inCavity(const MotionStep& step) const {
        return place_.robot_from_cavity.inverse() * step.robot_from_cutter.translation();
    }
    // The first step with the cutter's ball wholly in the cavity.
    std::size_t deep(const std::vector<MotionStep>& steps) const {
        for (std::size_t i = 0; i < steps.size(); ++i)
            if (inCavity(steps[i]).z() < -3.5) return i;
        ADD_FAILURE() << "never deep";
        return 0;
    }

    ToolPathOptions options_;
    ToolPath path_;
    CuttingPlace place_;
    MotionEnvelope envelope_;
};

TEST_F(CuttingMotion, BeginsAndEndsWhereTheCutterStandsAndRunsThePathInBetween) {
    const std::vector<MotionStep> motion = steps();
    EXPECT_LT(motion.front().robot_from_cutter.deltaFrom(place_.robot_from_cutter).norm(), 1e-9);
    EXPECT_LT(motion.back().robot_from_cutter.deltaFrom(place_.robot_from_cutter).norm(), 1e-9);
    // Every place of the path, in its order, with its spindle.
    std::size_t at = 0;
    for (const ToolMove& move : path_.moves) {
        while (at < motion.size() && (inCavity(motion[at]) - move.segment.to_mm).norm() > 1e-9)
            ++at;
        ASSERT_LT(at, motion.size());
        const Vector3 spindle =
            place_.robot_from_cavity.inverse().rotate(motion[at].robot_from_cutter.rotate(Vector3::UnitZ()));
        EXPECT_LT((spindle - move.segment.spindle).norm(), 1e-9);
    }
    // And it is high above before it goes aside.
    EXPECT_NEAR(inCavity(motion[1]).z(), place_.open_mm + kTravel_mm, 1e-9);
    const auto checked = [&](const MotionChecker& checker) {
        return checker.check(std::make_shared<const MotionProposal>(MotionProposal{"stage 1", "r", motion}));
    };
    const Result<CheckToken> mesh = checked(MeshMotionChecker(envelope_)),
                             voxels = checked(VoxelMotionChecker(envelope_));
    EXPECT_OK(mesh);
    EXPECT_OK(voxels);
}

TEST_F(CuttingMotion, FromHighAboveItNeedNotBeLifted) {
    place_.robot_from_cutter = place_.robot_from_cavity * Rigid3::fromTranslation({10, 5, place_.open_mm + 100});
    EXPECT_EQ(verdicts(steps()), kBoth);
}

TEST_F(CuttingMotion, AnotherRegistrationIsRefusedByBoth) {
    // The motion was made for a place 0.3 mm aside: the cutter would reach as far beyond the wall.
    CuttingPlace beside = place_;
    beside.robot_from_cavity = place_.robot_from_cavity * Rigid3::fromTranslation({0.3, 0, 0});
    EXPECT_EQ(verdicts(cuttingMotion(path_, beside).value()), kNeither);
    // By 0.01 mm it stays within the tolerance of 0.05 mm.
    beside.robot_from_cavity = place_.robot_from_cavity * Rigid3::fromTranslation({0.01, 0, 0});
    EXPECT_EQ(verdicts(cuttingMotion(path_, beside).value()), kBoth);
}

TEST_F(CuttingMotion, ATamperedStepIsRefusedByBoth) {
    for (const Vector3& by : {Vector3(12, 0, 0), Vector3(0, -12, 0), Vector3(0, 0, -12)}) {
        std::vector<MotionStep> motion = steps();
        MotionStep& step = motion[deep(motion)];
        step.robot_from_cutter = Rigid3(step.robot_from_cutter.rotation(),
                                        step.robot_from_cutter.translation() + place_.robot_from_cavity.rotate(by));
        EXPECT_EQ(verdicts(motion), kNeither) << by.transpose();
    }
    std::vector<MotionStep> motion = steps();
    MotionStep& tilted = motion[deep(motion)];
    tilted.robot_from_cutter = tilted.robot_from_cutter * Rigid3::fromRotationVector({0.1, 0, 0});
    EXPECT_EQ(verdicts(motion), kNeither);
}

TEST_F(CuttingMotion, NothingButStraightUpAndDownNearTheBone) {
    // Aside before it is high.
    std::vector<MotionStep> motion = steps();
    motion[1].robot_from_cutter = place_.robot_from_cavity * Rigid3(expRotation({0.2, 0.1, -1}), {30, 20, 26});
    EXPECT_EQ(verdicts(motion), kNeither);
    // Straight from above the opening to where it stood.
    motion = steps();
    motion.erase(motion.end() - 2);
    while (inCavity(motion[motion.size() - 2]).z() > place_.open_mm)
        motion.erase(motion.end() - 2);
    EXPECT_EQ(verdicts(motion), kNeither);
    // Not back.
    motion = steps();
    motion.back().robot_from_cutter = motion[motion.size() - 2].robot_from_cutter * Rigid3::fromTranslation({0, 0, 0});
    while (inCavity(motion.back()).z() > -2)
        motion.pop_back();
    EXPECT_EQ(verdicts(motion), kNeither);
    // Down beside the opening, through what is there.
    CuttingPlace beside = place_;
    beside.robot_from_cavity = place_.robot_from_cavity * Rigid3::fromTranslation({30, 0, 0});
    EXPECT_EQ(verdicts(cuttingMotion(path_, beside).value()), kNeither);
}

TEST_F(CuttingMotion, AMotionThatNeverGoesDownIsNoCut) {
    std::vector<MotionStep> motion = steps();
    const MotionStep first = motion[0], second = motion[1];
    EXPECT_EQ(verdicts({first, second, first}), kNeither);
    EXPECT_EQ(verdicts({first, second}), kNeither);
}

TEST_F(CuttingMotion, APathThatIsEmptyOrEndsElsewhereIsRefused) {
    EXPECT_FALSE(cuttingMotion({}, place_).ok());
    ToolPath path = path_;
    path.moves.resize(path.moves.size() / 2);
    EXPECT_FALSE(cuttingMotion(path, place_).ok());
}

}  // namespace
}  // namespace fluorocut
