#include "core/image/bone_surface.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "core/geometry/mesh_properties.h"

namespace fluorocut {
namespace {

// Densities of a function of the place, averaged over nothing: steps are smoothed by 1 mm instead.
template <class Density>
Volume volumeOf(const VolumeGrid& grid, Density density) {
    Volume volume(grid);
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i)
                volume(i, j, k) = static_cast<float>(density(grid.pointFromIndex(Vector3(i, j, k))));
    return volume;
}

VolumeGrid cube(int size, double spacing_mm) {
    VolumeGrid grid;
    grid.size = {size, size, size};
    grid.spacing_mm = Vector3::Constant(spacing_mm);
    grid.origin_mm = Vector3::Constant(-0.5 * spacing_mm * (size - 1));
    return grid;
}

// 1000 HU between the two radii, 0 elsewhere; ramps 2 mm wide, 250 HU is reached 0.5 mm outside the middle of a ramp.
double shell(double r, double inner_mm, double outer_mm) {
    const auto step = [](double x) { return std::clamp(0.5 + 0.5 * x, 0.0, 1.0); };
    return 1000 * std::min(step(outer_mm - r), step(r - inner_mm));
}

BoneSurfaceOptions fine() {
    BoneSurfaceOptions options;
    options.voxel_mm = 1.6;
    return options;
}

TEST(BoneSurface, OfAHollowSphereIsItsOuterSurfaceAlone) {
    const Volume ct = volumeOf(cube(100, 0.8), [](const Vector3& p) { return shell(p.norm(), 20, 30); });
    const auto surface = boneSurface(ct, fine());
    ASSERT_TRUE(surface);
    const MeshProperties properties = meshProperties(*surface);
    EXPECT_TRUE(properties.closedManifold());
    EXPECT_EQ(properties.components, 1u);
    EXPECT_GT(properties.volume_mm3, 0);
    double squares = 0, worst = 0;
    for (const Vector3& p : surface->vertices) {
        squares += std::pow(p.norm() - 30.5, 2);
        worst = std::max(worst, std::abs(p.norm() - 30.5));
    }
    // Averaged to 1.6 mm: the header's 0.3 mm rms; nowhere half a voxel's diagonal (1.4 mm).
    EXPECT_LT(std::sqrt(squares / static_cast<double>(surface->vertices.size())), 0.3);
    EXPECT_LT(worst, 1.4);
}

TEST(BoneSurface, FillsACanalThatRunsOutOfTheGrid) {
    for (const bool turned : {false, true}) {
        VolumeGrid grid = cube(60, 0.8);
        // The body's axis along k, or along i.
        if (turned) grid.direction << 0, 1, 0, 0, 0, 1, 1, 0, 0;
        grid.origin_mm = -(grid.direction * Vector3::Constant(0.4 * 59));
        const Volume ct = volumeOf(grid, [](const Vector3& p) { return shell(std::hypot(p.x(), p.y()), 7, 14); });
        const auto surface = boneSurface(ct, fine());
        ASSERT_TRUE(surface);
        const MeshProperties properties = meshProperties(*surface);
        EXPECT_TRUE(properties.closedManifold());
        for (const Vector3& p : surface->vertices) {
            const bool on_end = std::abs(p.z()) > 22;
            EXPECT_TRUE(on_end || std::hypot(p.x(), p.y()) > 12) << turned;  // never the canal's wall
        }
        // A rod of radius 14.5 between the outermost voxel centres, 29 x 1.6 mm apart: within a voxel of radius.
        EXPECT_NEAR(properties.volume_mm3 / (M_PI * 14.5 * 14.5 * 29 * 1.6), 1, 0.05);
    }
}

TEST(BoneSurface, LeavesSpecksOutButKeepsASecondBone) {
    const Volume ct = volumeOf(cube(80, 1), [](const Vector3& p) {
        return std::max({shell((p - Vector3(-15, 0, 0)).norm(), -9, 15), shell((p - Vector3(20, 0, 0)).norm(), -9, 12),
                         shell((p - Vector3(0, 30, 30)).norm(), -9, 3)});
    });
    BoneSurfaceOptions options;
    options.least_share = 0.08;
    EXPECT_EQ(meshProperties(*boneSurface(ct, options)).components, 2u);
    options.least_share = 0;
    EXPECT_EQ(meshProperties(*boneSurface(ct, options)).components, 3u);
}

TEST(BoneSurface, IsEmptyWithoutBone) {
    EXPECT_TRUE(boneSurface(Volume())->triangles.empty());
    EXPECT_TRUE(boneSurface(Volume(cube(10, 1), 40))->triangles.empty());
    EXPECT_TRUE(boneSurface(Volume(cube(10, 1), std::numeric_limits<float>::quiet_NaN()))->triangles.empty());
}

TEST(BoneSurface, AveragesALargeVolumeFurther) {
    const Volume ct = volumeOf(cube(90, 1), [](const Vector3& p) { return shell(p.norm(), -9, 30); });
    BoneSurfaceOptions few;
    few.voxel_mm = 1;
    const std::size_t fine = boneSurface(ct, few)->triangles.size();
    few.most_voxels = 50 * 50 * 50;
    const std::size_t coarse = boneSurface(ct, few)->triangles.size();
    EXPECT_NEAR(static_cast<double>(fine) / static_cast<double>(coarse), 4, 0.5);  // voxels twice as large
}

TEST(BoneSurface, RefusesOptionsOutsideTheirLimitsAndCanBeCancelled) {
    BoneSurfaceOptions bad;
    bad.voxel_mm = std::nan("");
    EXPECT_EQ(boneSurface(Volume(cube(10, 1)), bad).error().where, "voxel_mm");
    class Cancelled : public Progress {
        void report(double, std::string_view) override {}
        bool isCancelled() const override { return true; }
    } cancelled;
    EXPECT_TRUE(boneSurface(Volume(cube(10, 1)), {}, cancelled).error().isCancelled());
}

}  // namespace
}  // namespace fluorocut
