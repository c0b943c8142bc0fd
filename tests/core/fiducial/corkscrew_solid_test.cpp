// The corkscrew's parts as meshes, against Pappus and against the layout.
#include "core/fiducial/corkscrew_solid.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>

#include "core/geometry/mesh_properties.h"
#include "core/io/resources.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

constexpr double kPi = std::numbers::pi;

CorkscrewLayout layoutNamed(const char* name) {
    auto path = findResource("fiducials", name);
    EXPECT_OK(path);
    auto layout = readCorkscrew(*path);
    EXPECT_OK(layout);
    return *layout;
}

// Rod and shaft are exact; rings, helix and beads fall short by their facets (second order in the chord's angle,
// 2 pi / 512: 1.5e-4 of the volume; beads of 20480 triangles: 1e-3).
TEST(CorkscrewSolid, PartsHaveTheirClosedFormVolumes) {
    for (const char* name : {"corkscrew", "corkscrew-paper"}) {
        const CorkscrewLayout layout = layoutNamed(name);
        const auto solid = corkscrewSolid(layout);
        ASSERT_OK(solid);
        const auto volume = [](const TriangleMesh& mesh, std::size_t components) {
            const MeshProperties p = meshProperties(mesh);
            EXPECT_TRUE(p.closedManifold());
            EXPECT_EQ(p.components, components);
            EXPECT_OK(requireSolid(p, "part"));
            return p.volume_mm3;
        };
        const double rod_length = layout.rod_x_mm[1] - layout.rod_x_mm[0];
        const double shaft_length = layout.shaft_x_mm[1] - layout.shaft_x_mm[0];
        const double shaft_area = kPi * std::pow(layout.shaft_radius_mm, 2);
        EXPECT_NEAR(volume(solid->rod, 1) / (kPi * std::pow(layout.rod_radius_mm, 2) * rod_length), 1, 1e-9);
        EXPECT_NEAR(volume(solid->shaft_inside, 1) / (shaft_area * rod_length), 1, 1e-9);
        EXPECT_NEAR(volume(solid->shaft_outside, 2) / (shaft_area * (shaft_length - rod_length)), 1, 1e-9);
        ASSERT_EQ(solid->rings.size(), layout.rings.size());
        for (std::size_t i = 0; i < layout.rings.size(); ++i) {
            const CorkscrewRing& ring = layout.rings[i];
            const double expected = 2 * kPi * ring.radius_mm * kPi * std::pow(ring.wire_radius_mm, 2);
            EXPECT_NEAR(volume(solid->rings[i], 1) / expected, 1, 1.5e-4);
            EXPECT_LT((meshProperties(solid->rings[i]).centroid - Vector3(ring.x_mm, 0, 0)).norm(), 1e-9);
        }
        // Pappus holds for a tube about any line whose sections' middles lie on it.
        const double helix = layout.helix.length_mm() * kPi * std::pow(layout.helix.wire_radius_mm, 2);
        EXPECT_NEAR(volume(solid->helix, 1) / helix, 1, 1.5e-4);
        ASSERT_EQ(solid->beads.size(), layout.beads.size());
        for (std::size_t i = 0; i < layout.beads.size(); ++i) {
            EXPECT_NEAR(volume(solid->beads[i], 1) / (4.0 / 3 * kPi * std::pow(layout.beads[i].radius_mm, 3)), 1, 1e-3);
            EXPECT_LT((meshProperties(solid->beads[i]).centroid - layout.beads[i].center_mm).norm(), 1e-9);
        }
    }
}

// For printing: fewer triangles, still solids, round to 0.02 mm.
TEST(CorkscrewSolid, CoarseIsSmallAndStillSolid) {
    const auto fine = corkscrewSolid({}), bad = corkscrewSolid(layoutNamed("corkscrew"), {8, 3, 2, 0});
    EXPECT_FALSE(fine.ok());  // no rings
    EXPECT_THAT(bad.error().message(), testing::HasSubstr("around_wire: found 2"));
    const CorkscrewLayout layout = layoutNamed("corkscrew");
    const auto solid = corkscrewSolid(layout, CorkscrewFineness::coarse());
    ASSERT_OK(solid);
    EXPECT_LT(solid->helix.triangles.size(), 10000u);
    EXPECT_OK(requireSolid(solid->helix, "helix"));
    for (const Vector3& v : solid->rod.vertices) {
        const double from_axis = v.tail<2>().norm();
        if (from_axis > 0) {
            EXPECT_NEAR(from_axis, layout.rod_radius_mm, 0.02);
        }
    }
}

// A shaft that ends within the rod has no outer part; one end only has one.
TEST(CorkscrewSolid, TheShaftIsCutWhereTheRodEnds) {
    CorkscrewLayout layout = layoutNamed("corkscrew");
    layout.shaft_x_mm = {-52, 50};
    auto solid = corkscrewSolid(layout);
    ASSERT_OK(solid);
    EXPECT_TRUE(solid->shaft_outside.triangles.empty());
    EXPECT_NEAR(meshProperties(solid->shaft_inside).volume_mm3, kPi * 2.25 * 102, 1e-6);
    layout.shaft_x_mm = {-52, 70};
    solid = corkscrewSolid(layout);
    ASSERT_OK(solid);
    EXPECT_NEAR(meshProperties(solid->shaft_outside).volume_mm3, kPi * 2.25 * 17, 1e-6);
    EXPECT_NEAR(meshProperties(solid->shaft_outside).min_corner.x(), 53, 1e-12);
}

}  // namespace
}  // namespace fluorocut
