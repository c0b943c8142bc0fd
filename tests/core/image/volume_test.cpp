#include "core/image/volume.h"

#include <gtest/gtest.h>

namespace fluorocut {
namespace {

VolumeGrid obliqueGrid() {
    VolumeGrid grid;
    grid.size = {5, 6, 7};
    grid.spacing_mm = {0.5, 1.25, 3};
    grid.origin_mm = {-10, 20, 30};
    grid.direction = Rigid3::fromTwistRollPitch(0.3, -0.4, 2).rotationMatrix();
    grid.direction.col(2) *= -1;  // left-handed, as some scanners write
    return grid;
}

TEST(VolumeGrid, PointsAndIndicesAreInverse) {
    const VolumeGrid grid = obliqueGrid();
    const Vector3 index(1.5, -2, 4.25);
    EXPECT_LT((grid.indexFromPoint(grid.pointFromIndex(index)) - index).norm(), 1e-12);
    EXPECT_EQ(grid.pointFromIndex(Vector3::Zero()), grid.origin_mm);
}

TEST(SampleLinear, ReproducesALinearFunctionAndKnowsItsBorder) {
    Volume volume(obliqueGrid());
    for (int k = 0; k < 7; ++k)
        for (int j = 0; j < 6; ++j)
            for (int i = 0; i < 5; ++i)
                volume(i, j, k) = static_cast<float>(1 + 2 * i - 3 * j + 5 * k);
    EXPECT_FLOAT_EQ(sampleLinear(volume, {1.25, 3.5, 5.75}, -1), static_cast<float>(1 + 2 * 1.25 - 3 * 3.5 + 5 * 5.75));
    EXPECT_FLOAT_EQ(sampleLinear(volume, {4, 5, 6}, -1), volume(4, 5, 6));
    EXPECT_EQ(sampleLinear(volume, {4.001, 5, 6}, -1), -1);
    EXPECT_EQ(sampleLinear(volume, {NAN, 5, 6}, -1), -1);
}

}  // namespace
}  // namespace fluorocut
