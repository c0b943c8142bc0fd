// How well a corkscrew's pose is found: in random scenes, and in the paper's own experiment.
//
// Accuracy. Random scenes (corkscrew_scenes.h), each estimated from scratch and, with the corkscrew moved a little,
// once more from the answer before (tracking). Errors are those of accepted answers, against the truth in the frame of
// the C-arm as it is known: twist, roll and pitch of R = Rz(pitch) Ry(roll) Rx(twist), differences taken the short way
// round; x, y, depth of the corkscrew's middle. A gross failure is off by more than 1 degree (the whole rotation) or 2
// mm. A truth lies in an answer's 95 % region when d^T C^-1 d is at most chi-square's 95 % quantile (6 degrees of
// freedom, or 3 for place and rotation alone).
//
// Tables 1 and 2. C-arm unaltered, one image; the corkscrew moved by the robot, by one angle or along one axis of the
// imager, another image; the computed movement against the robot's. C-arms are bent, and known by a fitted map.
// Repeated with other C-arms, and beside it the paper's closed form and the paper's figures.
//
// The estimator sees an image, a C-arm and a layout; never a truth.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/experiments/corkscrew_scenes.h"
#include "core/experiments/error_figures.h"
#include "core/fiducial/corkscrew_pose.h"

namespace fluorocut {

using CorkscrewEstimator = std::function<Result<CorkscrewPose>(const Image&, const CArm&, const CorkscrewLayout&,
                                                               const CorkscrewPoseOptions&)>;
CorkscrewEstimator corkscrewEstimator();  // estimateCorkscrewPose

// ---- accuracy

struct CorkscrewAccuracyOptions {
    CorkscrewSceneOptions scenes;
    int trials = 100;
    // Of the corkscrew between an image and the next one, which is found by tracking: uniform in a ball. Both 0: none.
    double tracked_turn_rad = radiansFromDegrees(2);
    double tracked_way_mm = 4;
    CorkscrewPoseOptions pose;

    Result<void> validate() const;
};

struct CorkscrewTrial {
    std::uint64_t index = 0;
    bool answered = false;
    bool accepted = false;
    bool gross = false;
    std::string refusal;           // the sentence, when there was no answer or it was not accepted
    Vector3 angles_deg, place_mm;  // errors; NaN without an answer
    double rotation_deg;           // of the whole rotation
    double elapsed_ms;
    double chi_square;  // of the pose's error
    double visible = 0, covered = 0;
    std::string objects;

    CorkscrewTrial();  // NaN: not run
};

struct CorkscrewAccuracy {
    std::vector<CorkscrewTrial> trials;
    int answered = 0;
    int accepted = 0;
    int gross_accepted = 0;
    int gross_refused = 0;  // wrong, and not accepted
    ErrorFigures twist_deg, roll_deg, pitch_deg, x_mm, y_mm, depth_mm;
    // Shares of the accepted answers whose 95 % region holds the truth.
    double pose_covered, place_covered, rotation_covered;
    double median_ms, percentile_95_ms;

    int tracked = 0;  // answers accepted from the pose before, of all that were tried
    int tracking_tried = 0;
    int tracked_gross = 0;
    double tracking_median_ms, tracking_percentile_95_ms;
    double map_error_mm;  // rms over the bent imagers' fields, mean of the scenes; 0: not bent

    CorkscrewAccuracy();  // NaN: not run
};

Result<CorkscrewAccuracy> measureCorkscrewAccuracy(const CorkscrewAccuracyOptions& options,
                                                   Progress& progress = Progress::none(),
                                                   const CorkscrewEstimator& estimate = corkscrewEstimator());

// ---- Tables 1 and 2

// In the order of the paper: twist, roll, pitch (degrees), x, y, z (mm).
inline constexpr std::array<const char*, 6> kCorkscrewMotions{"twist", "roll", "pitch", "x", "y", "z"};
inline constexpr std::size_t kPaperTrials = 5;

struct PaperTrial {
    double moved = 0;     // by the robot
    double computed = 0;  // by the paper
};
// paper_table[motion][trial]
using PaperTable = std::array<std::array<PaperTrial, kPaperTrials>, kCorkscrewMotions.size()>;
const PaperTable& paperCorkscrewTable();

struct CorkscrewTablesOptions {
    CorkscrewSceneOptions scenes;  // poses, clutter and visibility are the experiment's own
    int repeats = 10;              // C-arms
    CorkscrewPoseOptions pose;

    Result<void> validate() const;
};

struct CorkscrewTableCell {
    ErrorFigures errors;  // of the computed movement, over the repeats
    double computed;      // movement, mean over the repeats
    int refused = 0;      // an image of the two gave no answer

    CorkscrewTableCell();  // NaN
};
using CorkscrewTable = std::array<std::array<CorkscrewTableCell, kPaperTrials>, kCorkscrewMotions.size()>;

struct CorkscrewTables {
    CorkscrewTable cells;
    std::array<ErrorFigures, kCorkscrewMotions.size()> errors;  // over trials and repeats
    int images = 0, refused = 0;
};

// A pose from an image: how it comes by it does not matter here.
using PoseFromImage = std::function<Result<Rigid3>(const Image&, const CArm&, const CorkscrewLayout&)>;

// FluoroCut's (an answer that is not accepted counts as none), and the paper's closed form, from features that are
// looked for near FluoroCut's answer to the same image: they belong together, in this order.
std::vector<PoseFromImage> corkscrewMethods(const CorkscrewPoseOptions& options = {});

// One result for each method, of the same images: every image is given to each method, in turn.
Result<std::vector<CorkscrewTables>> runCorkscrewTables(const CorkscrewTablesOptions& options,
                                                        const std::vector<PoseFromImage>& methods,
                                                        Progress& progress = Progress::none());

}  // namespace fluorocut
