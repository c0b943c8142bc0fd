// Random robots, mounts and C-arms, and what images of the corkscrew say there, with the noise they are given. Nothing
// of how an image gives a pose.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "core/base/random.h"
#include "core/base/units.h"
#include "core/registration/corkscrew_noise.h"
#include "core/registration/hand_eye.h"

namespace fluorocut::test {

inline Vector6 drawnFrom(const Matrix6& covariance, Random& random) {
    Vector6 v;
    for (int i = 0; i < 6; ++i)
        v[i] = random.normal();
    return covariance.llt().matrixL() * v;
}

inline Rigid3 anyPose(Random& random, double mm) {
    const Eigen::Quaterniond q(random.normal(), random.normal(), random.normal(), random.normal());
    return {q, Vector3(random.uniform(-mm, mm), random.uniform(-mm, mm), random.uniform(-mm, mm))};
}

// Somewhere in the field of a C-arm of 1000 mm and 164 mm, 650 to 740 mm from the source, within `turn` of `reference`.
inline Rigid3 nearby(const Rigid3& reference, double turn_rad, Random& random) {
    const Vector3 axis = Vector3(random.normal(), random.normal(), random.normal()).normalized();
    const Vector3 place(random.uniform(-25, 25), random.uniform(-25, 25), random.uniform(650, 740));
    return {expRotation(axis * random.uniform(0.5, 1) * turn_rad) * reference.rotation(), place};
}

struct HandEyeScene {
    Rigid3 flange_from_corkscrew;
    std::vector<Rigid3> imager_from_robot;
    std::vector<HandEyeObservation> observations;

    double placeError(const HandEyeCalibration& result) const {
        return (result.flange_from_corkscrew.target_from_source.translation() - flange_from_corkscrew.translation())
            .norm();
    }
    double rotationError(const HandEyeCalibration& result) const {
        return (result.flange_from_corkscrew.target_from_source.rotation() *
                flange_from_corkscrew.rotation().conjugate())
                   .normalized()
                   .vec()
                   .norm() *
               2;
    }
};

struct SceneOptions {
    int poses = 8;
    int positions = 1;
    double turn_rad = radiansFromDegrees(40);
    std::optional<CorkscrewNoise> noise = CorkscrewNoise{};
    double robot_place_mm = 0;
    double robot_rotation_rad = 0;
    bool state_covariance = true;
};

inline HandEyeScene handEyeScene(const SceneOptions& options, Random& random) {
    HandEyeScene scene;
    scene.flange_from_corkscrew = anyPose(random, 100);
    // Roll within what is seen well; the robot's base anywhere.
    for (int k = 0; k < options.positions; ++k)
        scene.imager_from_robot.push_back(anyPose(random, 1000));
    for (int i = 0; i < options.poses; ++i) {
        const int k = i % options.positions;
        const Rigid3 reference = Rigid3::fromTwistRollPitch(0.3, 0.1 * k, 0.5);
        const Rigid3 truth = nearby(reference, options.turn_rad, random);
        HandEyeObservation one;
        one.name = "image " + std::to_string(i + 1);
        one.imager = "position " + std::to_string(k + 1);
        const Rigid3 flange = scene.imager_from_robot[static_cast<std::size_t>(k)].inverse() * truth *
                              scene.flange_from_corkscrew.inverse();
        Vector6 robot;
        for (int j = 0; j < 6; ++j)
            robot[j] = (j < 3 ? options.robot_place_mm : options.robot_rotation_rad) * random.normal();
        one.robot_from_flange = flange.perturbed(robot);
        one.imager_from_corkscrew = truth;
        if (options.noise) {
            const Matrix6 covariance = options.noise->covarianceAt(truth);
            one.imager_from_corkscrew = truth.perturbed(drawnFrom(covariance, random));
            if (options.state_covariance) one.covariance = covariance;
        }
        scene.observations.push_back(one);
    }
    return scene;
}

}  // namespace fluorocut::test
