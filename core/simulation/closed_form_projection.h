// Path lengths (mm) in closed form: of spheres and of the grooved plate. As MeshProjector has them (same pixels, same
// rays, distorted ones included, float32), but without facets and without a mesh in memory; the two check each other.
//
//     sphere   chord of the ray, 2 sqrt(r^2 - d^2), between source and detector
//     plate    ray in the slab between smooth side and groove floors, plus, in the layer of the grooves, the parts of
//              it that lie on a land in x and in y: the ray's crossings with groove walls sorted along it
//
// More than one sample per axis asks for the mean over the pixel. Of the plate that is not sampled: grooves that run
// along the pixels' rows would be seen displaced, all along, by up to half of the samples' distance (0.12 px of 4 x 4).
// The pixel's four corner rays cut a quadrangle out of every plane across the grooves' layer; the part of its area that
// lies on lands is exact, and planes are taken so closely that a wall moves by less than a quarter of a pixel between
// them (middle-point rule, symmetric about z = 0: a groove's middle stays where it is). Rays that cross more than half
// a pitch within the grooves, as of a plate seen on edge, are sampled one by one after all.
//
// The plate's whole thickness counts, also what lies beyond the plane z = f: with the plate on the detector, half the
// depth of its grooves lies behind the plane that FluoroCut calls the detector (core/distortion/grooved_plate.h).
//
// Both throw std::logic_error for a C-arm or options that do not validate. A pixel whose place the distortion cannot
// tell (NaN) is NaN. The result does not depend on the number of threads.
#pragma once

#include "core/distortion/plate_solid.h"
#include "core/fiducial/bead_layout.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"
#include "core/imaging/mesh_projector.h"

namespace fluorocut {

// Beads that overlap add. Of the pixels that a bead's outline crosses at least kRimSamples rays per axis are taken:
// under fewer the outline aliases, which moves its centroid.
inline constexpr int kRimSamples = 8;
Image spherePathLengths(const BeadLayout& layout, const CArm& carm, const Rigid3& imager_from_layout,
                        const MeshProjectionOptions& options = {});

// The plate as plateExtent has it. It must validate; grooves may be as deep as it is thick.
Image platePathLengths(const GroovedPlate& plate, PlateFacing facing, const CArm& carm, const Rigid3& imager_from_plate,
                       const MeshProjectionOptions& options = {});

}  // namespace fluorocut
