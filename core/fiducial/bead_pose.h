// The pose of beads of known geometry from their unlabelled shadows in one view: which shadow is which bead, and from
// where they are seen. For a phantom seen by an imager that is known roughly, and for beads in a bone seen by one that
// is known well.
//
// 1. Every triple of beads is held against a few well-spread triples of shadows: up to four poses each (Grunert 1841).
//    Sizes are a hint: a first pass takes only triples whose shadows have about the size that the poses ask for; a
//    second pass, when the first finds nothing, leaves sizes out. The rest of the beads votes for each pose.
// 2. The best poses are refined (bead_bundle.h) with shadows reassigned one to one, within an ever smaller distance,
// down
//    to what the residuals themselves allow. The intrinsics move within what is known of them beforehand.
// 3. The pose that explains the most beads wins, unless another, clearly different one explains as many about as well:
//    then the layout looks the same from both sides, and the answer is noSolution.
//
// Seeded: the order of the triples of shadows is drawn once. Does not depend on the number of threads.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/fiducial/bead_detection.h"
#include "core/fiducial/bead_layout.h"
#include "core/imaging/carm.h"

namespace fluorocut {

struct BeadPoseOptions {
    // What is known of the C-arm: standard deviations; 0: exact.
    double focal_sigma = 0;  // of the focal length, relative
    double center_sigma_px = 0;
    bool sizes_are_a_hint = true;  // false: shadows' sizes mean nothing
    int least_beads = 4;           // that must be explained
    double least_share = 0.6;      // of the layout's beads, or of the shadows when they are fewer
    double most_rms_px = 2;        // more is no picture of this layout, or one whose distortion nobody took out
    double most_chance = 1e-3;     // that shadows anywhere would fit so well: expected number of such poses
    std::uint64_t seed = 1;
    int most_triples = 40;  // of shadows that are tried

    Result<void> validate() const;
};

struct BeadMatch {
    std::size_t bead = 0;       // in the layout
    std::size_t detection = 0;  // in the list given
    Vector2 ideal_px = Vector2::Zero();
    Vector2 residual_px = Vector2::Zero();  // seen - predicted, ideal pixels
};

struct BeadPoseAlternative {
    Rigid3 imager_from_layout;
    int beads = 0;
    double rms_px = 0;
    double angle_rad = 0;  // between its rotation and that of the answer
    std::string why_not;   // a sentence
};

struct BeadPose {
    Rigid3 imager_from_layout;
    Matrix6 covariance;      // as Rigid3::perturbed has it; includes what is not known of the intrinsics
    double focal_length_mm;  // as it fits best, within what was known
    Vector2 principal_point_px;
    std::vector<BeadMatch> matches;
    std::vector<std::size_t> missing;      // beads without a shadow, inside the image
    std::vector<std::size_t> outside;      // beads whose shadow lies outside the image
    std::vector<std::size_t> unexplained;  // detections that are no bead
    double rms_px;                         // per coordinate
    std::optional<BeadPoseAlternative> second_best;
    std::vector<std::string> warnings;
    long long hypotheses = 0;  // poses that were voted on
    double elapsed_ms;

    BeadPose();  // NaN: not run
};

Result<BeadPose> estimateBeadPose(const std::vector<BeadDetection>& detections, const BeadLayout& layout,
                                  const CArm& carm, const BeadPoseOptions& options = {},
                                  Progress& progress = Progress::none());

}  // namespace fluorocut
