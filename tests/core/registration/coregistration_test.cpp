#include "core/registration/coregistration.h"

#include <cmath>

#include <gmock/gmock.h>

#include "tests/core/registration/corkscrew_points.h"
#include "tests/core/registration/hand_eye_scene.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::anyPose;
using test::CorkscrewPoints;
using test::drawnFrom;
using testing::Contains;
using testing::HasSubstr;

struct Scene {
    std::vector<Rigid3> imager_from_base;  // of each view
    Rigid3 flange_from_corkscrew;
    std::vector<CoregistrationView> views;  // imager_from_corkscrew: the truth, until seen
};

std::string imageName(std::size_t index) {
    std::string name = std::to_string(index + 1);
    name.insert(name.begin(), 'v');
    return name.append(".png");
}

// Views turned by `degrees` about the patient's axis, which lies along the rows: C-arm scales say so too.
Rigid3 imagerFromTable(double orbital_deg) {
    const double angle = radiansFromDegrees(orbital_deg);
    return Rigid3::fromTranslation({2, -3, 700}) * Rigid3::fromRotationVector({0, angle, 0}) *
           Rigid3::fromRotationVector({0.2, 0, 0});
}

// The base is the corkscrew, fixed to the table somehow, in view of all.
Scene fixedScene(const std::vector<double>& orbital_deg) {
    Scene scene;
    const Rigid3 table_from_corkscrew = Rigid3::fromTwistRollPitch(0.4, 0.2, 1.2);
    for (std::size_t i = 0; i < orbital_deg.size(); ++i) {
        CoregistrationView view;
        view.name = imageName(i);
        view.imager_from_corkscrew = imagerFromTable(orbital_deg[i]) * table_from_corkscrew;
        view.imager_from_room = imagerFromTable(orbital_deg[i]);
        scene.imager_from_base.push_back(view.imager_from_corkscrew);
        scene.views.push_back(view);
    }
    return scene;
}

// A robot that turns and moves the corkscrew in each position of the C-arm: `shots` images in each.
Scene movedScene(const std::vector<double>& orbital_deg, int shots, Random& random) {
    Scene scene;
    scene.flange_from_corkscrew = anyPose(random, 100);
    const Rigid3 table_from_robot = anyPose(random, 800);
    for (std::size_t k = 0; k < orbital_deg.size(); ++k) {
        for (int shot = 0; shot < shots; ++shot) {
            CoregistrationView view;
            view.name = imageName(scene.views.size());
            view.position = std::to_string(k);
            const Rigid3 table_from_corkscrew =
                Rigid3(expRotation(Vector3(random.normal(), random.normal(), random.normal()) * 0.2),
                       Vector3(random.uniform(-30, 30), random.uniform(-30, 30), random.uniform(-60, 60))) *
                Rigid3::fromTwistRollPitch(0.4, 0.2, 1.2);
            view.robot_from_flange =
                table_from_robot.inverse() * table_from_corkscrew * scene.flange_from_corkscrew.inverse();
            view.imager_from_corkscrew = imagerFromTable(orbital_deg[k]) * table_from_corkscrew;
            view.imager_from_room = imagerFromTable(orbital_deg[k]);
            scene.imager_from_base.push_back(imagerFromTable(orbital_deg[k]) * table_from_robot);
            scene.views.push_back(view);
        }
    }
    return scene;
}

void see(Scene& scene, Random& random) {
    for (CoregistrationView& view : scene.views) {
        view.covariance = CorkscrewNoise{}.covarianceAt(view.imager_from_corkscrew);
        view.imager_from_corkscrew = view.imager_from_corkscrew.perturbed(drawnFrom(*view.covariance, random));
    }
}

// (all view_from_first - truth) in one vector.
Eigen::VectorXd errorOf(const Scene& scene, const Coregistration& result) {
    Eigen::VectorXd error(6 * static_cast<Eigen::Index>(scene.views.size() - 1));
    for (std::size_t i = 1; i < scene.views.size(); ++i) {
        const Rigid3 truth = scene.imager_from_base[i] * scene.imager_from_base[0].inverse();
        error.segment<6>(6 * (static_cast<Eigen::Index>(i) - 1)) =
            truth.deltaFrom(result.views[i].view_from_first.target_from_source);
    }
    return error;
}

TEST(CoregistrationTest, ExactPosesGiveExactViews) {
    const Scene scene = fixedScene({0, 50, 90});
    const Result<Coregistration> result = coregisterViews(scene.views);
    ASSERT_OK(result);
    // Some rounding of 1000 mm.
    EXPECT_LT(errorOf(scene, *result).norm(), 1e-8);
    EXPECT_NEAR(degreesFromRadians(result->views[1].angle_to_first_rad), 50, 1e-6);
    EXPECT_NEAR(degreesFromRadians(result->widest_angle_rad), 90, 1e-6);
    EXPECT_TRUE(accepted(result->acceptance));
}

// 1000 noisy scenes: the joint 95 % regions of all relative poses, fixed corkscrew.
TEST(CoregistrationTest, JointCovarianceHolds) {
    Random random(1);
    const int trials = 1000;
    int inside = 0;
    for (int t = 0; t < trials; ++t) {
        Scene scene = fixedScene({0, 50, 90});
        see(scene, random);
        const Result<Coregistration> result = coregisterViews(scene.views);
        ASSERT_OK(result);
        const Eigen::VectorXd error = errorOf(scene, *result);
        inside += error.dot(result->covariance.ldlt().solve(error)) < 21.026;  // chi squared, 12
    }
    // The binomial's standard deviation is 0.7 %.
    EXPECT_NEAR(inside / static_cast<double>(trials), 0.95, 0.02);
}

// The same with a robot that moves the corkscrew, two shots in each of two positions, an uncertain mount and robot.
TEST(CoregistrationTest, JointCovarianceHoldsWithAMovedCorkscrew) {
    Random random(2);
    const int trials = 1000;
    int inside = 0;
    double place_mm = 0;
    Matrix6 mount = Matrix6::Zero();
    mount.diagonal() << 0.04, 0.04, 0.04, 4e-6, 4e-6, 4e-6;  // 0.2 mm, 2 mrad
    for (int t = 0; t < trials; ++t) {
        Scene scene = movedScene({0, 60}, 2, random);
        see(scene, random);
        CoregistrationOptions options;
        options.robot_place_mm = 0.05;
        options.robot_rotation_rad = 2e-4;
        for (CoregistrationView& view : scene.views) {
            Vector6 off;
            for (int i = 0; i < 6; ++i)
                off[i] = (i < 3 ? options.robot_place_mm : options.robot_rotation_rad) * random.normal();
            view.robot_from_flange = view.robot_from_flange->perturbed(off);
        }
        options.flange_from_corkscrew = Pose{Frame::flange, Frame::corkscrew,
                                             scene.flange_from_corkscrew.perturbed(drawnFrom(mount, random)), mount};
        const Result<Coregistration> result = coregisterViews(scene.views, options);
        ASSERT_OK(result);
        EXPECT_EQ(result->degrees_of_freedom, 12);
        // The shots of one position have one imager: views 1 and 2 are the same, 3 and 4 as well.
        EXPECT_LT(result->views[1].view_from_first.target_from_source.translation().norm(), 1e-9);
        const Vector6 error = errorOf(scene, *result).segment<6>(6);
        const Matrix6 covariance = result->covariance.block<6, 6>(6, 6);
        inside += error.dot(covariance.ldlt().solve(error)) < 12.592;
        place_mm += result->views[2].worst_place_mm / trials;
    }
    RecordProperty("worst_place_mm", std::to_string(place_mm));
    EXPECT_NEAR(inside / static_cast<double>(trials), 0.95, 0.02);
}

// The focal length changes by 0.3 % with the gantry. From one image of each position it is guesswork; a corkscrew that
// the robot moves in depth tells.
TEST(CoregistrationTest, KnownMotionTellsTheFocalLengthOfEachPosition) {
    Random random(3);
    const int trials = 20;
    double before = 0, after = 0, stated = 0;
    for (int t = 0; t < trials; ++t) {
        Scene scene = movedScene({0, 60}, 4, random);
        CoregistrationOptions options;
        options.shared = CorkscrewPoints::prior(0.001, 0, 0.0);
        options.shared.change_sigma[0] = 0.003;
        options.flange_from_corkscrew =
            Pose{Frame::flange, Frame::corkscrew, scene.flange_from_corkscrew, std::nullopt};
        std::vector<Eigen::VectorXd> truth;
        const double common = 0.001 * random.normal();
        for (std::size_t i = 0; i < scene.views.size(); ++i) {
            if (i % 4 == 0) {
                truth.push_back(options.shared.mean);
                truth.back()[0] = common + 0.003 * random.normal();
            } else {
                truth.push_back(truth.back());
            }
        }
        std::vector<Eigen::VectorXd> seen;
        for (std::size_t i = 0; i < scene.views.size(); ++i) {
            seen.push_back(CorkscrewPoints::observe(scene.views[i].imager_from_corkscrew, truth[i], random));
            scene.views[i].evidence =
                CorkscrewPoints::fit(seen[i], scene.views[i].imager_from_corkscrew, options.shared.mean);
        }
        options.relinearise = [&](std::size_t i, const Rigid3& pose,
                                  const Eigen::VectorXd& shared) -> Result<PoseEvidence> {
            return CorkscrewPoints::fit(seen[i], pose, shared);
        };
        const Result<Coregistration> result = coregisterViews(scene.views, options);
        ASSERT_OK(result);
        for (const std::size_t view : {0u, 4u}) {
            before += std::abs(truth[view][0]) / (2 * trials);
            after += std::abs(result->views[view].shared[0] - truth[view][0]) / (2 * trials);
            stated += result->views[view].shared_sigma[0] / (2 * trials);
        }
    }
    RecordProperty("focal_before", std::to_string(before));
    RecordProperty("focal_after", std::to_string(after));
    EXPECT_LT(after, 0.1 * before);
    // The mean of |x| is 0.8 sigma; 40 draws.
    EXPECT_NEAR(after, 0.8 * stated, 0.3 * stated);
}

TEST(CoregistrationTest, ViewsFromTheSameDirectionAreRefusedOrNamed) {
    Result<Coregistration> result = coregisterViews(fixedScene({10, 12}).views);
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, ErrorCode::noSolution);
    EXPECT_THAT(result.error().message(),
                HasSubstr("views 1 (v1.png) and 2 (v2.png) look from the same direction (2.0 degrees apart)"));
    // Opposite views see the same lines.
    EXPECT_FALSE(coregisterViews(fixedScene({0, 180}).views));
    result = coregisterViews(fixedScene({10, 60, 12}).views);
    ASSERT_OK(result);
    EXPECT_THAT(result->warnings, Contains(HasSubstr("views 1 (v1.png) and 3 (v3.png) look from the same direction")));
    // Between the two limits: an answer that is not accepted.
    result = coregisterViews(fixedScene({0, 12}).views);
    ASSERT_OK(result);
    EXPECT_FALSE(accepted(result->acceptance));
}

TEST(CoregistrationTest, SwappedViewsAreNamed) {
    Random random(4);
    // By the robot's motion.
    Scene scene = movedScene({0, 60}, 3, random);
    see(scene, random);
    CoregistrationOptions options;
    options.flange_from_corkscrew = Pose{Frame::flange, Frame::corkscrew, scene.flange_from_corkscrew, std::nullopt};
    ASSERT_OK(coregisterViews(scene.views, options));
    for (CoregistrationView& view : scene.views)
        view.imager_from_room.reset();
    std::swap(scene.views[1].robot_from_flange, scene.views[2].robot_from_flange);
    Result<Coregistration> result = coregisterViews(scene.views, options);
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, ErrorCode::invalidInput);
    EXPECT_THAT(result.error().message(), HasSubstr("views 2 (v2.png) and 3 (v3.png)"));
    EXPECT_THAT(result.error().message(), HasSubstr("swapped"));
    // By the C-arm's scales, with no motion at all.
    scene = fixedScene({0, 50});
    see(scene, random);
    ASSERT_OK(coregisterViews(scene.views));
    std::swap(scene.views[0].imager_from_room, scene.views[1].imager_from_room);
    result = coregisterViews(scene.views);
    ASSERT_FALSE(result);
    EXPECT_THAT(result.error().message(), HasSubstr("swapped"));
}

TEST(CoregistrationTest, ACArmThatMovedBetweenShotsOfOnePositionIsTold) {
    Random random(5);
    Scene scene = movedScene({0, 60}, 3, random);
    see(scene, random);
    CoregistrationOptions options;
    options.flange_from_corkscrew = Pose{Frame::flange, Frame::corkscrew, scene.flange_from_corkscrew, std::nullopt};
    scene.views[4].imager_from_corkscrew = Rigid3::fromTranslation({0.5, 0, 0}) * scene.views[4].imager_from_corkscrew;
    const Result<Coregistration> result = coregisterViews(scene.views, options);
    ASSERT_OK(result);
    EXPECT_THAT(result->warnings, Contains(HasSubstr("ends when view 5 (v5.png) is left out")));
    EXPECT_FALSE(accepted(result->acceptance));
}

TEST(CoregistrationTest, WhatIsMissingIsNamed) {
    Random random(6);
    Scene scene = movedScene({0, 60}, 1, random);
    const auto message = [](const std::vector<CoregistrationView>& views) {
        const Result<Coregistration> result = coregisterViews(views);
        return result ? std::string("no error") : result.error().message();
    };
    EXPECT_THAT(message(scene.views), HasSubstr("flange_from_corkscrew"));
    scene.views[1].robot_from_flange.reset();
    EXPECT_THAT(message(scene.views), HasSubstr("v2.png"));
    scene.views.pop_back();
    EXPECT_THAT(message(scene.views), HasSubstr("1 view"));
}

}  // namespace
}  // namespace fluorocut
