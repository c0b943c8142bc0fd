// A stage of a cavity, ready to be cut: its shape, and a path that both checks let pass through it. Frame `cavity`, mm.
#pragma once

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/cutting/envelope_check.h"
#include "core/planning/cavity.h"

namespace fluorocut {

struct PlannedCut {
    Cavity cavity;
    double inset_mm = 0;
    CheckedToolPath path;
};

// The cavity `inset_mm` inside the final one; its own mesh, opened upward, is the envelope of its path.
Result<PlannedCut> planCut(const Cavity& final, double inset_mm, const ToolPathOptions& options,
                           Progress& progress = Progress::none());

}  // namespace fluorocut
