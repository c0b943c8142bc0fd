// The surface on which a volume has a level, as a closed triangle mesh turned toward larger values (for a distance
// field: outward). In the frame of the volume's grid.
//
// Every cell of eight voxel centres is split into six tetrahedra round its main diagonal (Kuhn), the same way in every
// cell, so neighbouring cells agree: the surface is closed and manifold, without the ambiguous cases of marching cubes.
// Vertices lie on the edges, where the linear interpolant has the level, but never nearer than 1/1000 of the edge to
// its ends: so no triangle is without area, whatever the values (an error of 0.0005 mm at 0.5 mm).
//
// Error against the surface of a distance field: h^2 / (8 r) for a curvature radius r, up to 3 h^2 / (8 r) along the
// diagonals; edges are cut off by up to 0.35 h.
#pragma once

#include "core/geometry/triangle_mesh.h"
#include "core/image/volume.h"

namespace fluorocut {

enum class GridBorder {
    closed,  // a surface that leaves the grid is closed by flat faces through the outermost voxel centres
    open     // it ends there
};

// Where the values are below the level is inside (NaN is not). Empty when no voxel is.
TriangleMesh isosurface(const Volume& volume, double level, GridBorder border = GridBorder::closed);

}  // namespace fluorocut
