#include "core/distortion/plate_solid.h"

#include <algorithm>
#include <set>

#include <gmock/gmock.h>

#include "core/geometry/mesh_properties.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

struct Measures {
    double volume, area;
};

// Closed form: what the milling takes away, what it leaves.
Measures closedForm(const GroovedPlate& p, int a, int b) {
    const double w = p.groove_width_mm, d = p.groove_depth_mm;
    const double width = a * p.pitch_mm, height = b * p.pitch_mm;
    const double grooves_mm2 = a * w * height + b * w * width - a * b * w * w;
    // Round every land goes a wall of the groove's depth; below it the rim is whole.
    const double walls_mm = 2 * ((b + 1) * (width - a * w) + (a + 1) * (height - b * w));
    return {width * height * p.thickness_mm - d * grooves_mm2,
            2 * width * height + walls_mm * d + 2 * (width + height) * (p.thickness_mm - d)};
}

GroovedPlate plateWith(std::optional<std::array<int, 2>> grooves) {
    GroovedPlate plate;
    plate.grooves = grooves;
    return plate;
}

class PlateSolid : public testing::TestWithParam<PlateFacing> {};

TEST_P(PlateSolid, IsClosedAndHasTheVolumeAndAreaOfItsDrawing) {
    GroovedPlate odd_plate = plateWith(std::array{7, 4});
    odd_plate.groove_width_mm = 3;
    odd_plate.groove_depth_mm = 0.5;
    for (const GroovedPlate& plate : {plateWith(std::array{35, 33}), plateWith(std::array{4, 4}), odd_plate}) {
        const auto mesh = plateSolid(plate, GetParam());
        ASSERT_OK(mesh);
        const MeshProperties properties = meshProperties(*mesh);
        EXPECT_OK(requireSolid(properties, "plate"));
        EXPECT_TRUE(properties.closedManifold());
        EXPECT_EQ(properties.components, 1u);
        const auto [a, b] = *plate.grooves;
        const Measures expected = closedForm(plate, a, b);
        // Sums of thousands of doubles: rounding only.
        EXPECT_NEAR(properties.volume_mm3, expected.volume, 1e-9 * expected.volume);
        EXPECT_NEAR(properties.area_mm2, expected.area, 1e-9 * expected.area);
        const std::set<Triangle> distinct(mesh->triangles.begin(), mesh->triangles.end());
        EXPECT_EQ(distinct.size(), mesh->triangles.size());
    }
}

// No vertex lies inside another triangle's edge: every edge has two triangles (closedManifold), and every vertex is a
// corner of some triangle.
TEST_P(PlateSolid, UsesEveryVertex) {
    const auto mesh = plateSolid(plateWith(std::array{5, 6}), GetParam());
    ASSERT_OK(mesh);
    std::set<std::int32_t> used;
    for (const Triangle& triangle : mesh->triangles)
        used.insert(triangle.begin(), triangle.end());
    EXPECT_EQ(used.size(), mesh->vertices.size());
}

TEST_P(PlateSolid, LiesAsTheFramePlateSays) {
    const GroovedPlate plate = plateWith(std::array{5, 4});
    const PlateExtent extent = plateExtent(plate, GetParam());
    const auto mesh = plateSolid(plate, GetParam());
    ASSERT_OK(mesh);
    const MeshProperties properties = meshProperties(*mesh);
    const double p = plate.pitch_mm, depth = plate.groove_depth_mm;
    EXPECT_EQ(extent.first_groove, (std::array{-2, -1}));
    EXPECT_TRUE(properties.min_corner.head<2>().isApprox(Vector2(-2.5 * p, -1.5 * p)));
    EXPECT_TRUE(properties.max_corner.head<2>().isApprox(Vector2(2.5 * p, 2.5 * p)));
    EXPECT_EQ(extent.z_floor, -extent.z_land);
    if (GetParam() == PlateFacing::source) {
        EXPECT_EQ(extent.z_land, -0.5 * depth);  // z points away from the source
        EXPECT_EQ(properties.min_corner.z(), -0.5 * depth);
        EXPECT_EQ(properties.max_corner.z(), plate.thickness_mm - 0.5 * depth);
    } else {
        EXPECT_EQ(properties.max_corner.z(), 0.5 * depth);
        EXPECT_EQ(properties.min_corner.z(), 0.5 * depth - plate.thickness_mm);
    }
}

INSTANTIATE_TEST_SUITE_P(Both, PlateSolid, testing::Values(PlateFacing::source, PlateFacing::detector),
                         [](const auto& facing) {
                             return facing.param == PlateFacing::source ? "Source" : "Detector";
                         });

TEST(PlateSolidDefault, CoversATwelveInchFieldWithAModerateMesh) {
    for (const double pitch : {6.35, 6.0, 10.0, 25.4, 3.0}) {
        GroovedPlate plate = plateWith(std::nullopt);
        plate.pitch_mm = pitch;
        plate.groove_width_mm = 0.25 * pitch;
        const PlateExtent extent = plateExtent(plate);
        const double width = extent.high.x() - extent.low.x();
        EXPECT_GE(width, 304.8 - 1e-9);
        EXPECT_LT(width, 304.8 + 2 * pitch);                  // no more than that takes
        EXPECT_NEAR(extent.low.x(), -extent.high.x(), 1e-9);  // a crossing in the middle
        EXPECT_EQ(extent.low, Vector2(extent.low.y(), extent.low.x()));
    }
    const auto mesh = plateSolid(plateWith(std::nullopt));
    ASSERT_OK(mesh);
    EXPECT_OK(requireSolid(*mesh, "plate"));
    EXPECT_LT(mesh->triangles.size(), 50000u);
}

TEST(PlateSolidDefault, RefusesAPlateWithoutAFloor) {
    GroovedPlate plate = plateWith(std::array{4, 4});
    plate.groove_depth_mm = plate.thickness_mm;
    const auto mesh = plateSolid(plate);
    ASSERT_FALSE(mesh.ok());
    EXPECT_THAT(mesh.error().message(), testing::HasSubstr("falls to pieces"));
    plate.groove_depth_mm = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(plateSolid(plate).ok());
}

}  // namespace
}  // namespace fluorocut
