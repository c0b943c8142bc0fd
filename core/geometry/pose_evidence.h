// PoseEvidence: what one image says of a pose and, with it, of parameters that other images share: a focal length, an
// image centre, the dimensions of a fiducial. It is the quadratic that a fit to the image ends with,
//
//     -log likelihood = constant + g . d + d^T H d / 2,    d = (pose as Rigid3::perturbed has it; shared - shared_at)
//
// so that images are solved jointly by adding what they say (normal equations of a bundle adjustment, Triggs et al.
// 2000) and, where that has moved far, by asking the images again. At the end of a fit over the pose alone the first
// six of g are zero; those of the shared parameters are not: the image pulls at them.
//
// Units: mm, rad and the parameters' own. Noise is in H: with the parameters exact, the pose's covariance is Hpp^-1.
#pragma once

#include <Eigen/Core>

#include "core/geometry/rigid3.h"

namespace fluorocut {

struct PoseEvidence {
    Rigid3 target_from_source;    // where the quadratic was taken
    Eigen::VectorXd shared;       // n values there
    Eigen::MatrixXd information;  // H, (6 + n) x (6 + n)
    Eigen::VectorXd gradient;     // g, 6 + n

    // d pose / d shared = -Hpp^-1 Hps (6 x n): how the best pose follows the parameters.
    Eigen::MatrixXd sensitivity() const;
    // The best pose for these values of the parameters.
    Rigid3 poseGiven(const Eigen::VectorXd& values) const;
    // Covariance of the pose when the parameters are exact.
    Matrix6 covariance() const;
    // Covariance of the pose when the parameters are known, from elsewhere, with this covariance (n x n; zero: exact),
    // and the image may not correct them: what somebody must expect who just uses the calibration.
    Matrix6 covarianceWith(const Eigen::MatrixXd& shared_covariance) const;
};

}  // namespace fluorocut
