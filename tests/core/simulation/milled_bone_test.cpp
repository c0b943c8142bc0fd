#include "core/simulation/milled_bone.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/geometry/primitives.h"
#include "core/planning/cavity.h"
#include "core/simulation/acrylic_phantom.h"
#include "core/simulation/cutting.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

std::shared_ptr<const Volume> block(double voxel_mm = 0.8) {
    AcrylicOptions options;
    options.voxel_mm = voxel_mm;
    auto phantom = generateAcrylicBlock(options);
    if (!phantom) throw std::runtime_error(phantom.error().message());
    return std::make_shared<const Volume>(std::move(phantom->ct));
}

// Along every move of a path in steps of 0.05 mm, as a robot's cycles do.
double run(MilledBone& bone, const ToolPath& path, const Rigid3& femur_from_cavity) {
    double felt = 0;
    for (const ToolMove& move : path.moves) {
        const double length = (move.segment.to_mm - move.segment.from_mm).norm();
        const int steps = std::max(1, static_cast<int>(std::ceil(length / 0.05)));
        const auto at = [&](int n) {
            const double t = static_cast<double>(n) / steps;
            return femur_from_cavity * Rigid3::fromTranslation((1 - t) * move.segment.from_mm + t * move.segment.to_mm);
        };
        for (int n = 1; n <= steps; ++n)
            felt += bone.cut(at(n - 1), at(n));
    }
    return felt;
}

struct Cuboid {
    Cavity cavity;
    ToolPath path;
    Rigid3 femur_from_cavity{expRotation({0.02, -0.03, 0.05}), Vector3(1.3, -0.7, 45)};
};
Cuboid cuboid() {
    TriangleMesh box = makeBox({18, 16, 20});
    for (Vector3& vertex : box.vertices)
        vertex.z() -= 10;
    CavityOptions shape;
    shape.cutter_radius_mm = 4;
    auto cavity = planCavity(box, shape);
    if (!cavity) throw std::runtime_error(cavity.error().message());
    ToolPathOptions how;
    how.cutter.radius_mm = 4;
    auto path = planToolPath(cavity->field, cavity->mesh, cavity->top_mm, how);
    if (!path) throw std::runtime_error(path.error().message());
    return {std::move(*cavity), std::move(*path)};
}

// What is left after the cutter has run is what is left when the cavity's mesh is taken out of the CT.
TEST(MilledBone, LeavesWhatTheCavitysMeshLeaves) {
    const auto whole = block();
    const Cuboid plan = cuboid();
    MilledBone bone(whole, plan.path.cutter);
    run(bone, plan.path, plan.femur_from_cavity);
    const auto expected = cutMesh(*whole, plan.cavity.mesh, plan.femur_from_cavity);
    ASSERT_OK(expected);
    const Volume removed = bone.removedFraction();
    const auto left = bone.remaining();
    double volume = 0, expected_volume = 0, squares = 0, hu_squares = 0;
    std::size_t touched = 0;
    for (std::size_t n = 0; n < removed.voxels().size(); ++n) {
        // Above the face there is only air, where the mesh ends and the shank does not.
        if (whole->voxels()[n] < 120) continue;
        const double now = removed.voxels()[n], then = expected->removed_fraction.voxels()[n];
        volume += now;
        expected_volume += then;
        if (now + then <= 0) continue;
        ++touched;
        squares += (now - then) * (now - then);
        hu_squares += std::pow(left->voxels()[n] - expected->volume.voxels()[n], 2);
    }
    // Cusps of at most 0.05 mm over some 1650 mm2 of surface are 1.4 % of the volume, half of it on the mean.
    EXPECT_NEAR(volume, expected_volume, 0.01 * expected_volume);
    EXPECT_LT(volume, expected_volume);
    // 0.05 mm of cusp is 0.06 of a voxel, in the fifth of the voxels that the surface passes through.
    EXPECT_LT(std::sqrt(squares / static_cast<double>(touched)), 0.03);
    EXPECT_LT(std::sqrt(hu_squares / static_cast<double>(touched)), 0.03 * 1125);  // 1125 HU from acrylic to air
}

// A cylinder bored straight down: closed form.
TEST(MilledBone, FeelsAndRemovesWhatABoredHoleHolds) {
    const auto whole = block(0.5);
    Cutter cutter;
    cutter.radius_mm = 5;
    MilledBone bone(whole, cutter);
    double felt = 0;
    const auto at = [](double z) { return Rigid3::fromTranslation({2.2, 3.1, z}); };
    for (double z = 60; z > 25; z -= 0.1)
        felt += bone.cut(at(z), at(z - 0.1));
    for (int n = 0; n < 200; ++n)  // what is pending
        felt += bone.cut(at(25), at(25));
    const double radius = cutter.radius_mm, depth = 45 - 25;
    const double hole = M_PI * radius * radius * depth + 2.0 / 3 * M_PI * std::pow(radius, 3);
    double removed = 0;
    const Volume fraction = bone.removedFraction();
    for (std::size_t n = 0; n < fraction.voxels().size(); ++n)
        if (whole->voxels()[n] > 120) removed += fraction.voxels()[n] * std::pow(0.5, 3);
    EXPECT_NEAR(removed, hole, 0.003 * hole);  // the face's voxels count whole or not at all: 0.1 mm of 20
    EXPECT_NEAR(felt, hole, 0.03 * hole);      // lumps of 0.5 mm, the ball looked at every 0.2 mm
    EXPECT_LT(bone.segments(), 10U);           // of 350 steps along a straight line
}

// Sideways below uncut material: the shank goes through it, the whole way up.
TEST(MilledBone, TheShankCutsWhereTheBallWasNot) {
    const auto whole = block(0.5);
    Cutter cutter;
    cutter.radius_mm = 3;
    MilledBone bone(whole, cutter);
    const auto at = [](double x) { return Rigid3::fromTranslation({x, 0, 25}); };
    for (double x = -40; x < 0; x += 0.05)
        bone.cut(at(x), at(x + 0.05));
    double removed = 0;
    const Volume fraction = bone.removedFraction();
    for (std::size_t n = 0; n < fraction.voxels().size(); ++n)
        if (whole->voxels()[n] > 120) removed += fraction.voxels()[n] * std::pow(0.5, 3);
    // A slot 25 long from the block's side, 6 wide, 20 deep to the ball's middle: its rounded end and the half round
    // floor.
    const double slot = 25 * 6 * 20 + 0.5 * M_PI * 9 * 20 + 25 * 0.5 * M_PI * 9 + 1.0 / 3 * M_PI * 27;
    EXPECT_NEAR(removed, slot, 0.03 * slot);  // the faces' voxels do not count: up to 0.5 mm of 20 and of 25
}

TEST(MilledBone, AirCostsNothing) {
    const auto whole = block();
    MilledBone bone(whole, Cutter{});
    const auto at = [](double x) { return Rigid3::fromTranslation({x, 0, 70}); };
    for (double x = -100; x < 100; x += 0.5)
        EXPECT_EQ(bone.cut(at(x), at(x + 0.5)), 0);
    EXPECT_FALSE(bone.nearMatter(at(0)));
    EXPECT_TRUE(bone.nearMatter(Rigid3::fromTranslation({0, 0, 47})));
    // The shank may meet what the ball does not: below the block, spindle up.
    EXPECT_TRUE(bone.nearMatter(Rigid3::fromTranslation({0, 0, -80})));
    const Volume fraction = bone.removedFraction();
    EXPECT_EQ(*std::max_element(fraction.voxels().begin(), fraction.voxels().end()), 0);
    EXPECT_THROW(MilledBone(nullptr, Cutter{}), std::logic_error);
}

}  // namespace
}  // namespace fluorocut
