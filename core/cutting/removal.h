// What a path leaves: the cut is carried out on paper and held against the plan. Every place's distance to what the
// cutter sweeps is exact (swept_tool.h); nothing is rasterised but what is asked for on a grid. Frame `cavity`, mm.
//
// At a place of the planned surface with normal n (out of the cavity), q the nearest place of the cutter's axis, R its
// radius and s the part of p - q across n:
//
//     left      |p - q| - R                     > 0: stays in front of p; < 0: taken behind it
//     cusp      R - sqrt(R^2 - s^2)             the part of it that is a ridge between two passes, at most what the
//     path
//                                               was planned to leave (so corners no cutter gets into are no cusps)
#pragma once

#include <limits>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/cutting/tool_path.h"
#include "core/geometry/triangle_mesh.h"
#include "core/image/volume.h"

namespace fluorocut {

struct RemovalReport {
    std::vector<double> left_mm;  // at points spread evenly over the planned surface below the top
    double left_95_mm = std::numeric_limits<double>::quiet_NaN();           // 95 % quantile of |left|
    double outside_cusps_95_mm = std::numeric_limits<double>::quiet_NaN();  // the same of left without its cusp
    double cusp_95_mm = std::numeric_limits<double>::quiet_NaN();
    double most_left_mm = std::numeric_limits<double>::quiet_NaN();
    double most_beyond_mm =
        std::numeric_limits<double>::quiet_NaN();  // farthest cut behind the plan; negative: nowhere
};

struct RemovalOptions {
    int points = 20000;

    Result<void> validate() const;
};

// `planned`: the cavity's closed mesh; the plane at `top_mm` is open. invalidInput when nothing of the mesh is below
// the top or the path is empty.
Result<RemovalReport> simulateRemoval(const ToolPath& path, const TriangleMesh& planned, double top_mm,
                                      const RemovalOptions& options = {}, Progress& progress = Progress::none());

// The part of every voxel that the path takes away, 0 to 1, in another frame's grid (a CT's): for simulated cuts. Where
// the surface passes, 27 parts of the voxel are asked, each taken as cut by a plane: 0.01 on the average, 0.05 at
// worst.
Volume removedFraction(const ToolPath& path, const Rigid3& volume_from_cavity, const VolumeGrid& grid);

// The surface of what the path takes away below `top_mm`, closed there: not what was planned, but what is left when the
// cutter has been everywhere on its path. Between the two lie what the path leaves to its cusps and tolerances, some
// hundredths of a millimetre all over the wall. It matters to whoever looks for the cavity in an image: in a slender
// taper a wall 0.02 mm nearer is the same as a cavity 0.7 mm higher. Empty when the path takes nothing away there.
TriangleMesh milledShape(const ToolPath& path, double top_mm, double spacing_mm = 0.4);

}  // namespace fluorocut
