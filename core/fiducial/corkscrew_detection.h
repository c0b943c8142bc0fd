// Where a corkscrew might be in an image, with no idea beforehand: the paper's three passes, made to hold in a picture
// full of bone, screws, clamps and a cutter's spindle. Result: a few candidate poses, good enough for a fit to start
// from (within about 4 degrees and 3 % of the depth); which of them is true is decided by fits to the image
// (corkscrew_refinement.h, corkscrew_pose.h).
//
// 1. Shaft: straight dark lines of about the shaft's width by a Hough transform. Not only the longest: a clamp, a
//    cortex or a spindle may be longer.
// 2. Rings: along each line, in full perspective, the pattern of ring ellipses: place along the line, depth, roll with
//    either sign, and both directions of the axis.
// 3. Helix: its phase, by a scan of the twist.
//
// Pixels are the image's own, distorted; the C-arm's distortion is taken into account. Either polarity (metal dark, or
// metal bright) is recognised. Seeded by nothing: the same image gives the same answer, on any number of threads.
//
// noSolution: nothing in the image looks like the layout; the sentence says what was looked for and what was found.
#pragma once

#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/fiducial/corkscrew_layout.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"

namespace fluorocut {

struct CorkscrewDetectionOptions {
    // Source to corkscrew, as parts of the focal length.
    double least_depth = 0.4;
    double most_depth = 0.97;
    double steepest_rad = 1.15;  // of the shaft out of the image plane: 66 degrees
    double least_visible = 0.5;  // of the wires' length, inside the lit field and not behind opaque metal
    int most_candidates = 8;

    Result<void> validate() const;
};

struct CorkscrewCandidate {
    Rigid3 imager_from_corkscrew;
    double score = 0;    // 0 to 1: share of the wires' visible length that lies on dark ridges of the right direction
    double visible = 0;  // share of the wires' length inside the lit field and not behind opaque metal
};

struct CorkscrewDetection {
    bool metal_is_bright = false;                // the image's polarity
    std::vector<CorkscrewCandidate> candidates;  // best first, no two nearly the same; at least one
    double elapsed_ms;

    CorkscrewDetection();  // NaN: not run
};

Result<CorkscrewDetection> detectCorkscrew(const Image& image, const CArm& carm, const CorkscrewLayout& layout,
                                           const CorkscrewDetectionOptions& options = {},
                                           Progress& progress = Progress::none());

}  // namespace fluorocut
