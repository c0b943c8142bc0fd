#include "core/simulation/acrylic_phantom.h"

#include <cmath>
#include <numbers>
#include <set>

#include "core/base/parallel.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

// The volume of everything denser than air, mm3, when all of it has `hu`.
double materialVolume(const Volume& ct, double hu) {
    double sum = 0;
    for (const float voxel : ct.voxels())
        sum += (voxel + 1000.0) / (hu + 1000.0);
    return sum * ct.grid().spacing_mm.prod();
}

TEST(AcrylicBlock, HasTheVolumeOfABoxWhateverTheVoxels) {
    for (const double voxel_mm : {0.7, 0.93, 1.3}) {
        AcrylicOptions options;
        options.size_mm = {30.3, 41.7, 52.9};
        options.voxel_mm = voxel_mm;
        const auto block = generateAcrylicBlock(options);
        ASSERT_OK(block);
        // Faces are exact; what is left is float rounding of the voxels.
        EXPECT_NEAR(materialVolume(block->ct, options.acrylic_hu) / options.size_mm.prod(), 1, 1e-6) << voxel_mm;
    }
}

TEST(AcrylicBlock, RoundedEdgesHaveTheVolumeOfARoundedBox) {
    AcrylicOptions options;
    options.size_mm = {30, 40, 50};
    options.edge_radius_mm = 6;
    options.voxel_mm = 1.1;
    const auto block = generateAcrylicBlock(options);
    ASSERT_OK(block);
    // Steiner: core box, slabs on its faces, quarter cylinders on its edges, eighths of a ball at its corners.
    const double r = 6, a = 18, b = 28, c = 38, pi = std::numbers::pi;
    const double expected =
        a * b * c + 2 * r * (a * b + b * c + c * a) + pi * r * r * (a + b + c) + 4.0 / 3.0 * pi * r * r * r;
    // The rounding takes away 2 % of the block; 512 points per voxel leave 1e-4 of it.
    EXPECT_NEAR(materialVolume(block->ct, options.acrylic_hu) / expected, 1, 1e-4);
}

TEST(AcrylicBlock, IsCentredAndMirrorSymmetric) {
    AcrylicOptions options;
    options.voxel_mm = 2;
    options.edge_radius_mm = 5;
    const auto block = generateAcrylicBlock(options);
    ASSERT_OK(block);
    const Volume& ct = block->ct;
    EXPECT_LT(ct.grid().center().norm(), 1e-12);
    for (int k = 0; k < ct.size(2); ++k)
        for (int j = 0; j < ct.size(1); ++j)
            for (int i = 0; i < ct.size(0); ++i)
                ASSERT_FLOAT_EQ(ct(i, j, k), ct(ct.size(0) - 1 - i, ct.size(1) - 1 - j, ct.size(2) - 1 - k));
    EXPECT_EQ(ct(0, 0, 0), -1000);
    EXPECT_EQ(ct(ct.size(0) / 2, ct.size(1) / 2, ct.size(2) / 2), 125);
}

TEST(AcrylicBlock, BeadsLieWhereReportedAndAddTheirVolume) {
    AcrylicOptions options;
    options.beads = 7;
    const auto block = generateAcrylicBlock(options);
    ASSERT_OK(block);
    ASSERT_EQ(block->bead_centers_mm.size(), 7u);

    AcrylicOptions plain_options = options;
    plain_options.beads = 0;
    const auto plain = generateAcrylicBlock(plain_options);
    ASSERT_OK(plain);
    const double voxel_mm3 = block->ct.grid().spacing_mm.prod();
    const double ball_mm3 = std::numbers::pi / 6 * std::pow(options.bead_diameter_mm, 3);
    std::set<double> levels;
    for (const Vector3& bead : block->bead_centers_mm) {
        levels.insert(bead.z());
        double volume = 0;
        Vector3 moment = Vector3::Zero();
        const Vector3 index = block->ct.grid().indexFromPoint(bead);
        for (int k = -4; k <= 4; ++k)
            for (int j = -4; j <= 4; ++j)
                for (int i = -4; i <= 4; ++i) {
                    const Vector3 at = (index + Vector3(i, j, k)).array().round();
                    const int x = int(at.x()), y = int(at.y()), z = int(at.z());
                    const double part = (block->ct(x, y, z) - plain->ct(x, y, z)) / (20000.0 - 125.0);
                    volume += part * voxel_mm3;
                    moment += part * voxel_mm3 * block->ct.grid().pointFromIndex(at);
                }
        // A 3 mm ball in 0.8 mm voxels of 512 points: 29,000 points, half a percent of them undecided at its surface.
        EXPECT_NEAR(volume / ball_mm3, 1, 0.005);
        EXPECT_LT((moment / volume - bead).norm(), 0.01);
        // Clear of the largest pocket of the paper, 23 x 23 mm around the axis.
        EXPECT_GT(std::max(std::abs(bead.x()), std::abs(bead.y())), 11.5 + 1.5);
    }
    EXPECT_EQ(levels.size(), 7u);
}

TEST(AcrylicBlock, DoesNotDependOnTheNumberOfThreads) {
    AcrylicOptions options;
    options.edge_radius_mm = 4;
    options.beads = 5;
    options.voxel_mm = 1.5;
    const auto many = generateAcrylicBlock(options);
    const ThreadLimit limit(1);
    const auto one = generateAcrylicBlock(options);
    ASSERT_OK(many);
    ASSERT_OK(one);
    EXPECT_EQ(many->ct.voxels(), one->ct.voxels());
}

TEST(AcrylicBlock, RefusesOptionsInWords) {
    const auto message = [](auto change) {
        AcrylicOptions options;
        change(options);
        const auto result = generateAcrylicBlock(options);
        return result.ok() ? std::string("accepted") : result.error().message();
    };
    EXPECT_THAT(message([](auto& o) { o.voxel_mm = 0; }),
                testing::HasSubstr("voxel_mm: found 0, expected 0.1 to 5 mm"));
    EXPECT_THAT(message([](auto& o) { o.voxel_mm = NAN; }), testing::HasSubstr("voxel_mm: found nan"));
    EXPECT_THAT(message([](auto& o) { o.size_mm.y() = -1; }), testing::HasSubstr("size_mm[1]"));
    EXPECT_THAT(message([](auto& o) { o.edge_radius_mm = 26; }), testing::HasSubstr("edge_radius_mm"));
    EXPECT_THAT(message([](auto& o) { o.beads = 25; }), testing::HasSubstr("beads"));
    EXPECT_THAT(message([](auto& o) {
                    o.size_mm = {500, 500, 500};
                    o.voxel_mm = 0.2;
                }),
                testing::HasSubstr("larger voxels"));
}

}  // namespace
}  // namespace fluorocut
