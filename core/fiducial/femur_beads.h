// The femur's pose in one or more views from beads in its bone: which shadow is which bead, imager_from_femur per view
// with its covariance, and what each image says (PoseEvidence) for those who chain poses. Frame of the layout: `femur`.
//
// 1. Each view on its own: shadows are labelled by geometry (bead_pose.h); beads may be missing, other round shadows
//    (screw heads) present.
// 2. All views together: weighted, robust least squares over all poses. Where the views' geometry is known (co-
//    registration), it enters as a measurement with its covariance, and a view that shows too few beads to stand alone
//    is labelled from where the others say they are.
// 3. What detections do not know of their own errors (left-over distortion, bone's texture) is one number, estimated
//    over all views from the residuals and from what is usual: a handful of beads alone does not tell it.
//
// Covariance: of the shadows, and of what the calibration and the beads' places do not know (BeadUncertainty). The
// latter are the same in all images: evidence carries them as shared parameters, in the order of beadParameters().
//
// noSolution: no view shows the layout ("wrong beads file?"). A view that does not is named in `rejected` where others
// do. invalidInput: beads that contradict the views' known geometry (femur_bead_geometry.h): swapped images, a
// corkscrew that moved. Nothing is random but the seeded search.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/acceptance.h"
#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/fiducial/bead_detection.h"
#include "core/fiducial/bead_layout.h"
#include "core/fiducial/bead_pose.h"
#include "core/geometry/pose.h"
#include "core/geometry/pose_evidence.h"
#include "core/imaging/carm.h"

namespace fluorocut {

// Standard deviations of what is taken as known.
struct BeadUncertainty {
    double focal_length = 0.001;  // relative
    double principal_point_px = 1;
    double bead_mm = 0.05;         // where each bead lies in the bone, per axis
    double unexplained_px = 0.03;  // usual errors of shadows that their covariances know nothing of

    Result<void> validate() const;
};

struct FemurBeadLimits {
    double most_fre_px = 0.5;      // root mean square per coordinate, of the worst view
    double least_share = 0.5;      // of the beads inside a view's image that were found, in the worst view
    double most_sigma_mm = 1.5;    // of the beads' middle, in its worst direction (depth), in the worst view
    double most_size_error = 0.2;  // shadows' radii against the layout's, median, relative: another layout, or scale

    Result<void> validate() const;
};

struct FemurBeadOptions {
    BeadUncertainty uncertainty;
    // Screw heads may outnumber the beads; that a pose is no chance is judged besides (most_chance). Its focal_sigma
    // and center_sigma_px are not used: the calibration is taken as it is.
    BeadPoseOptions search{.least_share = 0.35, .most_triples = 400};
    int guided_beads = 3;  // that a view must show at least when the other views say where to look
    FemurBeadLimits limits;

    Result<void> validate() const;
};

struct FemurView {
    std::string name;
    std::vector<BeadDetection> detections;
    CArm carm;
    // imager_from_imager of the first view, where it is known; mm and rad as Rigid3::perturbed has them. Not of the
    // first view itself.
    std::optional<Rigid3> imager_from_first;
    Matrix6 covariance_from_first = Matrix6::Zero();
};

struct FemurBead {
    std::size_t bead = 0;                   // in the layout
    std::size_t detection = 0;              // in the view's
    Vector2 residual_px = Vector2::Zero();  // seen - predicted
    double residual_mm = 0;                 // the same at the bead, across its ray
    bool used = true;                       // false: too far off; it counts for nothing
};

struct FemurViewPose {
    std::string name;
    Pose imager_from_femur;    // covariance: all of it
    Matrix6 noise_covariance;  // the part of this image's (and the others', through known geometry) shadows
    PoseEvidence evidence;     // of this image alone
    std::vector<FemurBead> beads;
    std::vector<std::size_t> missing, outside, unexplained;  // as in BeadPose
    double fre_px;                                           // root mean square per coordinate
    double fre_mm;                                           // root mean square length, at the beads
    double size_error;                                       // median of seen over predicted radius, minus 1
    double sigma_mm;                                         // of the beads' middle, worst direction
    bool guided = false;                                     // labelled from where other views say the beads are
    std::optional<BeadPoseAlternative> second_best;

    FemurViewPose();  // NaN: not run
};

struct FemurBeads {
    std::vector<FemurViewPose> views;   // those that were solved, in the order given
    std::vector<std::string> rejected;  // sentences on those that were not
    double unexplained_px;              // as estimated
    std::vector<std::string> warnings;
    Acceptance acceptance;
    double elapsed_ms;

    FemurBeads();
};

// "focal length" (relative), "image centre u", "image centre v" (px), then "bead b1 x" (mm), ...
std::vector<std::string> beadParameters(const BeadLayout& layout);
// Their standard deviations, in the same order.
Eigen::VectorXd beadParameterSigmas(const BeadLayout& layout, const BeadUncertainty& uncertainty);

Result<FemurBeads> registerBeads(const std::vector<FemurView>& views, const BeadLayout& layout,
                                 const FemurBeadOptions& options = {}, Progress& progress = Progress::none());

}  // namespace fluorocut
