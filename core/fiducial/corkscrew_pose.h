// The 6D pose of a corkscrew from one X-ray image (the paper's "C-arm pose estimation", its second contribution), with
// its covariance, its second best explanation, and a refusal where two explanations can not be told apart.
//
//   detect (or look near a previous pose) -> fit the shape from the candidates, with roll of either sign, both
//   directions of the axis and several twists -> fit the image where the shape leaves it open -> compare -> judge.
//
// Frames: `imager`, `corkscrew`. The image is in the C-arm's (distorted) pixels, of either polarity.
//
// Covariance: of the image's noise, plus what the calibration does not know (CalibrationUncertainty). The errors that
// follow the calibration are the same in all images of one C-arm: differences of poses are better known than poses.
//
// noSolution, each with its own sentence: no corkscrew in the image; too much of it outside; two poses that explain the
// image equally well ("turn the corkscrew or the C-arm by 10 degrees"); the layout does not fit what is seen; the
// perspective contradicts focal length and pixel size.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/acceptance.h"
#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/fiducial/corkscrew_detection.h"
#include "core/fiducial/corkscrew_layout.h"
#include "core/fiducial/corkscrew_refinement.h"
#include "core/geometry/pose.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"

namespace fluorocut {

// Standard deviations of what is taken as known.
struct CalibrationUncertainty {
    double focal_length = 0.001;       // relative
    double principal_point_mm = 0.3;   // at the detector
    double distortion_mm = 0.01;       // left by the distortion map, at the detector, per axis
    double distortion_length_mm = 30;  // over which that is alike
    double dimensions_mm = 0.02;       // each of the fiducial's

    Result<void> validate() const;
};

struct CorkscrewPoseLimits {
    double most_rotation_rad = 0.0052;  // standard deviation about the worst axis: 0.3 degrees
    double most_in_plane_mm = 0.5;
    double most_depth_mm = 1.5;
    double least_score = 0.7;
    double most_rms_px = 0.5;

    Result<void> validate() const;
};

struct CorkscrewPoseOptions {
    std::optional<Rigid3> initial;  // imager_from_corkscrew, of the previous image: no search while it leads to a fit
    CorkscrewDetectionOptions detection;
    CalibrationUncertainty calibration;
    CorkscrewPoseLimits limits;

    Result<void> validate() const;
};

struct CorkscrewAlternative {
    Rigid3 imager_from_corkscrew;
    double score = 0;
    double log_likelihood_ratio = 0;  // of the answer against it
    double angle_rad = 0;             // between its rotation and that of the answer
    std::string why_not;              // a sentence
};

struct CorkscrewPose {
    Pose imager_from_corkscrew;  // with its covariance, the calibration's part included
    Matrix6 noise_covariance;    // the part that differs from image to image
    PoseEvidence evidence;       // see corkscrewParameters()
    double score = 0;
    double rms_px;
    double visible = 0;
    bool metal_is_bright = false;
    bool tracked = false;  // found from `initial`
    std::optional<CorkscrewAlternative> second_best;
    std::vector<std::string> warnings;
    Acceptance acceptance;
    double elapsed_ms;

    CorkscrewPose();  // NaN: not run
};

Result<CorkscrewPose> estimateCorkscrewPose(const Image& image, const CArm& carm, const CorkscrewLayout& layout,
                                            const CorkscrewPoseOptions& options = {},
                                            Progress& progress = Progress::none());

}  // namespace fluorocut
