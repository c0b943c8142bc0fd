// A proposed stem in the CT: for eyes that check a proposal.
#pragma once

#include "core/image/image.h"
#include "core/image/volume.h"
#include "core/planning/bone_walls.h"
#include "core/planning/implant.h"

namespace fluorocut::cli {

// Slices of the CT along the stem's axis, medio-lateral and antero-posterior, and three across it, each with the walls
// found (canal sky blue, outer green) and the stem's section (vermilion).
Result<ColorImage> templateFigure(const Volume& ct, const BoneWalls& walls, const Implant& implant,
                                  const Rigid3& femur_from_cavity);

}  // namespace fluorocut::cli
