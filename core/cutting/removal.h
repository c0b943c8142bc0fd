// What a path leaves: the cut is carried out on paper and held against the plan. Frame `cavity`, mm.
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
    std::vector<double> left_mm;  // at points spread evenly over the planned surface below the top: thickness of what
                                  // stays in front of it (positive), depth of what is taken behind it (negative)
    double left_95_mm = std::numeric_limits<double>::quiet_NaN();  // 95 % quantile of |left|
    double most_left_mm = std::numeric_limits<double>::quiet_NaN();
    double most_beyond_mm = std::numeric_limits<double>::quiet_NaN();  // farthest cut behind the plan
    double cusp_mm = std::numeric_limits<double>::quiet_NaN();         // what layers and step-over leave by themselves
};

// `planned`: the cavity's closed mesh; the plane at `top_mm` is open.
Result<RemovalReport> simulateRemoval(const ToolPath& path, const TriangleMesh& planned, double top_mm,
                                      Progress& progress = Progress::none());

// The part of every voxel that the path takes away, 0 to 1, in another frame's grid (a CT's): for simulated cuts.
Volume removedFraction(const ToolPath& path, const Rigid3& volume_from_cavity, const VolumeGrid& grid);

}  // namespace fluorocut
