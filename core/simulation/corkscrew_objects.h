// A corkscrew for the virtual operating room: its parts with their materials, what they displace, and who holds it.
#pragma once

#include <string>
#include <vector>

#include "core/fiducial/corkscrew_solid.h"
#include "core/simulation/virtual_operating_room.h"

namespace fluorocut {

// "<name> rod", "<name> shaft", "<name> shaft outside", "<name> wire", "<name> beads": those that the layout has. The
// rod and the shaft's ends displace air; the rest displaces the rod's material. All share one pose: whoever moves the
// corkscrew moves each of them. invalidOption: a layout or a fineness that does not validate.
Result<std::vector<HeldObject>> heldCorkscrew(const std::string& name, const CorkscrewLayout& layout, HeldBy holder,
                                              const Rigid3& holder_from_corkscrew,
                                              const CorkscrewFineness& fineness = {});

}  // namespace fluorocut
