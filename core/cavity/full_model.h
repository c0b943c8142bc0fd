// The images of a cut femur as a function of where the cavity lies, and their fit: the method `full` of
// cavity_location.h. One View per after-image.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/cavity/cavity_location.h"

namespace fluorocut::cavity {

Result<CavityLocation> locateByFullModel(const std::vector<CavityView>& views, const TriangleMesh& mesh,
                                         const Rigid3& planned_femur_from_cavity, std::shared_ptr<const Volume> ct,
                                         const CavityLocationOptions& options, Progress& progress);

}  // namespace fluorocut::cavity
