// Cutting: what a milled cavity leaves of a CT. The mesh of the cavity is taken out of the volume; voxels that it fills
// in part keep their other part:
//
//     HU_new = (1 - c) HU + c fill        c = fraction of the voxel inside the mesh (core/image/voxelize.h, exact)
//
// Cavities are cut one after the other, each larger. `removed_fraction` remembers what is gone: handed to the next cut
// as `already_removed`, a place that was cut before is not cut again (the union of two cuts has the greater of their
// fractions; exact where one cavity contains the other, and the same `fill_hu` is expected throughout).
//
// With `sweep_mm` the tool enters along an axis and everything on its way goes too: the union of the mesh over the
// path, in steps of half a voxel. Frames: mesh in `cavity`, CT in `femur`. HU, mm.
#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/geometry/triangle_mesh.h"
#include "core/image/volume.h"

namespace fluorocut {

struct CutOptions {
    double fill_hu = -1000;  // what the cavity is full of: air; 0 to 50 for irrigation fluid and blood
    double sweep_mm = 0;     // the path on which the mesh comes to its place
    Vector3 sweep_direction_in_cavity{0, 0, 1};  // where it comes from: proximal, out of the bone

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

struct CutResult {
    Volume volume;                                                  // the CT after the cut
    Volume removed_fraction;                                        // of every voxel, by this cut and those before it
    double removed_mm3 = std::numeric_limits<double>::quiet_NaN();  // of the (swept) mesh inside the CT
    double newly_removed_mm3 = std::numeric_limits<double>::quiet_NaN();  // the part of it that was not gone before
    double mesh_mm3 = std::numeric_limits<double>::quiet_NaN();           // of the mesh itself, wherever it lies
    std::size_t voxels_touched = 0;
    std::vector<std::string> warnings;
};

// `already_removed`: the `removed_fraction` of the cut before, on the same grid (another grid throws std::logic_error);
// null: the CT is whole. Fails with invalidOption; invalidInput when the mesh is not a closed surface turned outward or
// lies outside the CT; cancelled.
Result<CutResult> cutMesh(const Volume& hounsfield, const TriangleMesh& mesh, const Rigid3& femur_from_cavity,
                          const CutOptions& options = {}, const Volume* already_removed = nullptr,
                          Progress& progress = Progress::none());

}  // namespace fluorocut
