// The grooved plate for a workshop: top view and side view in true size, a groove enlarged, dimensions and tolerances.
//
// Tolerances follow what the plate is for: its groove spacing is the millimetre of every dewarped image, so the place
// of every groove counts from one datum edge (0.02 mm, not cumulative); width and depth only make contrast.
#pragma once

#include "core/base/result.h"
#include "core/distortion/grooved_plate.h"
#include "core/fabrication/drawing.h"

namespace fluorocut {

// invalidOption: a plate that does not validate. Inches stand in brackets where all of the plate is a whole number of
// 64ths.
Result<Drawing> drawPlate(const GroovedPlate& plate);

}  // namespace fluorocut
