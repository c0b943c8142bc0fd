#include "core/registration/hand_eye/start.h"

#include <array>
#include <cmath>
#include <string>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "core/base/units.h"

namespace fluorocut {
namespace {

// Of a half turn it cannot be told which way it went.
constexpr double kLeastScalarPart = 0.02;

Eigen::Vector4d coefficients(const Eigen::Quaterniond& q) {
    const Eigen::Vector4d v(q.w(), q.x(), q.y(), q.z());
    return v[0] < 0 ? Eigen::Vector4d(-v) : v;
}

// q_a q_x - q_x q_b = (left(q_a) - right(q_b)) q_x, scalar first.
Eigen::Matrix4d difference(const Eigen::Vector4d& a, const Eigen::Vector4d& b) {
    const Vector3 sum = a.tail<3>() + b.tail<3>(), gap = a.tail<3>() - b.tail<3>();
    Eigen::Matrix4d m;
    m << a[0] - b[0], -gap.transpose(), gap, (a[0] - b[0]) * Matrix3::Identity() + skew(sum);
    return m;
}

}  // namespace

std::optional<Rigid3> solveHandEye(const std::vector<HandEyeMotion>& motions) {
    Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
    for (const HandEyeMotion& motion : motions) {
        const Eigen::Vector4d a = coefficients(motion.flange_i_from_flange_j.rotation());
        const Eigen::Vector4d b = coefficients(motion.corkscrew_i_from_corkscrew_j.rotation());
        if (a[0] < kLeastScalarPart || b[0] < kLeastScalarPart) continue;
        const Eigen::Matrix4d m = difference(a, b);
        normal += m.transpose() * m;
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> eigen(normal);
    // A second quaternion that fits as well: turning about one axis only, or not at all.
    if (!(eigen.eigenvalues()[1] > 1e-9)) return std::nullopt;
    const Eigen::Vector4d q = eigen.eigenvectors().col(0);
    const Eigen::Quaterniond rotation(q[0], q[1], q[2], q[3]);
    Matrix3 left = Matrix3::Zero();
    Vector3 right = Vector3::Zero();
    for (const HandEyeMotion& motion : motions) {
        const Matrix3 m = motion.flange_i_from_flange_j.rotationMatrix() - Matrix3::Identity();
        left += m.transpose() * m;
        right += m.transpose() * (rotation * motion.corkscrew_i_from_corkscrew_j.translation() -
                                  motion.flange_i_from_flange_j.translation());
    }
    const Vector3 place = left.ldlt().solve(right);
    if (!place.allFinite()) return std::nullopt;
    return Rigid3(rotation, place);
}

MotionSpread spreadOf(const std::vector<HandEyeMotion>& motions) {
    MotionSpread spread;
    spread.motions = motions.size();
    if (motions.empty()) return spread;
    Matrix3 scatter = Matrix3::Zero();
    for (const HandEyeMotion& motion : motions) {
        const Vector3 turn = logRotation(motion.flange_i_from_flange_j.rotation());
        scatter += turn * turn.transpose();
    }
    scatter /= static_cast<double>(motions.size());
    const Eigen::SelfAdjointEigenSolver<Matrix3> eigen(scatter);
    const Vector3 squares = eigen.eigenvalues().cwiseMax(0);
    spread.turn_rad = std::sqrt(squares.sum());
    spread.second_turn_rad = std::sqrt(squares[0] + squares[1]);
    spread.main_axis = eigen.eigenvectors().col(2);
    return spread;
}

Result<void> requireSpread(const MotionSpread& spread, std::size_t poses, std::size_t positions,
                           double least_turn_rad) {
    const char* const where = "robot-corkscrew calibration";
    if (poses < 3 || spread.motions < 2) {
        const std::string found = positions > 1 && poses >= 3
                                      ? fmt::format("{} poses in {} positions of the C-arm: {} motion{} in all", poses,
                                                    positions, spread.motions, spread.motions == 1 ? "" : "s")
                                      : fmt::format("{} pose{}", poses, poses == 1 ? "" : "s");
        return noSolution(where, found, "at least 3 poses of the robot with the C-arm standing still (8 are good)",
                          "take more images, with the flange turned about two axes");
    }
    if (!(spread.turn_rad >= least_turn_rad)) {
        return noSolution(where,
                          fmt::format("a flange that was only moved, not turned ({:.2f} degrees)",
                                      degreesFromRadians(spread.turn_rad)),
                          "rotations: without them the corkscrew's place on the flange is not determined",
                          "turn the flange by 20 degrees or more, about two different axes");
    }
    if (!(spread.second_turn_rad >= least_turn_rad)) {
        return noSolution(
            where,
            fmt::format("motions that all turn about one axis, {} (about others: {:.2f} degrees)",
                        axisInWords(spread.main_axis, "flange"), degreesFromRadians(spread.second_turn_rad)),
            "rotations about two axes: the corkscrew's place along a single axis is not determined",
            "rotate about a second axis, across the first, by 20 degrees or more");
    }
    return {};
}

std::string axisInWords(const Vector3& axis, const char* frame) {
    static constexpr std::array<const char*, 3> kNames{"x", "y", "z"};
    Eigen::Index largest = 0;
    axis.cwiseAbs().maxCoeff(&largest);
    if (std::abs(axis[largest]) > 0.95 * axis.norm())
        return fmt::format("the {}'s {} axis", frame, kNames[static_cast<std::size_t>(largest)]);
    const Vector3 shown = axis.normalized() * (axis[largest] < 0 ? -1 : 1);
    return fmt::format("the direction ({:.2f}, {:.2f}, {:.2f}) of the {}", shown.x(), shown.y(), shown.z(), frame);
}

}  // namespace fluorocut
