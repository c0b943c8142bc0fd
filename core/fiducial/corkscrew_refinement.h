// The pose of a corkscrew by fits to an image, from a start near it, in full perspective and in the image's own
// (distorted) pixels.
//
//   refineOnShape   centre lines of shaft, rings and helix against ridges of the image; search range
//                   shrinking, robust weights, stretches that overlap or are seen end on left out. Converges from some
//                   5 degrees and 10 mm of depth.
//   refineOnImage   predicted against seen image: log intensity = smooth background - sum of gain_k * path length
//                   through wire, shaft, rod, beads, blurred as intensities; gains, blur and background follow along;
//                   robust to clutter. Converges from about half a wire's width, and from 2 degrees by a look at the
//                   shape first; ends at the photon noise.
//
// Both start from a pose and answer with the fit that it leads to; which of several is true is for the caller to judge:
// by log_likelihood (fits to one image compare by it: all are measured against the same image without a corkscrew), by
// score and by residual, which is about 1 where the layout explains the image to its noise and clutter.
//
// An image fit gives evidence on the pose and on parameters that images share, in the order of
// corkscrewParameters(): relative focal length (f = f0 (1 + p)), principal point u and v (px, added to the C-arm's),
// then the layout's dimensions. Its information counts what the noise of this image allows, its correlation included.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/fiducial/corkscrew_layout.h"
#include "core/geometry/pose_evidence.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"

namespace fluorocut {

// Names of what a layout's images share: "focal length", "image centre u", "image centre v", then the layout's
// dimensions: "ring 1 x", "ring 1 radius", ..., "helix start x", "helix end x", "helix radius", "helix phase", ...
// (mm, rad).
std::vector<std::string> corkscrewParameters(const CorkscrewLayout& layout);
// C-arm and layout with these values added (zero: as they are).
CArm withParameters(const CArm& carm, const Eigen::VectorXd& parameters);
CorkscrewLayout withParameters(const CorkscrewLayout& layout, const Eigen::VectorXd& parameters);

struct CorkscrewFitOptions {
    bool evidence = true;              // of refineOnImage: with evidence and distortion_gain (half of its time)
    double distortion_length_mm = 30;  // see CorkscrewFit::distortion_gain

    Result<void> validate() const;
};

struct CorkscrewFit {
    Rigid3 imager_from_corkscrew;
    // Of refineOnImage only.
    PoseEvidence evidence;
    // Covariance of the pose's error that comes of a smooth error of the distortion map: a random field with a standard
    // deviation of 1 mm per axis at the detector and the covariance exp(-d^2 / (2 distortion_length_mm^2)). To be
    // scaled by the variance.
    Matrix6 distortion_gain = Matrix6::Zero();
    double residual;        // robust standard deviation of log(seen) - log(predicted), in units of its noise
    double log_likelihood;  // robust, against the image without a corkscrew
    // Of both.
    double score = 0;    // 0 to 1: share of the wires' visible length that is seen where it should be; what is crowded,
                         // seen end on or near the shaft does not count
    double rms_px;       // of the centre lines that were seen, across the line
    double visible = 0;  // share of the wires' length inside the image
    int iterations = 0;
    bool converged = false;

    CorkscrewFit();  // NaN: not run
};

// `image`: metal dark (proportional to photons). Both: noSolution when too little of it is seen to go on.
Result<CorkscrewFit> refineOnShape(const Image& image, const CArm& carm, const CorkscrewLayout& layout,
                                   const Rigid3& start, Progress& progress = Progress::none());
Result<CorkscrewFit> refineOnImage(const Image& image, const CArm& carm, const CorkscrewLayout& layout,
                                   const Rigid3& start, const CorkscrewFitOptions& options = {},
                                   Progress& progress = Progress::none());

}  // namespace fluorocut
