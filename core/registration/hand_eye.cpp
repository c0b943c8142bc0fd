#include "core/registration/hand_eye.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/stopwatch.h"
#include "core/base/units.h"
#include "core/registration/hand_eye/mistakes.h"
#include "core/registration/hand_eye/problem.h"
#include "core/registration/hand_eye/start.h"

namespace fluorocut {
namespace {

const char* const kWhere = "robot-corkscrew calibration";

std::string names(const std::vector<HandEyeObservation>& observations, const std::vector<bool>& which, bool value) {
    std::string text;
    for (std::size_t i = 0; i < which.size(); ++i)
        if (which[i] == value) text += (text.empty() ? "" : ", ") + observations[i].name;
    return text;
}

// Two images left out that fit with each other's robot pose.
bool fitExchanged(const std::vector<HandEyeObservation>& observations, const hand_eye::Fit& fit,
                  const std::vector<int>& position, std::size_t a, std::size_t b) {
    const auto distance = [&](std::size_t image, std::size_t robot) {
        const Rigid3 predicted = fit.network.poses[static_cast<std::size_t>(position[image]) + 1] *
                                 observations[robot].robot_from_flange * fit.network.poses[0];
        const Vector6 d = predicted.deltaFrom(hand_eye::poseOf(observations[image]));
        return Vector2(d.head<3>().norm(), d.tail<3>().norm());
    };
    for (const auto& [i, j] : {std::pair(a, b), std::pair(b, a)}) {
        const Vector2 own = distance(i, i), other = distance(i, j);
        if (!(other.x() < 0.2 * own.x() && other.y() < 0.2 * own.y() + 1e-3)) return false;
    }
    return true;
}

void describeWeakness(HandEyeCalibration& result, const HandEyeLimits& limits) {
    const Matrix6& covariance = *result.flange_from_corkscrew.covariance;
    const Eigen::SelfAdjointEigenSolver<Matrix3> place(covariance.topLeftCorner<3, 3>());
    const Eigen::SelfAdjointEigenSolver<Matrix3> rotation(covariance.bottomRightCorner<3, 3>());
    result.worst_place_mm = std::sqrt(std::max(0.0, place.eigenvalues()[2]));
    result.worst_rotation_rad = std::sqrt(std::max(0.0, rotation.eigenvalues()[2]));
    if (!(result.worst_place_mm <= limits.most_place_mm)) {
        result.weak_directions.push_back(fmt::format(
            "the corkscrew's place along {} is known to {:.2g} mm only: turn the flange about axes across it",
            axisInWords(place.eigenvectors().col(2), "flange"), result.worst_place_mm));
    }
    if (!(result.worst_rotation_rad <= limits.most_rotation_rad)) {
        result.weak_directions.push_back(fmt::format(
            "the corkscrew's rotation about {} is known to {:.2g} degrees only: take more images, with larger turns",
            axisInWords(rotation.eigenvectors().col(2), "flange"), degreesFromRadians(result.worst_rotation_rad)));
    }
}

Result<void> check(const std::vector<HandEyeObservation>& observations, const HandEyeOptions& options) {
    if (Result<void> valid = options.validate(); !valid) return valid;
    for (const HandEyeObservation& one : observations) {
        if (one.evidence && one.evidence->shared.size() != options.shared.size()) {
            return invalidInput(one.name, fmt::format("{} shared parameters", one.evidence->shared.size()),
                                fmt::format("{}", options.shared.size()));
        }
        const Matrix6 covariance = one.evidence     ? one.evidence->covariance()
                                   : one.covariance ? *one.covariance
                                                    : Matrix6::Identity();
        if (!(covariance.allFinite() && Eigen::LLT<Matrix6>(covariance).info() == Eigen::Success)) {
            return invalidInput(one.name + ", covariance", "a matrix with a direction of no or negative variance",
                                "a positive definite 6x6 matrix", "leave it out when the noise is not known");
        }
    }
    return {};
}

}  // namespace

std::size_t HandEyeCalibration::used() const {
    return static_cast<std::size_t>(
        std::count_if(residuals.begin(), residuals.end(), [](const HandEyeResidual& one) { return !one.rejected; }));
}

Result<void> HandEyeLimits::validate() const {
    return requireRanges({{"most_place_mm", most_place_mm, 0, 1000, "mm"},
                          {"most_rotation_rad", most_rotation_rad, 0, 3.2, "rad"},
                          {"most_noise_factor", most_noise_factor, 0, 1e6, ""},
                          {"least_share", least_share, 0, 1, ""}});
}

Result<void> HandEyeOptions::validate() const {
    if (Result<void> valid = assumed.validate(); !valid) return valid;
    if (Result<void> valid = shared.validate(); !valid) return valid;
    if (Result<void> valid = limits.validate(); !valid) return valid;
    return requireRanges({{"robot_place_mm", robot_place_mm, 0, 100, "mm"},
                          {"robot_rotation_rad", robot_rotation_rad, 0, 1, "rad"},
                          {"least_turn_rad", least_turn_rad, 1e-4, 3, "rad"}});
}

Result<HandEyeCalibration> calibrateHandEye(const std::vector<HandEyeObservation>& observations,
                                            const HandEyeOptions& options, Progress& progress) {
    const Stopwatch stopwatch;
    if (const Result<void> valid = check(observations, options); !valid) return valid.error();
    const hand_eye::Problem problem(observations, options);
    if (const Result<void> enough =
            requireSpread(problem.spread(), observations.size(), problem.names().size(), options.least_turn_rad);
        !enough)
        return enough.error();
    progress.report(0.1, "Calibrating robot and corkscrew");
    const hand_eye::Fit fit = problem.solve();
    if (progress.isCancelled()) return cancelled(kWhere);
    if (hand_eye::contradictory(fit)) return hand_eye::explainContradiction(observations, options, fit);

    HandEyeCalibration result;
    result.covariance = fit.network.covariance;
    result.flange_from_corkscrew = {Frame::flange, Frame::corkscrew, fit.network.poses[0],
                                    Matrix6(result.covariance.topLeftCorner<6, 6>())};
    const SharedLayout shared = problem.sharedLayout();
    const Eigen::Index of_poses = 6 * static_cast<Eigen::Index>(fit.network.poses.size());
    for (std::size_t k = 0; k < problem.names().size(); ++k) {
        const Eigen::Index at = 6 * static_cast<Eigen::Index>(k + 1);
        result.imagers.push_back(
            {problem.names()[k],
             {Frame::imager, Frame::robot, fit.network.poses[k + 1], Matrix6(result.covariance.block<6, 6>(at, at))}});
        result.shared.push_back(shared.valuesOf(fit.network.shared, k));
    }
    const std::vector<int>& first = shared.index.front();
    result.shared_covariance.resize(static_cast<Eigen::Index>(first.size()), static_cast<Eigen::Index>(first.size()));
    for (std::size_t i = 0; i < first.size(); ++i)
        for (std::size_t j = 0; j < first.size(); ++j)
            result.shared_covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
                result.covariance(of_poses + first[i], of_poses + first[j]);
    for (std::size_t i = 0; i < observations.size(); ++i) {
        const Vector6& r = fit.network.residuals[i];
        result.residuals.push_back({observations[i].name, r, r.head<3>().norm(), r.tail<3>().norm(),
                                    std::sqrt(fit.network.squared_distances[i]) / fit.factor, !fit.used[i]});
    }
    result.rms_place_mm = fit.placeMm();
    result.rms_rotation_rad = fit.rotationRad();
    result.noise_factor = fit.factor;
    describeWeakness(result, options.limits);

    if (fit.count() < fit.used.size()) {
        result.warnings.push_back("left out, because they contradict the others: " +
                                  names(observations, fit.used, false));
        for (std::size_t a = 0; a < fit.used.size(); ++a) {
            for (std::size_t b = a + 1; b < fit.used.size(); ++b) {
                if (!fit.used[a] && !fit.used[b] && fitExchanged(observations, fit, problem.position(), a, b)) {
                    result.warnings.push_back(
                        fmt::format("{} and {} fit with each other's robot pose: were they swapped?",
                                    observations[a].name, observations[b].name));
                }
            }
        }
    }
    for (std::size_t k = 0; k < problem.names().size(); ++k) {
        std::size_t images = 0;
        for (std::size_t i = 0; i < fit.used.size(); ++i)
            images += problem.position()[i] == static_cast<int>(k) && fit.used[i];
        if (images < 2) {
            result.warnings.push_back(
                fmt::format("the C-arm's position {} has {} image{}: it adds nothing to the calibration",
                            problem.names()[k], images, images == 1 ? "" : "s"));
        }
    }
    if (problem.stated() && fit.factor > 1) {
        result.warnings.push_back(fmt::format(
            "the images disagree by {:.1f} times what their covariances allow; the result's covariance is inflated",
            fit.factor));
    }
    if (!problem.stated() && observations.size() < 5)
        result.warnings.push_back("the noise is estimated from few poses: so are the standard deviations");
    result.acceptance = {atMost("standard deviation of the corkscrew's place", result.worst_place_mm,
                                options.limits.most_place_mm, "mm"),
                         atMost("standard deviation of its rotation", degreesFromRadians(result.worst_rotation_rad),
                                degreesFromRadians(options.limits.most_rotation_rad), "degrees"),
                         atLeast("share of images that agree",
                                 static_cast<double>(fit.count()) / static_cast<double>(observations.size()),
                                 options.limits.least_share, "")};
    if (problem.stated()) {
        result.acceptance.push_back(
            atMost("noise over what was stated", fit.factor, options.limits.most_noise_factor, ""));
    }
    result.elapsed_ms = stopwatch.ms();
    progress.report(1, "Calibrating robot and corkscrew");
    return result;
}

}  // namespace fluorocut
