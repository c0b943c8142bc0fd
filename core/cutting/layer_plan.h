// The layers of a tool path: at which heights, with which spindle directions, over which regions (tool_path.h says by
// which rules). Frame `cavity`, mm.
#pragma once

#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/cutting/ball_region.h"
#include "core/cutting/tool_path.h"

namespace fluorocut {

struct LayerPass {
    Vector3 spindle = Vector3::UnitZ();
    PlaneRegion region;  // for the ball's centre
};

struct Layer {
    double z_mm = 0;       // of the ball's centre
    double height_mm = 0;  // below the layer before, or below the top
    bool floor = false;    // some of it stays as the cavity's floor: cut with the finer step-over
    std::vector<LayerPass> passes;
};

struct LayerPlan {
    std::vector<Layer> layers;  // from the top down; those out of reach are left out
    double finish_step_mm = 0;  // between passes that leave the most cusp allowed
    double unreached = 0;       // share of the ball's places
};

Result<LayerPlan> planLayers(const BallReach& reach, double top_mm, const ToolPathOptions& options,
                             Progress& progress = Progress::none());

}  // namespace fluorocut
