// How sure a fit is whose residuals are correlated: the detector's blur over a pixel or two, and over longer ways what
// the model does not know (the CT's own error, the projector's, scatter).
//
// An unknown's error is the sum of psi(pixel) q(pixel), psi its influence and q the (robustly weighted) residual in
// standard deviations. With C(lag) the residuals' own autocovariance, as the image shows it,
//
//     covariance(k, l) = sum over pixels i, j of psi_k(i) C(j - i) psi_l(j)
//
// (Newey and West 1987, in two dimensions; the lag window is Parzen's, so that no variance comes out negative), by
// Fourier transforms.
#pragma once

#include <Eigen/Core>

namespace fluorocut::cavity {

// `influence`: pixels (row by row of `width` x `height`) x unknowns. `residual`: of every pixel.
Eigen::MatrixXd correlatedCovariance(const Eigen::MatrixXf& influence, const Eigen::VectorXf& residual, int width,
                                     int height);

}  // namespace fluorocut::cavity
