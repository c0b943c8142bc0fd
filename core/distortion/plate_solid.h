// The grooved plate as a solid: what a workshop makes and what the simulator puts into the beam.
//
// Frame `plate` (core/distortion/grooved_plate.h), mm: z = 0 at half the depth of the grooves. Grooves run out through
// the rim, which is half a pitch beyond the middle lines of the outermost ones. Of an even number of grooves the
// crossing nearest to the middle with the lower index is the origin.
//
//     volume = W H t - d (a w H + b w W - a b w^2)      a grooves of width w and depth d along y, b along x
#pragma once

#include <array>

#include "core/base/result.h"
#include "core/distortion/grooved_plate.h"
#include "core/geometry/triangle_mesh.h"

namespace fluorocut {

// Which way the grooves open. Toward the source, the smooth side lies on the detector and nothing can fall in unseen.
enum class PlateFacing { source, detector };

// Where the plate's material is: everything that its solid, its picture and its drawing need.
struct PlateExtent {
    std::array<int, 2> grooves{};       // along y (columns), along x (rows)
    std::array<int, 2> first_groove{};  // index of the first: its middle line lies at first_groove * pitch
    Vector2 low = Vector2::Zero();      // of the rim, mm
    Vector2 high = Vector2::Zero();
    double z_land = 0;   // the grooved side between the grooves
    double z_floor = 0;  // of the grooves: -z_land
    double z_back = 0;   // the smooth side
};

// A plate that leaves the number of grooves open is given as many as cover a field of 12 inches (304.8 mm) square: the
// largest image intensifier of a mobile C-arm.
PlateExtent plateExtent(const GroovedPlate& plate, PlateFacing facing = PlateFacing::source);

// Closed, turned outward, vertices shared, without T-junctions; 16 triangles for each crossing. invalidOption: a plate
// that does not validate, or one whose grooves are as deep as it is thick: it would fall to pieces.
Result<TriangleMesh> plateSolid(const GroovedPlate& plate, PlateFacing facing = PlateFacing::source);

}  // namespace fluorocut
