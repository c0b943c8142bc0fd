// What a cavity takes out of a CT, as something to project: attenuation, and the way through it. Frame `femur`.
#pragma once

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
    RemovedBone(std::shared_ptr<const Volume> ct, const TriangleMesh& mesh, const AttenuationOptions& attenuation)
        : ct_(std::move(ct)), mesh_(mesh), attenuation_(attenuation) {}

    Result<Removed> at(const Rigid3& femur_from_cavity) const;

  private:
    std::shared_ptr<const Volume> ct_;
    const TriangleMesh& mesh_;
    AttenuationOptions attenuation_;
};

}  // namespace fluorocut::cavity
