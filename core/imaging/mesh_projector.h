// Path lengths through a solid: what an implant, a tool or a fiducial adds to a fluoroscopic image.
//
//     image(pixel) = length in mm of the ray from the source to the pixel's place on the detector that lies inside the
//     mesh
//
// as a float32 image in the pixels of the C-arm, distorted ones included: the ray is the one through the distorted
// pixel. The length is exact for the mesh: a sum over the faces that the ray crosses, + distance where it leaves and -
// distance where it enters, in double precision (distances near 700 mm, lengths down to microns: 1e-9 mm). Overlapping
// parts add; a part turned inward is a void. The source may lie inside the mesh, the mesh may reach behind the source
// or through the detector: only what lies between source and detector counts.
//
// No ray slips through an edge or hits two faces there. A ray crosses a face when it passes its three edges on one
// side, the sign of direction . (a x b) (homogeneous rasterisation: Olano and Greer 1997, no clipping needed). Signs
// are exact (core/geometry/exact_sign.h) and a ray that meets an edge exactly is moved by an infinitesimal (e, e^2)
// pixels (simulation of simplicity: Edelsbrunner and Muecke 1990), for which no ray meets an edge.
#pragma once

#include <string>

#include "core/base/result.h"
#include "core/geometry/mesh_properties.h"
#include "core/geometry/triangle_mesh.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"

namespace fluorocut {

struct MeshProjectionOptions {
    // Rays per pixel along each axis, 1 to 16: their mean stands for the detector's average over the pixel. 1 samples
    // the centre, under which a wire thinner than a pixel aliases.
    int samples_per_axis = 1;

    Result<void> validate() const;
};

class MeshProjector {
  public:
    // Checks the mesh once: refuses what is not a closed surface turned outward. `where` is the subject of that
    // sentence.
    static Result<MeshProjector> prepare(TriangleMesh mesh, const std::string& where = "mesh");

    // Throws std::logic_error for a C-arm or options that do not validate. A pixel whose place the distortion cannot
    // tell (NaN) is NaN. The result does not depend on the number of threads.
    Image project(const CArm& carm, const Rigid3& imager_from_mesh, const MeshProjectionOptions& options = {}) const;

    const TriangleMesh& mesh() const { return mesh_; }
    const MeshProperties& properties() const { return properties_; }

  private:
    MeshProjector(TriangleMesh mesh, const MeshProperties& properties);

    TriangleMesh mesh_;
    MeshProperties properties_;
};

}  // namespace fluorocut
