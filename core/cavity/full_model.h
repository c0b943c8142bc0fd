// The fit of all after-images at once (core/cavity/view_model.h) to where the cavity lies: the method `full` of
// cavity_location.h. Gauss-Newton over the cavity's pose and every view's own unknowns, from coarse to fine.
#pragma once

#include <memory>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/cavity/cavity_location.h"

namespace fluorocut::cavity {

// What is in the place of the bone: attenuation (1/mm) and how well it is known. Air to fluid: a cavity.
struct Content {
    double mu_per_mm = 0;
    double sigma_per_mm = 0.02;
};

Result<CavityLocation> locateByFullModel(const std::vector<CavityView>& views, const TriangleMesh& mesh,
                                         const Rigid3& planned_femur_from_cavity, std::shared_ptr<const Volume> ct,
                                         const CavityLocationOptions& options, Progress& progress,
                                         const Content& content = {});

}  // namespace fluorocut::cavity
