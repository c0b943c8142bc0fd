// Where a ball's centre may be whose radius is `depth_mm`, as a surface with its edges and corners: the points of a
// solid at that distance from its wall. An isosurface of the sampled distance would cut off the edges by most of a
// voxel, and a cavity whose corners are rounded round them would be too small by as much.
//
// Dual contouring (Ju, Losasso, Schaefer, Warren 2002): where a grid edge passes through the surface, the exact nearest
// point of the wall gives a tangent plane; every cell gets the vertex that fits its planes best. The surface is for
// measuring distances to (core/geometry/mesh_distance.h): it has no holes but where it leaves the grid, yet is neither
// turned nor always manifold.
#pragma once

#include "core/geometry/mesh_distance.h"
#include "core/image/volume.h"

namespace fluorocut {

// `field` < `level` on the solid's side; there the distance to `wall` is about `depth_mm`. The grid lies along the
// frame's axes.
TriangleMesh offsetSurface(const MeshDistance& wall, double depth_mm, const Volume& field, double level);

}  // namespace fluorocut
