// Tool paths: how the cutter takes a cavity out, layer by layer along its axis, spindle along +z (the paper) or tilted
// within limits where the cavity is not straight.
//
// In a layer the ball's centre may be wherever ball and shank lie in the cavity (ball_region.h). The outermost loop
// runs along that border, inner ones a step-over apart (offsets of the cross section), cut from the inside out and
// joined so that the cutter leaves the material only where it must. It comes in from above along its spindle, where the
// layers above are already gone, and goes down from layer to layer inside the cavity.
//
// Cusps: passes a distance c apart leave ridges of
//
//     h = radius - sqrt(radius^2 - c^2/4)
//
// on what they cut. Layers are as thick as `step_down_mm` where the wall is steep, and thinner where c, the way from a
// layer's border to the next one's, would leave more than `most_cusp_mm`. A floor, of which no lower layer comes near,
// is cut with loops so close.
//
// Tilt: for every layer the spindle is chosen, among directions within the limit, for which the shank clears the most
// of what the ball can reach; what that leaves is gone over again with another direction, up to six in all. The limit
// 0 leaves +z as the only direction.
//
// Feed by bite: the slower of the largest feed and removal rate / (layer height * radial bite); the first loop of a
// layer cuts a slot as wide as the cutter.
//
// Way in: above the top the cutter stays in the straight prism over the cavity's section there; rapid moves, and turns
// of the spindle, happen in the clearance plane, where the ball is wholly `clearance_mm` above the top.
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
#include "core/geometry/triangle_mesh.h"
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
    double most_cusp_mm = 0.05;  // between passes over walls and floors
    double tolerance_mm = 0.02;  // of chords against the exact border, always inside it
    double clearance_mm = 5;     // above the top, for rapid moves
    double most_tilt_rad = 0;    // of the spindle from +z; 0: constant orientation
    double most_feed_mm_s = 20, plunge_feed_mm_s = 3, rapid_mm_s = 60;
    double removal_rate_mm3_s = 60;

    // Names the field, the value and the limit.
    Result<void> validate() const;

    // Heights of the ball's centre in rapid moves, and, a little above, of the end of the straight way in, beyond which
    // nothing is asked of the shank.
    double clearancePlane(double top_mm) const { return top_mm + cutter.radius_mm + clearance_mm; }
    double openPlane(double top_mm) const { return clearancePlane(top_mm) + 1; }
};

struct ToolPath {
    Cutter cutter;
    double most_cusp_mm = std::numeric_limits<double>::quiet_NaN();  // it was planned to leave
    std::vector<ToolMove> moves;
    int layers = 0;
    double cutting_mm = std::numeric_limits<double>::quiet_NaN();  // length of the moves that cut
    double time_s = std::numeric_limits<double>::quiet_NaN();      // sum of length / feed
    double unreached = std::numeric_limits<double>::quiet_NaN();   // share of the ball's places the shank keeps it from
    std::vector<std::string> warnings;
};

// `field`: the cavity's signed distance, known at least to `top_mm` (core/planning/cavity.h makes one; any will do), on
// a grid along the frame's axes. invalidOption when the cutter is too short for the cavity; noSolution when it does not
// fit in anywhere.
Result<ToolPath> planToolPath(const Volume& field, double top_mm, const ToolPathOptions& options = {},
                              Progress& progress = Progress::none());

// The same, with distances near the border taken from the cavity's mesh (closed at the top by a flat face): a field on
// a grid rounds off the edges and corners of the ball's places. Of a 118 mm stem, inset by 1 mm, at 0.5 mm: left 0.04
// mm instead of 0.14, and nothing beyond the mesh.
Result<ToolPath> planToolPath(const Volume& field, const TriangleMesh& planned, double top_mm,
                              const ToolPathOptions& options = {}, Progress& progress = Progress::none());

}  // namespace fluorocut
