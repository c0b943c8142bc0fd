// From a stem's mesh to a path that may be run: the planned cavity's field, its path, what the path leaves of the
// cavity's mesh, and both checks.
#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "core/cutting/envelope_check.h"
#include "core/cutting/removal.h"
#include "core/geometry/primitives.h"
#include "core/image/voxelize.h"
#include "core/planning/cavity.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

// What a path has to keep to, whatever it cuts.
void expectGoodCut(const Cavity& cavity, const ToolPath& path, const ToolPathOptions& options) {
    EXPECT_EQ(path.unreached, 0);
    EXPECT_TRUE(path.warnings.empty());
    const Result<RemovalReport> removal = simulateRemoval(path, cavity.mesh, cavity.top_mm);
    ASSERT_OK(removal);
    EXPECT_LE(removal->outside_cusps_95_mm, 0.05);  // the aim is 0.1 mm
    EXPECT_LE(removal->left_95_mm, 0.1);
    EXPECT_LE(removal->most_beyond_mm, 0);  // half the path's tolerance inside the mesh
    const Result<TriangleMesh> envelope = openedUpward(cavity.mesh, options.openPlane(cavity.top_mm));
    ASSERT_OK(envelope);
    const Result<CheckedToolPath> checked = checkToolPath(path, options.cutter, *envelope);
    ASSERT_OK(checked);
    EXPECT_NEAR(checked->worstByMesh(), checked->worstByVoxels(), 0.1 * 0.25);
    EXPECT_LE(checked->worstByMesh(), 0);
}

TEST(PlannedStemSlow, IsCutToATenthOfAMillimetreInEveryStage) {
    const Result<Cavity> last = planCavity(makeStem());
    ASSERT_OK(last);
    const Result<Cavity> first = insetCavity(*last, 1.0);
    ASSERT_OK(first);
    ToolPathOptions options;
    double before_s = 0;
    for (const Cavity* cavity : {&*first, &*last}) {
        const Result<ToolPath> path = planToolPath(cavity->field, cavity->mesh, cavity->top_mm, options);
        ASSERT_OK(path);
        expectGoodCut(*cavity, *path, options);
        EXPECT_GT(path->time_s, before_s);
        before_s = path->time_s;
    }
}

TEST(PlannedStem, ThePathTakesTheCavitysVolumeOutOfACt) {
    StemShape shape;
    shape.length_mm = 60;
    const Result<Cavity> cavity = planCavity(makeStem(shape));
    ASSERT_OK(cavity);
    const Result<ToolPath> path = planToolPath(cavity->field, cavity->mesh, cavity->top_mm);
    ASSERT_OK(path);
    // A CT in which the cavity stands askew, its upper end (below the top by 5 mm) outside.
    const Rigid3 pose = Rigid3::fromTranslation({4, 5, 6}) * Rigid3::fromRotationVector({0.3, 0.2, -0.4});
    VolumeGrid grid;
    grid.size = {60, 60, 80};
    grid.spacing_mm = {0.7, 0.7, 0.8};
    grid.origin_mm = pose * Vector3(0, 0, -37) - Vector3(0.5 * 59 * 0.7, 0.5 * 59 * 0.7, 0.5 * 79 * 0.8);
    const Volume removed = removedFraction(*path, pose, grid);
    const Result<VoxelCoverage> planned = voxelize(cavity->mesh, pose, grid);
    ASSERT_OK(planned);
    const double above_mm = -5;
    double removed_mm3 = 0, planned_mm3 = 0, different_mm3 = 0;
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) {
                if ((pose.inverse() * grid.pointFromIndex(Vector3(i, j, k))).z() > above_mm) continue;
                const int a = i - planned->offset[0], b = j - planned->offset[1], c = k - planned->offset[2];
                const Volume& part = planned->fraction;
                const bool known =
                    a >= 0 && b >= 0 && c >= 0 && a < part.size(0) && b < part.size(1) && c < part.size(2);
                const double should = known ? static_cast<double>(part(a, b, c)) : 0;
                const double is = static_cast<double>(removed(i, j, k));
                planned_mm3 += should;
                removed_mm3 += is;
                different_mm3 += std::abs(is - should);
            }
    // A layer of 0.05 mm (left_95) on a wall of 4 mm2 per mm3 / 10: about 1 %; the rest is the voxels' own 0.01.
    EXPECT_GT(planned_mm3, 1000);
    EXPECT_NEAR(removed_mm3, planned_mm3, 0.015 * planned_mm3);
    EXPECT_LE(different_mm3, 0.03 * planned_mm3);
}

TEST(PlannedStem, TheCavityWithoutItsWayInIsNoEnvelope) {
    StemShape shape;
    shape.length_mm = 50;
    const Result<Cavity> cavity = planCavity(makeStem(shape));
    ASSERT_OK(cavity);
    const Result<ToolPath> path = planToolPath(cavity->field, cavity->mesh, cavity->top_mm);
    ASSERT_OK(path);
    const Result<CheckedToolPath> checked = checkToolPath(*path, path->cutter, cavity->mesh);
    ASSERT_FALSE(checked);
    EXPECT_NE(checked.error().found.find("above the open end"), std::string::npos) << checked.error().message();
}

}  // namespace
}  // namespace fluorocut
