// The surface on which a volume has a level, as a closed triangle mesh turned toward larger values (for a distance
// field: outward). In the frame of the volume's grid.
//
// Every cell of eight voxel centres is split into six tetrahedra round its main diagonal (Kuhn), the same way in every
// cell, so neighbouring cells agree: the surface is closed and manifold wherever it does not leave the grid, without
// the ambiguous cases of marching cubes. Vertices lie on the edges, where the linear interpolant has the level.
#pragma once

#include "core/base/result.h"
#include "core/geometry/triangle_mesh.h"
#include "core/image/volume.h"

namespace fluorocut {

// A surface that would leave the grid is closed at the grid's border (the level is taken to lie above there). Empty
// when no voxel is below the level.
TriangleMesh isosurface(const Volume& volume, double level);

}  // namespace fluorocut
