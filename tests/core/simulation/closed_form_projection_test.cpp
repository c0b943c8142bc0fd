// The closed forms against meshes, against each other, and against pencil and paper.
#include "core/simulation/closed_form_projection.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/base/parallel.h"
#include "core/base/stopwatch.h"
#include "core/geometry/primitives.h"
#include "core/simulation/intensifier_distortion.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

CArm smallCArm() {
    CArm carm;
    carm.columns = 160;
    carm.rows = 120;
    carm.pixel_mm = {0.32, 0.32};
    carm.principal_point_px = {70.3, 66.1};
    return carm;
}

std::shared_ptr<const Distortion> strongDistortion() {
    IntensifierDistortionParameters p;
    p.field_radius_mm = 25;
    p.pincushion_mm = 1;
    p.s_shape_rad = 0.05;
    p.shift_mm = {0.4, -0.3};
    return *IntensifierDistortion::create(p);
}

double largestDifference(const Image& a, const Image& b) {
    double most = 0;
    for (std::size_t i = 0; i < a.size(); ++i)
        most = std::max(most, std::abs(double(a.pixels()[i]) - b.pixels()[i]));
    return most;
}

TEST(ClosedFormProjection, OfThePlateIsThatOfItsMesh) {
    GroovedPlate plate;
    plate.grooves = {6, 5};
    CArm carm = smallCArm();
    for (const PlateFacing facing : {PlateFacing::source, PlateFacing::detector}) {
        const auto mesh = plateSolid(plate, facing);
        ASSERT_OK(mesh);
        const auto projector = MeshProjector::prepare(*mesh);
        ASSERT_OK(projector);
        // Flat, turned, turned over, tilted so that rays cross several grooves, edge on, and nearer to the source.
        // Wholly in front of z = f, where the mesh projector ends.
        for (const Rigid3& pose : {Rigid3::fromTranslation({0.3, 1.1, 990}),
                                   Rigid3::fromTranslation({2, -1, 980}) * Rigid3::fromRotationVector({0, 0, 0.4}),
                                   Rigid3::fromTranslation({0, 0, 950}) * Rigid3::fromRotationVector({0, 3.14159, 0}),
                                   Rigid3::fromTranslation({0, 0, 900}) * Rigid3::fromRotationVector({0.7, -0.5, 0.2}),
                                   Rigid3::fromTranslation({1, 0, 900}) * Rigid3::fromRotationVector({1.55, 0.02, 0}),
                                   Rigid3::fromTranslation({0, 3, 500})}) {
            for (const auto& distortion : {std::shared_ptr<const Distortion>(), strongDistortion()}) {
                carm.distortion = distortion;
                const Image exact = platePathLengths(plate, facing, carm, pose);
                const Image meshed = projector->project(carm, pose);
                EXPECT_GT(*std::max_element(exact.pixels().begin(), exact.pixels().end()), 1);
                // Float rounding of lengths up to 50 mm; a ray that meets a wall exactly may take either side.
                EXPECT_LT(largestDifference(exact, meshed), 1e-5);
            }
        }
    }
}

// Means over pixels against 256 rays per pixel through the mesh. Those see a wall along the rows to 1/32 px, of 4.8 mm:
// 0.15 mm; turned and bent, as here, their errors cancel to a tenth of that. Planes of the closed form: less.
TEST(ClosedFormProjection, OfThePlateAveragesOverPixelsSlow) {
    GroovedPlate plate;
    plate.grooves = {6, 5};
    CArm carm = smallCArm();
    const auto projector = MeshProjector::prepare(*plateSolid(plate));
    ASSERT_OK(projector);
    for (const Rigid3& pose : {Rigid3::fromTranslation({2, -1, 980}) * Rigid3::fromRotationVector({0, 0, 0.4}),
                               Rigid3::fromTranslation({40, -50, 980}) * Rigid3::fromRotationVector({0, 0, 0.2}),
                               Rigid3::fromTranslation({0, 0, 950}) * Rigid3::fromRotationVector({0.2, 3, 0.3}),
                               Rigid3::fromTranslation({0, 0, 900}) * Rigid3::fromRotationVector({0.3, -0.2, 0.2}),
                               Rigid3::fromTranslation({1, 0, 900}) * Rigid3::fromRotationVector({1.5, 0.02, 0})}) {
        for (const auto& distortion : {std::shared_ptr<const Distortion>(), strongDistortion()}) {
            carm.distortion = distortion;
            const Image mean = platePathLengths(plate, PlateFacing::source, carm, pose, {16});
            const Image meshed = projector->project(carm, pose, {16});
            EXPECT_LT(largestDifference(mean, meshed), 0.05);
            double sum = 0;
            for (std::size_t i = 0; i < mean.size(); ++i)
                sum += double(mean.pixels()[i]) - meshed.pixels()[i];
            EXPECT_NEAR(sum / static_cast<double>(mean.size()), 0, 1e-3);
        }
    }
}

// Grooves that run along the rows: wherever the plate lies below the pixels, every pixel has its share of the groove.
TEST(ClosedFormProjection, OfThePlateShowsGroovesAlongPixelRowsWhereTheyAre) {
    CArm carm = smallCArm();
    carm.principal_point_px = {80, 60};
    const GroovedPlate plate;
    for (const double shift_mm : {0.0, 0.03, 0.11, 0.17, 0.2, 0.29}) {
        const Rigid3 pose = Rigid3::fromTranslation({0, shift_mm, 1000});
        const Image path = platePathLengths(plate, PlateFacing::source, carm, pose, {3});
        for (int y = 52; y <= 68; ++y) {  // x: in the middle of a land
            const double low = std::max((y - 60.5) * 0.32, shift_mm - 0.5 * plate.groove_width_mm);
            const double high = std::min((y - 59.5) * 0.32, shift_mm + 0.5 * plate.groove_width_mm);
            const double share = std::max(0.0, high - low) / 0.32;
            // Obliquely, by up to 2.6e-3 over half the depth of 4.76, a wall's shadow is 0.006 mm wide on either side.
            EXPECT_NEAR(path(90, y), plate.thickness_mm - share * plate.groove_depth_mm, 0.03) << shift_mm;
        }
    }
}

// A ray along z: thickness on a land, thickness less depth in a groove; obliquely longer by 1 / cos.
TEST(ClosedFormProjection, OfThePlateIsItsThicknessLessItsGrooves) {
    const GroovedPlate plate;  // on the detector: half of it behind the plane z = f
    CArm carm = smallCArm();
    carm.principal_point_px = {80, 60};
    const Image path = platePathLengths(plate, PlateFacing::source, carm, Rigid3::fromTranslation({0, 0, 1000}));
    const double groove = plate.thickness_mm - plate.groove_depth_mm;
    EXPECT_FLOAT_EQ(path(80, 60), static_cast<float>(groove));  // the origin is in a crossing
    EXPECT_NEAR(path(90, 60), groove * std::hypot(1, 3.2e-3), 1e-5);
    // Middle of a land, 3.2 mm off in x and y (pitch 6.35).
    EXPECT_NEAR(path(90, 70), plate.thickness_mm * std::sqrt(1 + 2 * 3.2e-3 * 3.2e-3), 1e-5);
    // Averaged over whole pitches the plate weakens by its volume over its area. 127 mm hold 20 pitches and 400 pixels
    // of 0.3175; rays 1000 mm long make it longer by less than 0.4 %: taken out below.
    CArm wide = carm;
    wide.columns = wide.rows = 400;
    wide.pixel_mm = {0.3175, 0.3175};
    wide.principal_point_px = {199.5, 199.5};
    const Image whole = platePathLengths(plate, PlateFacing::source, wide, Rigid3::fromTranslation({0, 0, 1000}), {4});
    double sum = 0;
    for (int y = 0; y < 400; ++y)
        for (int x = 0; x < 400; ++x)
            sum += whole(x, y) / (wide.detectorPoint(Vector2(x, y)).norm() / 1000);
    const double w = plate.groove_width_mm / plate.pitch_mm;
    const double expected = plate.thickness_mm - plate.groove_depth_mm * (2 * w - w * w);
    // The bundle widens within the plate by 0.5 %: 100 mm at the rim sees 0.3 mm more or less of a groove, which the
    // plate's symmetry about the middle plane of the grooves takes out to second order.
    EXPECT_NEAR(sum / 160000, expected, 1e-3 * expected);
}

TEST(ClosedFormProjection, OfGroovesAsDeepAsThePlate) {
    GroovedPlate plate;
    plate.groove_depth_mm = plate.thickness_mm;
    CArm carm = smallCArm();
    carm.principal_point_px = {80, 60};
    const Image path = platePathLengths(plate, PlateFacing::source, carm, Rigid3::fromTranslation({0, 0, 1000}));
    EXPECT_EQ(path(80, 60), 0);
    EXPECT_NEAR(path(90, 70), plate.thickness_mm, 1e-3);
}

TEST(ClosedFormProjection, OfASphereIsItsChord) {
    CArm carm = smallCArm();
    BeadLayout layout;
    layout.beads = {{"a", {3, -2, 0}, 8}};
    const Rigid3 pose = Rigid3::fromTranslation({0, 0, 700});
    const Image path = spherePathLengths(layout, carm, pose);
    // Through the middle of a pixel well inside.
    const Vector2 middle = carm.project(Vector3(3, -2, 700));
    const Vector2 pixel(std::round(middle.x()), std::round(middle.y()));
    const Vector3 direction = carm.rayDirection(pixel);
    const double off = direction.cross(Vector3(3, -2, 700)).norm();
    EXPECT_NEAR(path(static_cast<int>(pixel.x()), static_cast<int>(pixel.y())), 2 * std::sqrt(16 - off * off), 1e-6);
    // Lengths summed over the detector: the sphere's volume, magnified (f / z)^2 but for the cone's slant and depth
    // (2e-5 for a sphere of 8 mm at 700). Four rays per axis inside the rim integrate to 4e-5.
    double sum = 0;
    const Image fine = spherePathLengths(layout, carm, pose, {4});
    for (const float length : fine.pixels())
        sum += length;
    const double volume = 4.0 / 3 * M_PI * 64;
    EXPECT_NEAR(sum * 0.32 * 0.32 * std::pow(700.0 / 1000, 2), volume, 1e-4 * volume);
}

TEST(ClosedFormProjection, OfSpheresIsThatOfTheirMeshes) {
    BeadLayout layout;
    layout.beads = {{"a", {-8, 1, 0}, 6}, {"b", {5, 5, 30}, 3}, {"c", {9, -6, -200}, 3}};
    const Rigid3 pose = Rigid3::fromTranslation({1, -2, 800}) * Rigid3::fromRotationVector({0.1, 0.05, 0.3});
    CArm carm = smallCArm();
    for (const auto& distortion : {std::shared_ptr<const Distortion>(), strongDistortion()}) {
        carm.distortion = distortion;
        const Image exact = spherePathLengths(layout, carm, pose, {8});
        Image meshed(carm.columns, carm.rows);
        for (const Bead& bead : layout.beads) {
            const auto projector = MeshProjector::prepare(makeSphere(0.5 * bead.diameter_mm, 6));
            ASSERT_OK(projector);
            const Image one = projector->project(carm, pose * Rigid3::fromTranslation(bead.center_mm), {8});
            for (std::size_t i = 0; i < one.size(); ++i)
                meshed.pixels()[i] += one.pixels()[i];
        }
        // 82,000 facets of 0.02 mm on a radius of 3: sagitta 3e-5 mm, at the rim sqrt(2 * 3 * 3e-5) over part of a
        // pixel.
        EXPECT_LT(largestDifference(exact, meshed), 3e-3);
    }
}

// Where a bead lies to far less than a micron: the centroid of its shadow in path lengths does not depend on how its
// place falls on the pixels. 256 rays per pixel are the truth.
TEST(ClosedFormProjection, BeadsAreWhereTheyAreToWithinAMicron) {
    CArm carm = smallCArm();
    const Rigid3 pose = Rigid3::fromTranslation({0, 0, 990});
    const auto centroid = [&](const BeadLayout& layout, int samples) {
        const Image path = spherePathLengths(layout, carm, pose, {samples});
        Vector2 sum = Vector2::Zero();
        double weight = 0;
        for (int y = 0; y < path.height(); ++y)
            for (int x = 0; x < path.width(); ++x) {
                sum += path(x, y) * Vector2(x, y);
                weight += path(x, y);
            }
        return Vector2(sum / weight);
    };
    for (const double diameter : {1.5, 3.0}) {
        for (int n = 0; n < 10; ++n) {
            BeadLayout layout;
            layout.beads = {{"a", {0.0317 * n, -0.0213 * n, 0}, diameter}};
            const double error_mm = 0.32 * (centroid(layout, 2) - centroid(layout, 16)).norm();
            EXPECT_LT(error_mm, 1e-3) << diameter << " mm, place " << n;
        }
    }
}

TEST(ClosedFormProjection, OnlyWhatLiesBetweenSourceAndDetectorCounts) {
    const CArm carm = smallCArm();
    BeadLayout layout;
    layout.beads = {{"a", {0, 0, 0}, 8}};
    const auto at = [&](double z) {
        return spherePathLengths(layout, carm, Rigid3::fromTranslation({0, 0, z}))(70, 66);
    };
    EXPECT_EQ(at(-5), 0);
    EXPECT_EQ(at(1010), 0);
    EXPECT_NEAR(at(1000), 4, 2e-3);  // 0.3 px off its middle: 0.1 mm of 4, 1.3e-3 mm of the chord's half
    EXPECT_NEAR(at(0), 4, 2e-3);
    EXPECT_NEAR(at(500), 8, 4e-3);
}

TEST(ClosedFormProjection, DoesNotDependOnTheNumberOfThreads) {
    CArm carm = smallCArm();
    carm.distortion = strongDistortion();
    BeadLayout layout;
    layout.beads = {{"a", {-8, 1, 0}, 6}, {"b", {-6, 5, 30}, 6}};
    const auto both = [&] {
        const Rigid3 pose = Rigid3::fromTranslation({1, -2, 900});
        return std::pair(platePathLengths({}, PlateFacing::source, carm, pose, {2}),
                         spherePathLengths(layout, carm, pose, {2}));
    };
    const auto many = both();
    const ThreadLimit one(1);
    EXPECT_EQ(both(), many);
}

// A whole picture with 9 rays per pixel takes less than a second; here a quarter of it, with room for a busy machine.
TEST(ClosedFormProjection, OfALargePlateIsQuick) {
    CArm carm;
    carm.columns = carm.rows = 512;
    IntensifierDistortionParameters bending;
    bending.pincushion_mm = 2;
    bending.s_shape_rad = 0.02;
    carm.distortion = *IntensifierDistortion::create(bending);
    const Stopwatch stopwatch;
    const Image path = platePathLengths({}, PlateFacing::source, carm, Rigid3::fromTranslation({0, 0, 1000}), {3});
    const double ms = stopwatch.ms();
    EXPECT_EQ(path.width(), 512);
    RecordProperty("milliseconds", std::to_string(ms));
    EXPECT_LT(ms, 5000);
}

}  // namespace
}  // namespace fluorocut
