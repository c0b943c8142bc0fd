// Solids as signed distances on a grid (mm, negative inside), trilinear between voxels: what cavities are planned with,
// since offset, union and sweep of a solid are one line each there.
//
//   offset by d             field - d            (exact while the field is a distance)
//   union, intersection     min, max             (exact outside a union, inside an intersection; a bound elsewhere)
//   swept along an axis     running minimum      (exact outside)
//
// After min, max and sweeps the zero level is right and the values are bounds: `redistanced` makes them distances
// again.
//
// The interpolated surface of a curvature radius r lies within 3 h^2 / (8 r) of where it should be (h: spacing; 0.5 mm
// and 5 mm: 0.02 mm along a cell's diagonal, a third of that along its edges) on the side of its centre of curvature;
// sharp edges are cut off by up to 0.35 h.
#pragma once

#include <string>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/geometry/mesh_distance.h"
#include "core/geometry/triangle_mesh.h"
#include "core/image/volume.h"

namespace fluorocut {

// How far from the surface distances are wanted; beyond, the field is this limit with its sign.
struct FieldBand {
    double inside_mm, outside_mm;

    FieldBand(double both_mm) : inside_mm(both_mm), outside_mm(both_mm) {}
    FieldBand(double inside, double outside) : inside_mm(inside), outside_mm(outside) {}
};

// A grid along the frame's axes that holds the box with `margin_mm` around it; its first voxel centre is the lower
// corner. invalidOption when it would have more than 2^27 voxels.
Result<VolumeGrid> gridAround(const Vector3& low, const Vector3& high, double spacing_mm, double margin_mm);

// Exact distances at every voxel within the band. The mesh must be a solid (requireSolid; `where` is the subject of
// that sentence); mesh and grid in one frame. Parts that overlap count as their union: signs are right and so are
// distances outside; inside, faces that lie within another part are taken for the surface (`redistanced` forgets them).
Result<Volume> distanceField(const TriangleMesh& mesh, const VolumeGrid& grid, const FieldBand& band,
                             Progress& progress = Progress::none(), const std::string& where = "mesh");

// On which side of the solid's surface the voxel centres lie: -1 inside (where the surface turns round them), 1
// outside.
Result<Volume> sidesOf(const TriangleMesh& mesh, const VolumeGrid& grid, const std::string& where = "mesh");

// Distances to where `field` has the level, through its isosurface; the surface may leave the grid.
Result<Volume> redistanced(const Volume& field, const FieldBand& band, double level = 0,
                           Progress& progress = Progress::none());

// Distances to a surface, negative where `field` is below the level (both in the frame of the field's grid).
Result<Volume> distancesTo(const MeshDistance& surface, Volume field, double level, const FieldBand& band,
                           Progress& progress = Progress::none());

// field'(i, j, k) = min over k' <= k of field(i, j, k'): what a solid covers that is pulled out toward rising k.
void sweepUp(Volume& field);

// Trilinear, in the grid's frame; `outside` beyond the outermost voxel centres.
double sampleField(const Volume& field, const Vector3& point, double outside);
Vector3 fieldGradient(const Volume& field, const Vector3& point);  // of the trilinear interpolant; zero outside

}  // namespace fluorocut
