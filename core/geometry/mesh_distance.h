// Distances to a triangle mesh, exact, through a tree of bounding boxes built once (mm, the mesh's frame).
//
// The sign is that of the closed surface: negative inside, told at the nearest point q by the angle-weighted sum of the
// normals of all triangles that touch q (Baerentzen and Aanaes 2005). The triangles are found at q itself (within 1e-9
// of the mesh's extent), not through a table of neighbours, so vertices need not be welded and slivers do no harm.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <string>

#include "core/base/result.h"
#include "core/geometry/triangle_mesh.h"

namespace fluorocut {

struct NearestPoint {
    double distance_mm = std::numeric_limits<double>::infinity();
    Vector3 point = Vector3::Zero();  // on the surface
    std::int32_t triangle = -1;       // -1: nothing nearer than the limit
};

class MeshDistance {
  public:
    // Refuses a mesh without triangles, with corners that are no vertex or with vertices that are not finite; `where`
    // is the subject of that sentence. The sign means something only for a closed surface turned outward
    // (requireSolid).
    static Result<MeshDistance> build(TriangleMesh mesh, const std::string& where = "mesh");

    // `guess`: a triangle that may be near (the answer for a neighbouring point): finds the same distance sooner.
    NearestPoint nearest(const Vector3& point, double most_mm = std::numeric_limits<double>::infinity(),
                         std::int32_t guess = -1) const;
    double signedDistance(const Vector3& point) const;

    const TriangleMesh& mesh() const;

  private:
    struct Tree;
    explicit MeshDistance(std::shared_ptr<const Tree> tree) : tree_(std::move(tree)) {}
    std::shared_ptr<const Tree> tree_;
};

}  // namespace fluorocut
