#include "core/procedure/setup.h"

#include <fmt/format.h>

#include "core/base/option_checks.h"

namespace fluorocut {

Result<void> ProcedureSetup::validate() const {
    if (const Result<void> ok = plan.cavity.validate(); !ok) return ok;
    if (const Result<void> ok = plan.path.validate(); !ok) return ok;
    if (const Result<void> ok = patient.beads.validate(); !ok) return ok;
    if (const Result<void> ok = calibration.corkscrew.validate(); !ok) return ok;
    if (views.empty()) return invalidOption("views", "none", "at least one");
    for (const ProcedureView& view : views) {
        if (const Result<void> ok = view.carm.validate(); !ok) return ok;
        if (const Result<void> ok = view.position.validate(); !ok) return ok;
    }
    return requireRanges({{"plan.stages", static_cast<double>(plan.stages), 1, 10, ""},
                          {"patient.mu_water_per_mm", patient.mu_water_per_mm, 1e-4, 1, "/mm"},
                          {"calibration.focal_length_sigma_mm", calibration.focal_length_sigma_mm, 0, 50, "mm"},
                          {"calibration.local_distortion_mm", calibration.local_distortion_mm, 0, 5, "mm"}});
}

}  // namespace fluorocut
