#include "core/fiducial/bead_pose.h"

#include <cmath>

#include <gmock/gmock.h>

#include "core/base/parallel.h"
#include "core/fiducial/detection/three_points.h"
#include "tests/core/fiducial/bead_views.h"

namespace fluorocut {
namespace {

using test::phantom;
using test::phantomPose;
using test::syntheticDetections;
using test::trueCArm;
using testing::HasSubstr;

void expectRightMatches(const BeadPose& pose, const test::SyntheticDetections& made) {
    for (const BeadMatch& match : pose.matches)
        EXPECT_EQ(made.bead[match.detection], static_cast<int>(match.bead));
}

TEST(ThreePoints, RootsAreThoseOfTheFactors) {
    const auto roots = detection::realRootsOfQuartic({-6, -5, 7, 5, -1});
    EXPECT_GE(roots.size(), 2U);
    // (x - 1)(x + 2)(x - 3)(x - 0.5) = x^4 - 2.5 x^3 - 4 x^2 + 8.5 x - 3
    const auto known = detection::realRootsOfQuartic({-3, 8.5, -4, -2.5, 1});
    ASSERT_EQ(known.size(), 4U);
    for (const double root : {1.0, -2.0, 3.0, 0.5}) {
        double nearest = 1e9;
        for (const double one : known)
            nearest = std::min(nearest, std::abs(one - root));
        EXPECT_LT(nearest, 1e-9);
    }
    for (const double x : roots)
        EXPECT_NEAR((((-x + 5) * x + 7) * x - 5) * x - 6, 0, 1e-6);
    EXPECT_TRUE(detection::realRootsOfQuartic({1, 0, 0, 0, 1}).empty());
}

TEST(ThreePoints, OneOfThePosesIsTheTrueOne) {
    Random random(3);
    for (int trial = 0; trial < 300; ++trial) {
        const auto any = [&](double size) {
            return Vector3(random.uniform(-size, size), random.uniform(-size, size), random.uniform(-size, size));
        };
        const Rigid3 truth = Rigid3::fromTranslation({random.uniform(-50, 50), random.uniform(-50, 50), 800}) *
                             Rigid3::fromRotationVector(any(2));
        const std::array<Vector3, 3> points{any(60), any(60), any(60)};
        std::array<Vector3, 3> directions;
        for (std::size_t i = 0; i < 3; ++i)
            directions[i] = (truth * points[i]).normalized();
        double nearest = 1e9;
        for (const Rigid3& pose : detection::posesFromThreePoints(points, directions))
            nearest = std::min(nearest, (pose.inverse() * truth).rotationAngle());
        // Narrow triangles far away are badly conditioned; 1e-4 rad is far inside what refinement takes up.
        EXPECT_LT(nearest, 1e-4) << trial;
    }
}

TEST(BeadPose, FindsThePhantomWithoutLabels) {
    Random random(11);
    const BeadLayout layout = phantom();
    for (int trial = 0; trial < 12; ++trial) {
        const CArm truth = trueCArm();
        const Rigid3 pose = phantomPose(random.uniform(-30, 30), random.uniform(-30, 30), random.uniform(-180, 180));
        const auto made = syntheticDetections(layout, truth, pose, 0.02, 0.2, 8, random);
        const auto found = estimateBeadPose(made.detections, layout, truth);
        ASSERT_OK(found);
        expectRightMatches(*found, made);
        EXPECT_GE(found->matches.size(), 16U);  // of 30, a fifth is missing and some lie outside
        // Depth is worst: sqrt(cov) is about 0.05 mm for two dozen beads at 0.02 px.
        EXPECT_LT((found->imager_from_layout.translation() - pose.translation()).norm(), 0.3);
        const Vector6 error = found->imager_from_layout.deltaFrom(pose);
        EXPECT_LT(error.dot(found->covariance.ldlt().solve(error)), 30);  // 6 degrees of freedom: 1 in 25,000
        EXPECT_EQ(found->matches.size() + found->missing.size() + found->outside.size(), layout.beads.size());
        EXPECT_LT(found->elapsed_ms, 2000);
    }
}

TEST(BeadPose, FindsItWithRoughIntrinsicsAndMeaninglessSizes) {
    Random random(12);
    const BeadLayout layout = phantom();
    for (int trial = 0; trial < 12; ++trial) {
        CArm truth = trueCArm();
        CArm nominal;
        nominal.focal_length_mm = truth.focal_length_mm * (trial % 2 == 0 ? 0.87 : 1.15);
        nominal.principal_point_px = truth.principal_point_px + Vector2(20, -20);
        const Rigid3 pose = phantomPose(random.uniform(-25, 25), random.uniform(-25, 25), random.uniform(-180, 180));
        auto made = syntheticDetections(layout, truth, pose, 0.05, 0.15, 6, random);
        if (trial % 3 == 0) {
            for (BeadDetection& one : made.detections)
                one.radius_px = 5;  // drawn all alike
        }
        BeadPoseOptions options;
        options.focal_sigma = 0.1;
        options.center_sigma_px = 20;
        const auto found = estimateBeadPose(made.detections, layout, nominal, options);
        ASSERT_OK(found) << trial;
        expectRightMatches(*found, made);
        EXPECT_GE(found->matches.size(), 16U);  // of 30, a fifth is missing and some lie outside
        EXPECT_LT(found->rms_px, 0.1);
        RecordProperty("elapsed_ms_" + std::to_string(trial), std::to_string(found->elapsed_ms));
        EXPECT_LT(found->elapsed_ms, 6000);  // 2 s where nothing else runs
    }
}

TEST(BeadPose, FindsFewBeadsInABone) {
    Random random(13);
    int found_count = 0;
    for (int trial = 0; trial < 20; ++trial) {
        BeadLayout layout{Frame::femur, {}};
        for (int i = 0; i < 7; ++i) {
            layout.beads.push_back(
                {std::to_string(i), {random.uniform(-35, 35), random.uniform(-25, 25), random.uniform(-60, 60)}, 1.5});
        }
        const CArm carm = trueCArm();
        const Rigid3 pose = phantomPose(90 + random.uniform(-20, 20), random.uniform(-20, 20), random.uniform(-20, 20));
        const auto made = syntheticDetections(layout, carm, pose, 0.05, 0.0, 3, random);
        const auto found = estimateBeadPose(made.detections, layout, carm);
        if (!found) continue;  // told that it cannot say
        ++found_count;
        expectRightMatches(*found, made);
    }
    EXPECT_GE(found_count, 17);
}

TEST(BeadPose, APhantomHasNoLookAlike) {
    // Of the mirrored phantom no pose explains half; from all sides, and for both resources.
    Random random(14);
    for (const char* name : {"two-plane", "two-plane-small"}) {
        const BeadLayout layout = phantom(name);
        BeadLayout mirrored = layout;
        for (Bead& bead : mirrored.beads)
            bead.center_mm.x() = -bead.center_mm.x();
        for (int trial = 0; trial < 3; ++trial) {
            const CArm carm = trueCArm();
            const Rigid3 pose = phantomPose(random.uniform(-40, 40) + (trial % 2) * 180, random.uniform(-40, 40),
                                            random.uniform(-180, 180));
            const auto wrong = syntheticDetections(mirrored, carm, pose, 0.03, 0, 0, random);
            const auto none = estimateBeadPose(wrong.detections, layout, carm);
            ASSERT_FALSE(none.ok()) << name;
            EXPECT_EQ(none.error().code, ErrorCode::noSolution);
            const auto right = syntheticDetections(layout, carm, pose, 0.03, 0, 0, random);
            const auto found = estimateBeadPose(right.detections, layout, carm);
            ASSERT_OK(found) << name;
            expectRightMatches(*found, right);
            if (found->second_best) {
                // Either few, or loosely: by chance some beads come to lie within some pixels.
                EXPECT_TRUE(found->second_best->beads <= 0.6 * static_cast<double>(layout.beads.size()) ||
                            found->second_best->rms_px > 1)
                    << name << " " << found->second_best->why_not;
                EXPECT_THAT(found->second_best->why_not, HasSubstr("it explains"));
            }
        }
    }
}

TEST(BeadPose, RefusesALayoutThatLooksAlikeFromTwoSides) {
    BeadLayout cube{Frame::phantom, {}};
    for (int i = 0; i < 8; ++i) {
        cube.beads.push_back({std::to_string(i),
                              {(i & 1) != 0 ? 30.0 : -30.0, (i & 2) != 0 ? 30.0 : -30.0, (i & 4) != 0 ? 30.0 : -30.0},
                              2});
    }
    Random random(15);
    const CArm carm = trueCArm();
    const auto made = syntheticDetections(cube, carm, phantomPose(20, 10, 5), 0.03, 0, 0, random);
    const auto found = estimateBeadPose(made.detections, cube, carm);
    ASSERT_FALSE(found.ok());
    EXPECT_EQ(found.error().code, ErrorCode::noSolution);
    EXPECT_THAT(found.error().message(), testing::AllOf(HasSubstr("two poses"), HasSubstr("looks alike")));
}

TEST(BeadPose, RefusesInWordsWhatIsNoPictureOfTheLayout) {
    Random random(16);
    const BeadLayout layout = phantom();
    const CArm carm = trueCArm();
    auto none = syntheticDetections({Frame::phantom, {}}, carm, phantomPose(0, 0, 0), 0, 0, 30, random);
    const auto found = estimateBeadPose(none.detections, layout, carm);
    ASSERT_FALSE(found.ok());
    EXPECT_THAT(found.error().message(), HasSubstr("best pose explains"));
    none.detections.resize(2);
    const auto two = estimateBeadPose(none.detections, layout, carm);
    ASSERT_FALSE(two.ok());
    EXPECT_THAT(two.error().message(), HasSubstr("2 bead shadows"));
}

TEST(BeadPose, IsTheSameEveryTimeAndOnAnyNumberOfThreads) {
    Random random(17);
    const BeadLayout layout = phantom();
    const CArm carm = trueCArm();
    const auto made = syntheticDetections(layout, carm, phantomPose(10, 15, 40), 0.05, 0.2, 5, random);
    const auto many = estimateBeadPose(made.detections, layout, carm);
    const ThreadLimit limit(1);
    const auto one = estimateBeadPose(made.detections, layout, carm);
    ASSERT_OK(many);
    ASSERT_OK(one);
    EXPECT_EQ(many->imager_from_layout.matrix(), one->imager_from_layout.matrix());
    EXPECT_EQ(many->covariance, one->covariance);
}

}  // namespace
}  // namespace fluorocut
