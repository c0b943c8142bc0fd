// What a plan will look like on X-rays: each view as it is, and beside it as it is predicted, with the outlines of what
// is planned in colours.
#pragma once

#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/triangle_mesh.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"

namespace fluorocut::cli {

struct PlanFigureView {
    std::string name;
    Image before, predicted;  // levels
    CArm carm;
    Rigid3 imager_from_cavity;
};

struct PlanFigureSolid {
    std::string name;
    TriangleMesh mesh;  // in the frame `cavity`
};

// One row for each view. Refuses solids that are no closed manifold or lie beside the source.
Result<ColorImage> planFigure(const std::vector<PlanFigureView>& views, const std::vector<PlanFigureSolid>& solids);

}  // namespace fluorocut::cli
