// Robust linear least squares: values = design * c + noise, the noise of known relative size, some values far off.
//
// M-estimation with Tukey's biweight (c = 4.685: 95 % efficiency where all is well) on residuals scaled by the median
// absolute deviation, started from Huber's weights (Holland and Welsch 1977). A value farther off than 4.685 of the
// scale weighs nothing: it is rejected.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace fluorocut {

constexpr double kTukeyLimit = 4.685;

struct RobustFit {
    Eigen::VectorXd coefficients;
    Eigen::VectorXd residuals;  // value - design * coefficients, in the values' unit
    std::vector<char> used;     // 0: rejected
    int used_count = 0;
    double scale = 0;  // of the residuals, in the given sigmas: 1 when those are right
    // Covariance of the coefficients = variance_factor * (design^T diag(1 / sigma^2) design)^-1 over the used ones
    // (Huber 1981, 7.6): scale^2, made a little larger for the weights' loss.
    double variance_factor = 0;
};

// The design must have full rank on
// what is used; otherwise the coefficients are not finite.
RobustFit fitRobustly(const Eigen::MatrixXd& design, const Eigen::VectorXd& values, const Eigen::VectorXd& sigmas);

}  // namespace fluorocut
