// What a technician does before an operation, with the real estimators on simulated pictures: for every view the
// grooved plate, then a phantom of beads tilted three ways; in the first view the corkscrew on the robot in a dozen
// poses. The patient is not there yet. What comes out holds nothing of the truth.
//
// Where the scenario asks for no pictures, imager and hand-eye pose are the true ones with errors drawn from the stated
// standard deviations; a bent C-arm's map still comes of its plate.
#pragma once

#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/experiments/operation_theatre.h"
#include "core/procedure/setup.h"

namespace fluorocut {

struct OperationCalibration {
    std::vector<ProcedureView> views;
    Pose flange_from_corkscrew;  // as calibrated, with what a knock since may have done in its covariance
    double focal_length_sigma_mm = 0;
    double image_centre_sigma_px = 0;
};

Result<OperationCalibration> calibrateOperation(const Scenario& scenario, const OperationTheatre& theatre,
                                                Progress& progress = Progress::none());

}  // namespace fluorocut
