// Beads of known geometry seen in one or more views: poses, and if wanted the imager's intrinsics, by least squares
// over all of them at once (Schreiner et al. solve one view; the sum over views is what parts focal length from depth).
//
//     u = f X Z / (Z^2 - r^2) + c_x,    v = a f Y Z / (Z^2 - r^2) + c_y,    (X, Y, Z) = imager_from_layout * bead
//     minimise sum rho( r^T (S + s^2 I)^-1 r ) + priors,                    rho: Cauchy
//
// u, v ideal pixels (without distortion) of the shadow's centre (sphere_shadow.h); f in pixels of a row, a = p_x / p_y;
// S a detection's covariance, s what no covariance knows of (left-over distortion), found so that the sum of squares is
// what it should be. Solved by Ceres. Covariance: of the weighted normal equations.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/base/result.h"
#include "core/fiducial/bead_layout.h"
#include "core/geometry/rigid3.h"

namespace fluorocut {

struct PixelIntrinsics {
    double focal_px = 0;  // f / p_x
    Vector2 principal_point_px = Vector2::Zero();
    double aspect = 1;  // p_x / p_y
};

// Standard deviations of what is known beforehand about the start's intrinsics; 0: fixed, infinite: nothing known.
struct IntrinsicsPrior {
    double focal_px = 0;
    double principal_point_px = 0;
    double aspect = 0;
};

struct BeadObservation {
    std::size_t bead = 0;  // in the layout
    Vector2 ideal_px = Vector2::Zero();
    Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();
};

struct BundleView {
    Rigid3 imager_from_layout;
    std::vector<BeadObservation> observations;
};

struct BundleOptions {
    double least_unexplained_px = 0.005;  // s, at least
    int iterations = 50;
};

struct BundleResult {
    PixelIntrinsics intrinsics;
    std::vector<BundleView> views;
    // f c_x c_y a, then for each view (tx ty tz rx ry rz) as Rigid3::perturbed has it; zero for what was fixed.
    // Infinite in directions that the views do not determine at all.
    Eigen::MatrixXd covariance;
    std::vector<std::vector<Vector2>> residuals_px;  // seen - predicted
    double rms_px = 0;                               // per coordinate
    double unexplained_px = 0;                       // s
    bool converged = false;
};

Vector2 predictedPixel(const PixelIntrinsics& intrinsics, const Vector3& center_in_imager, double radius_mm);

Result<BundleResult> solveBundle(const BeadLayout& layout, const std::vector<BundleView>& views,
                                 const PixelIntrinsics& start, const IntrinsicsPrior& prior,
                                 const BundleOptions& options = {});

}  // namespace fluorocut
