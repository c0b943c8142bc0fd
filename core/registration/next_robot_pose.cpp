#include "core/registration/next_robot_pose.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/units.h"
#include "core/registration/hand_eye/start.h"
#include "core/registration/pose_network.h"

namespace fluorocut {
namespace {

constexpr int kAxes = 26;
constexpr int kAngles = 4;

// Directions spread evenly over the sphere (Fibonacci's lattice).
std::vector<Vector3> axes() {
    std::vector<Vector3> result;
    const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
    for (int i = 0; i < kAxes; ++i) {
        const double z = 1 - (2 * i + 1) / static_cast<double>(kAxes), r = std::sqrt(1 - z * z);
        result.emplace_back(r * std::cos(golden * i), r * std::sin(golden * i), z);
    }
    return result;
}

// Worst standard deviations of (place, rotation).
Vector2 worst(const Matrix6& covariance) {
    const auto largest = [](const Matrix3& m) {
        const double value = Eigen::SelfAdjointEigenSolver<Matrix3>(m, Eigen::EigenvaluesOnly).eigenvalues()[2];
        return std::sqrt(std::max(0.0, value));
    };
    return {largest(covariance.topLeftCorner<3, 3>()), largest(covariance.bottomRightCorner<3, 3>())};
}

}  // namespace

Result<void> NextPoseOptions::validate() const {
    if (Result<void> valid = foreseen.validate(); !valid) return valid;
    return requireRanges({{"most_off_axis", most_off_axis, 1e-3, 10, ""},
                          {"most_roll_rad", most_roll_rad, 0, 1.58, "rad"},
                          {"most_turn_rad", most_turn_rad, 0.01, 3.15, "rad"},
                          {"most_travel_mm", most_travel_mm, 0, 10000, "mm"}});
}

Result<NextPose> suggestNextPose(const HandEyeCalibration& calibration, const Rigid3& reference, std::size_t imager,
                                 const HandEyeOptions& calibrated_with, const NextPoseOptions& options) {
    if (Result<void> valid = options.validate(); !valid) return valid.error();
    if (imager >= calibration.imagers.size()) throw std::logic_error("suggestNextPose: no such imager");
    const Rigid3& flange_from_corkscrew = calibration.flange_from_corkscrew.target_from_source;
    std::vector<Rigid3> poses{flange_from_corkscrew};
    for (const ImagerPlacement& one : calibration.imagers)
        poses.push_back(one.imager_from_robot.target_from_source);
    std::vector<Rigid3> candidates = options.candidates;
    if (candidates.empty()) {
        const Rigid3 robot_from_corkscrew = reference * flange_from_corkscrew;
        for (const Vector3& axis : axes()) {
            for (int i = 1; i <= kAngles; ++i) {
                const Rigid3 turn = Rigid3::fromRotationVector(axis * (options.most_turn_rad * i / kAngles));
                candidates.push_back(robot_from_corkscrew * turn * flange_from_corkscrew.inverse());
            }
        }
    }

    Matrix6 robot = Matrix6::Zero();
    robot.diagonal().head<3>().setConstant(calibrated_with.robot_place_mm * calibrated_with.robot_place_mm);
    robot.diagonal().tail<3>().setConstant(calibrated_with.robot_rotation_rad * calibrated_with.robot_rotation_rad);
    const HandEyeLimits& limits = calibrated_with.limits;
    const double place_unit = limits.most_place_mm > 0 ? limits.most_place_mm : 1;
    const double rotation_unit = limits.most_rotation_rad > 0 ? limits.most_rotation_rad : 1;
    const double noise = calibration.noise_factor * calibration.noise_factor;
    // A further image adds nothing to shared parameters that the poses do not see: their part stays as it is.
    const Eigen::MatrixXd& covariance = calibration.covariance;
    const Vector2 before = worst(covariance.topLeftCorner<6, 6>());
    NextPose best;
    double best_score = std::numeric_limits<double>::infinity();
    for (const Rigid3& candidate : candidates) {
        const Rigid3 moved = candidate * reference.inverse();
        if (options.candidates.empty() &&
            !((candidate.translation() - reference.translation()).norm() <= options.most_travel_mm &&
              moved.rotationAngle() <= options.most_turn_rad + 1e-9))
            continue;
        const Rigid3 seen = poses[imager + 1] * candidate * flange_from_corkscrew;
        const Vector3 place = seen.translation();
        const double roll = std::abs(seen.twistRollPitch().y());
        if (!(place.z() > 0 && place.head<2>().norm() <= options.most_off_axis * place.z() &&
              roll <= options.most_roll_rad))
            continue;
        const std::vector<PoseStep> chain{PoseStep::unknown(static_cast<int>(imager) + 1),
                                          PoseStep::about(candidate, robot), PoseStep::unknown(0)};
        Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(6, covariance.cols());
        jacobian.middleCols(6 * (static_cast<Eigen::Index>(imager) + 1), 6) = stepDerivative(chain, 0, poses);
        jacobian.leftCols(6) = stepDerivative(chain, 2, poses);
        const Matrix6 of_robot = stepDerivative(chain, 1, poses);
        // The Kalman filter's update.
        const Matrix6 image = noise * (options.foreseen.covarianceAt(seen) + of_robot * robot * of_robot.transpose());
        const Eigen::MatrixXd spread = jacobian * covariance;
        const Matrix6 total = spread * jacobian.transpose() + image;
        const Eigen::MatrixXd gain = total.ldlt().solve(spread.leftCols(6));
        const Matrix6 updated = covariance.topLeftCorner<6, 6>() - spread.leftCols(6).transpose() * gain;
        const Vector2 after = worst(updated);
        const double score = std::max(after.x() / place_unit, after.y() / rotation_unit);
        if (score < best_score) {
            best_score = score;
            best.robot_from_flange = candidate;
            best.imager_from_corkscrew = seen;
            best.place_after_mm = after.x();
            best.rotation_after_rad = after.y();
        }
    }
    if (!std::isfinite(best_score)) {
        return noSolution("next pose of the robot",
                          fmt::format("none of {} poses that keeps the corkscrew in view", candidates.size()),
                          "one within the limits of turn, travel, field and roll",
                          "move the robot so that the corkscrew is near the middle of the image");
    }
    best.imager = calibration.imagers[imager].name;
    best.place_before_mm = before.x();
    best.rotation_before_rad = before.y();
    const Rigid3 turn = reference.inverse() * best.robot_from_flange;
    const Vector3 rotation = logRotation(turn.rotation());
    const bool enough = before.x() <= limits.most_place_mm && before.y() <= limits.most_rotation_rad;
    best.sentence = fmt::format(
        "{}turn the flange by {:.0f} degrees about {}, keeping the corkscrew in view: the standard deviation of its "
        "place falls by {:.0f} % from {:.3f} mm, that of its rotation by {:.0f} % from {:.3f} degrees (worst "
        "directions)",
        enough ? "not needed, the limits are met; the best would be: " : "", degreesFromRadians(rotation.norm()),
        rotation.norm() > 1e-9 ? axisInWords(rotation / rotation.norm(), "flange") : "any axis",
        100 * (1 - best.place_after_mm / before.x()), before.x(), 100 * (1 - best.rotation_after_rad / before.y()),
        degreesFromRadians(before.y()));
    return best;
}

}  // namespace fluorocut
