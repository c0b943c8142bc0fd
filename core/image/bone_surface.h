// The outer surface of the bones in a CT, to be looked at: closed, of few triangles, without the canal inside.
//
// Voxels are averaged until they are about as large as asked for. In every axial section, what the sections' border
// cannot reach without crossing bone is filled: marrow belongs to the bone whatever its density, so that the surface is
// the outer one alone. Smoothed over neighbours, its isosurface at `level_hu` follows; parts much smaller than the
// largest (specks, calcified vessels) are left out. Frame and units of the grid (a CT: femur, mm).
//
// Not for measuring: averaged voxels move thin edges by up to about one of them (0.3 mm rms at 1.6 mm on a sphere's
// shell). Walls to plan with are core/planning/bone_walls.h's.
#pragma once

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/geometry/triangle_mesh.h"
#include "core/image/volume.h"

namespace fluorocut {

struct BoneSurfaceOptions {
    double level_hu = 250;
    double voxel_mm = 2;          // averaged up to about this
    double least_share = 0.02;    // of the largest part's triangles
    int most_voxels = 6'000'000;  // after averaging; more are averaged further

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

// Empty when there is no bone. invalidOption; cancelled.
Result<TriangleMesh> boneSurface(const Volume& ct, const BoneSurfaceOptions& options = {},
                                 Progress& progress = Progress::none());

}  // namespace fluorocut
