// How much of each voxel a solid fills: exact partial volumes of a closed mesh on a volume's grid.
//
//     fraction(i, j, k) = volume of (voxel box intersected with the solid) / volume of the voxel,     in [0, 1]
//
// A voxel is the box of one spacing around its centre. The divergence theorem along the rows turns the volume into a
// sum over the surface: every triangle is cut at the voxel borders, and a piece with the projected area a (along i,
// signed) at the mean depth x inside its voxel takes a (1 - x) from that voxel and a from all that follow it in the
// row. This is the exact-coverage rasteriser of outline fonts (Levien, font-rs, 2016) with one more dimension. There is
// no sampling, hence no leak, no parity and no aliasing: the error is rounding (1e-9 of a voxel), whatever the pose,
// spacing or handedness.
//
// Parts of a mesh that overlap count once where the voxel is wholly inside them; on their surfaces inside one another
// the sum of their fractions is cut at 1. A part turned inward inside another is a void.
#pragma once

#include <array>
#include <string>

#include "core/base/result.h"
#include "core/geometry/triangle_mesh.h"
#include "core/image/volume.h"

namespace fluorocut {

struct VoxelCoverage {
    std::array<int, 3> offset{0, 0, 0};  // voxel (0, 0, 0) of the block is this voxel of the whole grid
    Volume fraction;                     // the block of the grid that the mesh can touch, placed in the same frame;
                                         // empty when the mesh lies outside the grid
    double volume_mm3 = 0;               // of the solid inside the grid
};

// `volume_from_mesh` takes the mesh to the grid's frame (for a CT: femur_from_cavity). Refuses a mesh that is not a
// closed surface turned outward (requireSolid); `where` is the subject of that sentence.
Result<VoxelCoverage> voxelize(const TriangleMesh& mesh, const Rigid3& volume_from_mesh, const VolumeGrid& grid,
                               const std::string& where = "mesh");

}  // namespace fluorocut
