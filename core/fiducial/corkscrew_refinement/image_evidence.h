// What a fit of the image tells about the pose, beside the pose: how sure it is, how it follows what images share, and
// how it is moved by an error of the distortion map.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/fiducial/corkscrew_refinement/ray_map.h"
#include "core/fiducial/corkscrew_refinement/solid_pieces.h"
#include "core/geometry/pose_evidence.h"
#include "core/image/image.h"

namespace fluorocut::corkscrew {

// What follows along with the pose: gains of the parts, variance of the blur (px^2), pedestal of stray light (of the
// open background). With what is known of them beforehand.
enum Follower { gainsFirst = 0, blur_variance = kParts, pedestal, kFollowers };
using Followers = Eigen::Matrix<double, kFollowers, 1>;
constexpr int kUnknowns = 6 + kFollowers;
using Row = Eigen::Matrix<double, kUnknowns, 1>;
using Square = Eigen::Matrix<double, kUnknowns, kUnknowns>;

// d log(predicted) / d unknowns at the pixels that play a part, high-passed.
struct Jacobian {
    std::vector<std::uint32_t> pixels;
    std::vector<float> rows;  // pixels.size() x kUnknowns
    Rigid3 pose;              // where it was taken
    Followers followers = Followers::Zero();
};

struct Weighted {
    std::vector<double> residuals, weights;  // in standard deviations of the noise; Tukey's
    double scale = 1;
    // A step of least squares with fixed weights is too short where many residuals lie on the weights' slopes: sum of
    // the weights over that of the influence's derivative (Huber's step).
    double stride = 1;
};

// A fit at its end.
struct Linearisation {
    const PixelRegion& region;
    Vector2 pixel_mm;
    const Jacobian& jacobian;
    std::vector<float> shared;  // jacobian.pixels.size() x parameters
    const Weighted& at;
    const Image& inverse_sigma;
    const Square& normal;  // with what is known of the followers
    const Row& right;
    std::array<Image, 2> gradient;  // of the high-passed log(predicted), per pixel along columns and rows
};

// Evidence on pose and shared parameters; the followers are eliminated. Its information is that of independent pixels
// over a variance factor: noise is correlated over the detector's blur, and clutter is neither independent nor normal.
// The factor is the ratio of the pose's two covariances, mean over its six directions: with the residuals' own
// autocorrelation (G S G^T, G the fit's gain), and without.
PoseEvidence evidenceOf(const Linearisation& fit, const Rigid3& pose);

// CorkscrewFit::distortion_gain.
Matrix6 distortionGain(const Linearisation& fit, double length_mm);

}  // namespace fluorocut::corkscrew
