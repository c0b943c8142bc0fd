#include "core/fiducial/corkscrew_closed_form.h"

#include <cmath>
#include <functional>
#include <numbers>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/base/units.h"
#include "tests/core/fiducial/corkscrew_view.h"

namespace fluorocut {
namespace {

constexpr double kFocal = 1000;

CorkscrewLayout layoutNamed(const std::string& name) {
    return *readCorkscrew(std::string(FLUOROCUT_SOURCE_DIR) + "/resources/fiducials/" + name + ".json");
}

Rigid3 poseOf(double twist_deg, double roll_deg, double pitch_deg, const Vector3& place_mm) {
    return {Rigid3::fromTwistRollPitch(radiansFromDegrees(twist_deg), radiansFromDegrees(roll_deg),
                                       radiansFromDegrees(pitch_deg))
                .rotation(),
            place_mm};
}

using Projection = std::function<Vector2(const Vector3& in_imager)>;

// What a perfect measurement finds: each ring's ellipse by its extent along and across the line.
CorkscrewFeatures featuresOf(const CorkscrewLayout& layout, const Rigid3& pose, const Projection& project) {
    CorkscrewFeatures features;
    const Vector2 low = project(pose * Vector3(layout.shaft_x_mm[0], 0, 0));
    const Vector2 high = project(pose * Vector3(layout.shaft_x_mm[1], 0, 0));
    features.line_point_mm = low;
    features.line_direction = (high - low).normalized();
    const Vector2 across(-features.line_direction.y(), features.line_direction.x());
    const double rings = static_cast<double>(layout.rings.size());
    for (const CorkscrewRing& ring : layout.rings) {
        double least_u = 1e9, most_u = -1e9, least_v = 1e9, most_v = -1e9;
        for (int i = 0; i < 4000; ++i) {
            const Vector2 place = project(pose * ring.point(2 * std::numbers::pi * i / 4000)) - low;
            least_u = std::min(least_u, place.dot(features.line_direction));
            most_u = std::max(most_u, place.dot(features.line_direction));
            least_v = std::min(least_v, place.dot(across));
            most_v = std::max(most_v, place.dot(across));
        }
        features.ring_places_mm.push_back(0.5 * (least_u + most_u));
        features.minor_mm += 0.5 * (most_u - least_u) / rings;
        features.major_mm += 0.5 * (most_v - least_v) / rings;
    }
    for (int i = 0; i < 200; ++i)
        features.helix_mm.push_back(project(pose * layout.helix.point((i + 0.5) / 200)));
    return features;
}

struct Off {
    double twist_deg, roll_deg, pitch_deg, in_plane_mm, depth_mm;
};

Off offOf(const Rigid3& pose, const Rigid3& truth) {
    const Vector3 angles = pose.twistRollPitch() - truth.twistRollPitch();
    const auto degrees = [](double angle) {
        return std::abs(degreesFromRadians(std::remainder(angle, 2 * std::numbers::pi)));
    };
    const Vector3 move = pose.translation() - truth.translation();
    return {degrees(angles(0)), degrees(angles(1)), degrees(angles(2)), move.head<2>().norm(), std::abs(move.z())};
}

TEST(CorkscrewClosedForm, IsExactInWeakPerspective) {
    for (const char* name : {"corkscrew", "corkscrew-paper"}) {
        const CorkscrewLayout layout = layoutNamed(name);
        Random random(3);
        for (int i = 0; i < 20; ++i) {
            const double roll = (i % 2 ? 1 : -1) * random.uniform(5, 60);
            const Rigid3 truth = poseOf(random.uniform(-180, 180), roll, random.uniform(-180, 180),
                                        {random.uniform(-40, 40), random.uniform(-40, 40), random.uniform(600, 800)});
            const double scale = kFocal / truth.translation().z();
            const CorkscrewFeatures features =
                featuresOf(layout, truth, [&](const Vector3& p) { return Vector2(scale * p.head<2>()); });
            const auto pose = closedFormCorkscrewPose(features, layout, kFocal);
            ASSERT_TRUE(pose) << pose.error().message();
            const Off off = offOf(*pose, truth);
            // The ellipses' extents come from 4000 points: 3e-7 of a radius. The helix is drawn with 90 chords, which
            // lie up to 0.015 mm inside of it: a thousandth of its radius.
            EXPECT_LT(off.roll_deg, 1e-3);
            EXPECT_LT(off.pitch_deg, 1e-9);
            EXPECT_LT(off.in_plane_mm, 1e-3);
            EXPECT_LT(off.depth_mm, 0.01);
            EXPECT_LT(off.twist_deg, 0.1) << name << " roll " << roll;
        }
    }
}

// The bias that the header states, over a grid of poses; it must also be there, or this would not be the paper's
// formula.
TEST(CorkscrewClosedForm, IsBiasedByPerspectiveWithinBounds) {
    const CorkscrewLayout layout = layoutNamed("corkscrew-paper");
    const CArm carm;
    const auto project = [](const Vector3& p) { return Vector2(kFocal * p.head<2>() / p.z()); };
    Off most_off{}, most_central{};
    const auto raise = [](Off& most, const Off& off) {
        most = {std::max(most.twist_deg, off.twist_deg), std::max(most.roll_deg, off.roll_deg),
                std::max(most.pitch_deg, off.pitch_deg), std::max(most.in_plane_mm, off.in_plane_mm),
                std::max(most.depth_mm, off.depth_mm)};
    };
    for (const double roll : {-45.0, -30.0, -15.0, 15.0, 30.0, 45.0}) {
        for (const double twist : {30.0, 120.0, 210.0, 300.0}) {
            for (const double pitch : {15.0, -40.0, 100.0}) {
                const Rigid3 central = poseOf(twist, roll, pitch, {0, 0, 700});
                const Rigid3 aside = poseOf(twist, roll, pitch, {25, -20, 700});
                const auto at_centre = closedFormCorkscrewPose(featuresOf(layout, central, project), layout, kFocal);
                const auto at_side = closedFormCorkscrewPose(featuresOf(layout, aside, project), layout, kFocal);
                ASSERT_TRUE(at_centre && at_side);
                raise(most_central, offOf(*at_centre, central));
                raise(most_off, offOf(*at_side, aside));
            }
        }
    }
    RecordProperty("aside",
                   fmt::format("{:.2f} {:.2f} {:.2f} deg {:.2f} {:.2f} mm", most_off.twist_deg, most_off.roll_deg,
                               most_off.pitch_deg, most_off.in_plane_mm, most_off.depth_mm));
    // The rays to (25, -20) mm lean by 2.6 degrees, and so do the angles of what is measured against them.
    EXPECT_GT(most_off.roll_deg, 1.5);
    EXPECT_LT(most_off.roll_deg, 3.2);
    EXPECT_LT(most_off.pitch_deg, 3.2);
    EXPECT_GT(most_off.twist_deg, 3);
    EXPECT_LT(most_off.twist_deg, 13);
    EXPECT_LT(most_off.depth_mm, 1.0);
    EXPECT_LT(most_off.in_plane_mm, 1.0);
    // On the axis the leaning cancels over the length; the middle of the rings is as far off.
    EXPECT_LT(most_central.roll_deg, 0.5);
    EXPECT_LT(most_central.pitch_deg, 1e-6);
    EXPECT_LT(most_central.twist_deg, 10);
}

TEST(CorkscrewClosedForm, MeasuresTheFeaturesOfAnImage) {
    for (const double roll : {25.0, -40.0, 12.0}) {
        test::CorkscrewView view;
        view.layout = layoutNamed("corkscrew-paper");
        view.imager_from_corkscrew = poseOf(70, roll, 35, {3, -2, 690});
        const Image image = test::pictureOf(view);
        Vector6 wrong;
        wrong << 0.3, -0.2, 3, 0.008, -0.006, 0.004;  // of a detection's candidate
        const Rigid3 near = view.imager_from_corkscrew.perturbed(wrong);
        const auto measured = measureCorkscrewFeatures(image, view.carm, view.layout, near);
        ASSERT_TRUE(measured) << measured.error().message();
        const CorkscrewFeatures exact = featuresOf(view.layout, view.imager_from_corkscrew, [](const Vector3& p) {
            return Vector2(kFocal * p.head<2>() / p.z());
        });
        EXPECT_NEAR(std::abs(measured->line_direction.dot(exact.line_direction)), 1, 1e-5);
        // Wires are found to some tenths of a pixel (0.32 mm); how far across a flat ellipse reaches shows little, as
        // the paper found.
        EXPECT_NEAR(measured->major_mm, exact.major_mm, 0.5);
        EXPECT_NEAR(measured->minor_mm, exact.minor_mm, 0.25);
        for (std::size_t i = 1; i < 4; ++i) {
            EXPECT_NEAR(measured->ring_places_mm[i] - measured->ring_places_mm[0],
                        exact.ring_places_mm[i] - exact.ring_places_mm[0], 0.3);
        }
        const auto pose = closedFormCorkscrewPose(*measured, view.layout, kFocal);
        ASSERT_TRUE(pose) << pose.error().message();
        const Off off = offOf(*pose, view.imager_from_corkscrew);
        // The bias of the formula (above) with that of the measurement: the paper's own level but for the twist.
        EXPECT_LT(off.twist_deg, 10) << roll;
        EXPECT_LT(off.roll_deg, 2) << roll;
        EXPECT_LT(off.pitch_deg, 0.5) << roll;
        EXPECT_LT(off.in_plane_mm, 1) << roll;
        EXPECT_LT(off.depth_mm, 8) << roll;
    }
}

TEST(CorkscrewClosedForm, RefusesTooLittle) {
    const CorkscrewLayout layout = layoutNamed("corkscrew-paper");
    const Rigid3 pose = poseOf(20, 20, 20, {0, 0, 700});
    CorkscrewFeatures features =
        featuresOf(layout, pose, [](const Vector3& p) { return Vector2(kFocal * p.head<2>() / p.z()); });
    CorkscrewFeatures few = features;
    few.helix_mm.resize(3);
    EXPECT_FALSE(closedFormCorkscrewPose(few, layout, kFocal));
    few = features;
    for (std::size_t i = 0; i < 3; ++i)
        few.ring_places_mm[i] = std::nan("");
    const auto one_ring = closedFormCorkscrewPose(few, layout, kFocal);
    ASSERT_FALSE(one_ring);
    EXPECT_EQ(one_ring.error().code, ErrorCode::noSolution);
    few = features;
    few.minor_mm = 2 * few.major_mm;
    EXPECT_FALSE(closedFormCorkscrewPose(few, layout, kFocal));

    const CArm carm;
    Image noise(512, 512);
    Random random(1);
    for (float& value : noise.pixels())
        value = static_cast<float>(random.uniform(900, 1100));
    EXPECT_FALSE(measureCorkscrewFeatures(noise, carm, layout, pose));
}

}  // namespace
}  // namespace fluorocut
