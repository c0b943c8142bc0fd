#include "core/procedure/stage_plan.h"

#include <utility>

namespace fluorocut {

Result<PlannedCut> planCut(const Cavity& final, double inset_mm, const ToolPathOptions& options, Progress& progress) {
    SubProgress shaping(progress, 0, 0.2), routing(progress, 0.2, 0.6), checking(progress, 0.6, 1);
    Result<Cavity> cavity = insetCavity(final, inset_mm, shaping);
    if (!cavity) return cavity.error();
    Result<ToolPath> path = planToolPath(cavity->field, cavity->mesh, cavity->top_mm, options, routing);
    if (!path) return path.error();
    const Result<TriangleMesh> envelope = openedUpward(cavity->mesh, options.openPlane(cavity->top_mm));
    if (!envelope) return envelope.error();
    Result<CheckedToolPath> checked = checkToolPath(std::move(*path), options.cutter, *envelope, {}, checking);
    if (!checked) return checked.error();
    return PlannedCut{std::move(*cavity), inset_mm, std::move(*checked)};
}

}  // namespace fluorocut
