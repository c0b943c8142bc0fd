#include "core/imaging/slab/slab_kernels.h"

#include <gtest/gtest.h>

#include "core/imaging/slab/slab_projector.h"
#include "tests/core/imaging/blob_volumes.h"

namespace fluorocut {
namespace {

// Every instruction set this processor runs gives the same image, up to the rounding of float32 (fused or not).
TEST(SlabKernels, AllInstructionSetsAgree) {
    Volume volume(test::centeredGrid({90, 70, 50}, {1, 1.3, 1.7}));
    Random random(3);
    for (float& hu : volume.voxels())
        hu = static_cast<float>(random.uniform(-1000, 2000));
    const SlabVolume slabs(volume, -1000);
    CArm carm;
    carm.columns = 150;
    carm.rows = 131;
    carm.pixel_mm = {1.3, 1.1};
    carm.principal_point_px = {80, 60};
    const SlabKernels* sets[3];
    const int count = slabKernelSets(sets);
    ASSERT_GE(count, 1);
    EXPECT_EQ(&slabKernels(), sets[count - 1]);
    for (const double angle : {10.0, 100.0}) {
        for (const double tilt : {5.0, 80.0}) {
            for (const int binning : {1, 2, 8}) {  // coarser steps take wider windows
                const ProjectionGeometry g = projectionGeometry(carm, test::orbit(angle, tilt), volume.grid());
                const int axis = nearestAxis(g);
                std::array<GeometryChange, 6> changes;
                for (std::size_t k = 0; k < 6; ++k) {
                    changes[k] = {Vector3::Unit(static_cast<int>(k % 3)), Vector3(1, 2, 3), Vector3(0.1, 0, 0.2),
                                  Vector3(0, 0.1, 0)};
                }
                std::array<Image, 6> gradient, other_gradient;
                const Image reference =
                    projectSlabWithGradient(slabs, g, axis, 2e-5, binning, changes, *sets[0], gradient);
                for (int s = 1; s < count; ++s) {
                    EXPECT_LT(test::normalizedRms(projectSlab(slabs, g, axis, 2e-5, binning, *sets[s]), reference),
                              2e-6)
                        << sets[s]->name << " " << angle << " " << tilt << " " << binning;
                    (void)projectSlabWithGradient(slabs, g, axis, 2e-5, binning, changes, *sets[s], other_gradient);
                    for (std::size_t k = 0; k < 6; ++k) {
                        EXPECT_LT(test::normalizedRms(other_gradient[k], gradient[k]), 1e-5)
                            << sets[s]->name << " " << k;
                    }
                }
            }
        }
    }
}

}  // namespace
}  // namespace fluorocut
