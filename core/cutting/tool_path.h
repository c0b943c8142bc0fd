// Tool paths: how the cutter takes a cavity out, layer by layer along its axis, spindle along +z (the paper) or tilted
// within limits where the cavity is not straight.
//
// In a layer the ball's centre may be wherever the cavity's signed distance is <= -radius. The outermost loop runs
// along that border, inner ones a step-over apart (offsets of the cross section), joined so that the cutter leaves the
// material only where it must. Entry from above, along the axis, where the layer above is already gone.
//
// Feed by bite: the slower of the largest feed and removal rate / (layer height * radial bite).
//
// Frame `cavity`, mm, s. A path is a proposal: only `checkToolPath` (envelope_check.h) makes of it what a robot may
// run.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/cutting/swept_tool.h"
#include "core/image/volume.h"

namespace fluorocut {

enum class ToolMotion { rapid, entry, cut, retract };

struct ToolMove {
    ToolSegment segment;
    ToolMotion motion = ToolMotion::cut;
    double feed_mm_s = 0;
};

struct ToolPathOptions {
    Cutter cutter;
    double step_down_mm = 1.0;
    double step_over_mm = 2.0;
    double tolerance_mm = 0.02;  // of chords against the exact border, always inside it
    double clearance_mm = 5;     // above the top, for rapid moves
    double most_tilt_rad = 0;    // of the spindle from +z; 0: constant orientation
    double most_feed_mm_s = 20, plunge_feed_mm_s = 3, rapid_mm_s = 60;
    double removal_rate_mm3_s = 60;

    Result<void> validate() const;
};

struct ToolPath {
    Cutter cutter;
    std::vector<ToolMove> moves;
    int layers = 0;
    double cutting_mm = std::numeric_limits<double>::quiet_NaN();
    double time_s = std::numeric_limits<double>::quiet_NaN();
    std::vector<std::string> warnings;
};

// `field`: the cavity's signed distance, running on above `top_mm` (core/planning/cavity.h makes one; any will do).
// noSolution when the cutter does not fit in anywhere.
Result<ToolPath> planToolPath(const Volume& field, double top_mm, const ToolPathOptions& options = {},
                              Progress& progress = Progress::none());

}  // namespace fluorocut
