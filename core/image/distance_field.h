// Solids as signed distances on a grid (mm, negative inside), trilinear between voxels: what cavities are planned with,
// since offset, union and sweep of a solid are one line each there. The surface of a curvature radius r lies within
// spacing^2 / (8 r) of where it should be (0.5 mm, 5 mm: 0.006 mm).
//
//   offset by d             field - d            (exact while the field is a distance)
//   union, intersection     min, max             (exact outside a union, inside an intersection; a bound elsewhere)
//   swept along an axis     running minimum
//
// After min, max and sweeps the zero level is right and the values are bounds: `redistanced` makes them distances
// again.
#pragma once

#include <functional>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/geometry/triangle_mesh.h"
#include "core/image/volume.h"

namespace fluorocut {

// A grid along the frame's axes that holds the box with `margin_mm` around it. invalidOption when it would have more
// than 2^27 voxels.
Result<VolumeGrid> gridAround(const Vector3& low, const Vector3& high, double spacing_mm, double margin_mm);

// Exact distances at every voxel within `band_mm` of the surface; beyond it the values keep their sign and are at least
// band_mm in size (an upwind march). The mesh must be a solid (requireSolid); mesh and grid in one frame.
Result<Volume> distanceField(const TriangleMesh& mesh, const VolumeGrid& grid, double band_mm,
                             Progress& progress = Progress::none());

// The zero level's own distances, through its isosurface.
Result<Volume> redistanced(const Volume& field, double band_mm, Progress& progress = Progress::none());

// field'(i, j, k) = min over k' <= k of field(i, j, k'): what a solid covers that is pulled out toward rising k.
void sweepUp(Volume& field);

// Trilinear, in the grid's frame; `outside` beyond the outermost voxel centres.
double sampleField(const Volume& field, const Vector3& point, double outside);
Vector3 fieldGradient(const Volume& field, const Vector3& point);  // of the trilinear interpolant; zero outside

}  // namespace fluorocut
