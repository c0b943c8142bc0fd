// One pose from what was known beforehand and from all measurements since: weighted least squares on SE(3).
//
//     minimise  r^T S^-1 r,   r = (prior - x, z_1 - x, ..., z_n - x)      differences as Rigid3::deltaFrom has them
//     S = blockdiag(P, R_1, ..., R_n) + (0, 1, ..., 1)(0, 1, ..., 1)^T (x) C
//
// P: covariance of what was known; R_k: of errors that measurement k has alone; C: of errors that all measurements
// share, which no number of them makes less: the estimate's covariance has the floor C as far as P does not help. With
// r = e - H x to first order, x = (H^T S^-1 H)^-1 H^T S^-1 e (Gauss and Markov), taken again at the estimate until it
// stands still.
//
// The prior is put in once, and all measurements with it: adding them one after another would count C as new each time.
//
// Frames: all poses are the same target_from_source; covariances as Rigid3::perturbed has them. mm, rad.
#pragma once

#include <vector>

#include "core/base/result.h"
#include "core/geometry/rigid3.h"

namespace fluorocut {

struct MeasuredPose {
    Rigid3 pose;
    Matrix6 covariance = Matrix6::Zero();
};

struct FusedPose {
    Rigid3 pose;
    Matrix6 covariance;
    // By how much the estimate follows the prior, and each measurement: they add up to the identity.
    Matrix6 prior_weight;
    std::vector<Matrix6> weights;
    double chi_square = 0;       // of the differences, r^T S^-1 r
    int degrees_of_freedom = 0;  // 6 n
    double probability = 1;      // of a larger one; 1 without measurements
};

// invalidInput: a covariance that is not finite or not positive definite (the common one: semidefinite); noSolution:
// poses so far apart that the first order does not hold.
Result<FusedPose> fusePoses(const MeasuredPose& prior, const std::vector<MeasuredPose>& measurements,
                            const Matrix6& common_covariance);

}  // namespace fluorocut
