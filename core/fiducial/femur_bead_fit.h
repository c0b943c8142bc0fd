// The least squares of femur_beads.h: the poses of all views from labelled shadows and known geometry between views.
//
//     minimise sum over shadows rho(r^T (S + s^2 I)^-1 r) + sum over views d_k^T C_k^-1 d_k
//     d_k: of imager_k_from_first as the poses have it from what is known;  rho: Geman and McClure, c = 4
//
// and once more by plain least squares without the shadows farther than four standard deviations.
// s, per coordinate, solves chi^2(s) = what the degrees of freedom let expect, with the usual value counted as
// kPriorDegrees residuals. Gauss-Newton with Levenberg's damping.
#pragma once

#include <vector>

#include "core/fiducial/bead_bundle.h"
#include "core/geometry/pose_evidence.h"

namespace fluorocut::femur_beads {

struct Seen {
    std::size_t bead, detection;
    Vector2 ideal_px;
    Matrix2 covariance_px2;
    double weight = 1;  // set by fit(): 0 left out, 1 used
};

struct FitView {
    PixelIntrinsics intrinsics;
    Rigid3 imager_from_femur;  // start, then answer
    std::vector<Seen> seen;
    bool is_first = false;
    bool geometry_known = false;
    Rigid3 imager_from_first;  // where it is known
    Matrix6 covariance_from_first = Matrix6::Zero();
};

struct Fit {
    Eigen::MatrixXd covariance;   // of all poses, of the shadows' noise
    Eigen::MatrixXd sensitivity;  // of all poses to the parameters of beadParameters()
    double unexplained_px = 0;
    bool converged = false;
};

Vector2 residual(const FitView& view, const BeadLayout& layout, const Seen& seen);

Fit fit(std::vector<FitView>& views, const BeadLayout& layout, double usual_unexplained_px);

// Of the view's own shadows, at its pose.
PoseEvidence evidenceOf(const FitView& view, const BeadLayout& layout, double unexplained_px);

}  // namespace fluorocut::femur_beads
