// A stand-in for the fit of a corkscrew to an image: points on its rings and helix, seen with noise, and what they say
// of the pose and of focal length, image centre and the dimensions, as PoseEvidence has it.
#pragma once

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "core/base/random.h"
#include "core/geometry/pose_evidence.h"
#include "core/registration/shared_prior.h"

namespace fluorocut::test {

struct CorkscrewPoints {
    static constexpr double kFocalPx = 1000 / 0.32;
    // 105 points: 0.0007 mm across the image, half of what a fit to an image with clutter reaches.
    static constexpr double kNoisePx = 0.03;
    static constexpr Eigen::Index kRings = 4;
    static constexpr Eigen::Index kShared = 3 + 2 * kRings + 4;

    // Priors: 0.1 % of the focal length, 1 px of the centre, `dimension_mm` of each dimension.
    static SharedPrior prior(double focal, double center_px, double dimension_mm) {
        SharedPrior result;
        result.names = {"focal length",  "image centre u", "image centre v", "ring 1 x",      "ring 1 radius",
                        "ring 2 x",      "ring 2 radius",  "ring 3 x",       "ring 3 radius", "ring 4 x",
                        "ring 4 radius", "helix start x",  "helix end x",    "helix radius",  "helix phase"};
        result.mean = Eigen::VectorXd::Zero(kShared);
        result.sigma = Eigen::VectorXd::Constant(kShared, dimension_mm);
        result.sigma.head<3>() << focal, center_px, center_px;
        result.sigma[kShared - 1] = dimension_mm / 14;
        result.change_sigma = Eigen::VectorXd::Zero(kShared);
        return result;
    }

    static Eigen::VectorXd predict(const Rigid3& pose, const Eigen::VectorXd& shared) {
        static constexpr double kX[] = {-50, -40, 44, 50};
        std::vector<Vector3> points;
        for (Eigen::Index ring = 0; ring < kRings; ++ring) {
            const double x = kX[ring] + shared[3 + 2 * ring], radius = 14 + shared[4 + 2 * ring];
            for (int i = 0; i < 16; ++i) {
                const double a = 2 * std::numbers::pi * i / 16;
                points.emplace_back(x, radius * std::cos(a), radius * std::sin(a));
            }
        }
        for (int i = 0; i <= 40; ++i) {
            const double t = i / 40.0, a = 2.5 * std::numbers::pi * t + shared[14], radius = 14 + shared[13];
            points.emplace_back((1 - t) * (-32 + shared[11]) + t * (36 + shared[12]), radius * std::cos(a),
                                radius * std::sin(a));
        }
        Eigen::VectorXd seen(2 * static_cast<Eigen::Index>(points.size()));
        for (std::size_t i = 0; i < points.size(); ++i) {
            const Vector3 p = pose * points[i];
            const auto at = 2 * static_cast<Eigen::Index>(i);
            seen[at] = kFocalPx * (1 + shared[0]) * p.x() / p.z() + shared[1];
            seen[at + 1] = kFocalPx * (1 + shared[0]) * p.y() / p.z() + shared[2];
        }
        return seen;
    }

    static Eigen::VectorXd observe(const Rigid3& pose, const Eigen::VectorXd& shared, Random& random) {
        Eigen::VectorXd seen = predict(pose, shared);
        for (double& value : seen)
            value += kNoisePx * random.normal();
        return seen;
    }

    // The fit over the pose, and the quadratic there.
    static PoseEvidence fit(const Eigen::VectorXd& seen, Rigid3 pose, const Eigen::VectorXd& shared) {
        PoseEvidence evidence;
        for (int round = 0; round < 8; ++round) {
            Eigen::MatrixXd jacobian(seen.size(), 6 + kShared);
            const double h = 1e-5;
            for (Eigen::Index i = 0; i < 6; ++i)
                jacobian.col(i) = (predict(pose.perturbed(h * Vector6::Unit(i)), shared) -
                                   predict(pose.perturbed(-h * Vector6::Unit(i)), shared)) /
                                  (2 * h);
            for (Eigen::Index i = 0; i < kShared; ++i) {
                const Eigen::VectorXd step = h * Eigen::VectorXd::Unit(kShared, i);
                jacobian.col(6 + i) = (predict(pose, shared + step) - predict(pose, shared - step)) / (2 * h);
            }
            jacobian /= kNoisePx;
            const Eigen::VectorXd residual = (predict(pose, shared) - seen) / kNoisePx;
            evidence = {pose, shared, jacobian.transpose() * jacobian, jacobian.transpose() * residual};
            const Vector6 step =
                -evidence.information.topLeftCorner<6, 6>().ldlt().solve(Vector6(evidence.gradient.head<6>()));
            if (round < 7) pose = pose.perturbed(step);
        }
        return evidence;
    }
};

}  // namespace fluorocut::test
