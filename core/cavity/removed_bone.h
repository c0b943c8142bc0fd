// What a cavity takes out of a CT, as something to project: attenuation, and the way through it. Frame `femur`.
//
// The mesh is voxelised once, in its own frame and exactly (core/image/voxelize.h); elsewhere it is that grid's
// trilinear interpolant, taken at the voxels of the part of the CT in which the cavity lies, or at parts of them
// (`finer`): what a mill cuts is sharper than a CT's voxels. The CT is interpolated there.
#pragma once

#include <array>
#include <memory>

#include "core/base/result.h"
#include "core/geometry/triangle_mesh.h"
#include "core/image/volume.h"
#include "core/imaging/volume_projector.h"

namespace fluorocut::cavity {

// What was removed: the CT's own attenuation inside the cavity, and the way through it (mm).
struct Removed {
    VolumeProjector bone;
    VolumeProjector length;
};

class RemovedBone {
  public:
    // `finer`: parts of a voxel that at() can take, along its shortest edge. Refuses a mesh that is not a closed
    // surface turned outward.
    static Result<RemovedBone> prepare(std::shared_ptr<const Volume> ct, const TriangleMesh& mesh,
                                       const AttenuationOptions& attenuation, int finer);

    // Chooses the part of the CT that at() works in: around the cavity there, with voxels `finer` times as fine. Images
    // taken within the same part differ by the cavity's place alone, not by the projector's grid, so that their
    // differences are derivatives.
    Result<void> settle(const Rigid3& femur_from_cavity, int finer);
    // Whether the cavity lies in that part, there and `reach_mm` around.
    bool settledFor(const Rigid3& femur_from_cavity, double reach_mm) const;

    // What of the cavity lies in the part chosen.
    Result<Removed> at(const Rigid3& femur_from_cavity) const;

  private:
    // Voxels of the CT: first and one beyond the last.
    struct Block {
        std::array<int, 3> first{}, last{};
    };
    RemovedBone(std::shared_ptr<const Volume> ct, Volume fraction, const AttenuationOptions& attenuation)
        : ct_(std::move(ct)), fraction_(std::move(fraction)), attenuation_(attenuation) {}
    Block blockAround(const Rigid3& femur_from_cavity, double reach_mm) const;

    std::shared_ptr<const Volume> ct_;
    Volume fraction_;  // in `cavity`
    AttenuationOptions attenuation_;
    Block block_;
    int finer_ = 1;
};

}  // namespace fluorocut::cavity
