// Unknown poses, and parameters that images share, from what images say of chains of them: one weighted least-squares
// problem. Hand-eye calibration and the co-registration of views are such networks:
//
//     imager_from_corkscrew_i = imager_k_from_robot * robot_from_flange_i * flange_from_corkscrew
//                               (unknown)             (known)               (unknown)
//
// Each factor compares the product of a chain with the PoseEvidence of one image, a quadratic in the pose and in the
// shared parameters (focal length, dimensions of a fiducial):
//
//     minimise  sum_i w_i (g_i . d_i + d_i^T H_i d_i / 2) + (s - s0)^T Q (s - s0) / 2,    d_i = (pose_i, s) - where the
//                                                                                               quadratic was taken
// A pose measured on its own, with a covariance, is evidence without shared parameters. A step of a chain that is
// known, but not exactly (a robot's pose), adds its covariance, carried to the end of the chain, to the image's.
//
// Gauss-Newton with Levenberg's damping over the perturbations (tx ty tz mm, rx ry rz rad) of Rigid3::perturbed, with
// exact derivatives; the problems are small and dense. Weights: 1, or for a robust solution Geman and McClure's
// w = 1 / (1 + d^2 / c^2)^2 of the factor's squared Mahalanobis distance d^2.
#pragma once

#include <functional>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "core/geometry/pose_evidence.h"
#include "core/geometry/rigid3.h"

namespace fluorocut {

struct PoseStep {
    int variable = -1;  // index of an unknown pose, or -1: `known`
    Rigid3 known{};
    Matrix6 covariance = Matrix6::Zero();  // of what is known, in its target frame
    bool inverted = false;                 // the step is the inverse of the above

    static PoseStep unknown(int variable) { return {.variable = variable}; }
    static PoseStep inverseOf(int variable) { return {.variable = variable, .inverted = true}; }
    static PoseStep exactly(const Rigid3& pose) { return {.known = pose}; }
    static PoseStep about(const Rigid3& pose, const Matrix6& covariance) {
        return {.known = pose, .covariance = covariance};
    }
};

struct PoseFactor {
    std::vector<PoseStep> chain;  // from left to right
    PoseEvidence evidence;        // of their product
    std::vector<int> shared;      // for each of the evidence's parameters, which of the network's it is
    double weight = 1;            // 0: left out
};

// Evidence of a pose that somebody else measured: no shared parameters. The covariance must be positive definite.
PoseEvidence evidenceOf(const Rigid3& target_from_source, const Matrix6& covariance);

// The same evidence from an image that tells poses only to `own_covariance`, because of more than the noise it knows of
// (what a distortion map leaves): its information, on the shared parameters too, goes down by the mean ratio of the
// variances. Never up.
PoseEvidence withNoise(PoseEvidence evidence, const Matrix6& own_covariance);

// The same evidence without what the image says of the shared parameters by itself, whatever its pose: the pose still
// follows them, and they are still corrected by poses that have to agree. What one image says of a focal length is a
// matter of hundredths of a pixel, less than distortion maps and fits are good for.
PoseEvidence posesOnly(PoseEvidence evidence);

struct PoseNetwork {
    std::vector<Rigid3> poses;  // where the search starts
    Eigen::VectorXd shared;     // and, for the parameters, what is known beforehand
    Eigen::MatrixXd shared_information;
    std::vector<PoseFactor> factors;
};

struct PoseNetworkOptions {
    // c of the robust weights, in standard deviations; infinite: plain least squares.
    double robust_scale = std::numeric_limits<double>::infinity();
    int iterations = 60;
    // Asks image i again at a pose and values of its parameters that have moved from where its quadratic was taken; may
    // be empty. An answer is used, a failure (empty information) keeps the old one.
    std::function<PoseEvidence(std::size_t factor, const Rigid3& pose, const Eigen::VectorXd& shared)> relinearise;
};

struct PoseNetworkResult {
    std::vector<Rigid3> poses;
    Eigen::VectorXd shared;
    // (tx ty tz rx ry rz) of every pose, then the shared parameters. Infinite variances become huge ones.
    Eigen::MatrixXd covariance;
    std::vector<Vector6> residuals;         // seen, given the shared parameters, minus predicted: in the target frame
    std::vector<double> squared_distances;  // Mahalanobis, 6 degrees of freedom, per factor
    std::vector<double> weights;            // as used
    double prior_distance = 0;              // squared, of the shared parameters from what was known
    bool converged = false;

    // Of one pose.
    Matrix6 covarianceOf(int pose) const { return covariance.block<6, 6>(6 * pose, 6 * pose); }
};

// Throws std::logic_error when sizes do not belong together.
PoseNetworkResult solvePoseNetwork(const PoseNetwork& network, const PoseNetworkOptions& options = {});

// d (product of the chain) / d (pose `step` of it), both as Rigid3::perturbed has them.
Matrix6 stepDerivative(const std::vector<PoseStep>& chain, std::size_t step, const std::vector<Rigid3>& poses);
Rigid3 product(const std::vector<PoseStep>& chain, const std::vector<Rigid3>& poses);

}  // namespace fluorocut
