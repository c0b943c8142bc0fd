// Apparent contours: the lines on a closed mesh where its surface turns away from the X-ray source, and where a C-arm
// shows them. A facet faces the source when the source lies above its plane,
//
//     n . (s - a) > 0        n outward normal, a a corner, s the source, all in the mesh's frame
//
// and a contour runs along every edge between a facet that faces the source and one that does not. The contours of a
// closed manifold are closed loops: they bound the set of the facing facets, and the half-edges at a vertex say which
// of its contour edges belong together. A facet whose plane holds the source (angle below 1e-9 rad) faces away, as all
// of its coplanar neighbours do; whatever is decided for one facet, the loops stay closed.
//
// Loops are directed: the facing facets lie on the left, as the source sees it (with rows running down: on the side of
// (dv, -du) of a step (du, dv)). Hence the number of times a ray enters the solid is the winding number of all loops
// about its pixel (in ideal pixels), and from this two properties of a place on a contour follow exactly:
//
//     outline   nothing of the solid lies on the outer side: the border of the shadow (of its holes, too)
//     hidden    another part of the solid lies between it and the source
//
// Both change only where contours cross in the image; when one of them is asked for, loops get a point at every
// crossing. Frames: `imager_from_mesh`; pixels are those of the image, distorted; mm.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/half_edge_mesh.h"
#include "core/imaging/carm.h"

namespace fluorocut {

struct SilhouetteOptions {
    bool find_outline = false;
    bool find_hidden = false;  // finds the outline too
    // What lies in front by no more than this (along z) hides nothing: on a curved surface the facets along a contour
    // fold over each other. 0: the polyhedron as it is.
    double fold_mm = 0.5;

    Result<void> validate() const;
};

struct ContourPoint {
    Vector2 pixel;  // NaN where the distortion is unknown
    Vector3 point;  // on the mesh, in its frame
    // Of the step from here to the next point.
    bool outline = false;
    bool hidden = false;
};

// The last point joins the first.
using ContourLoop = std::vector<ContourPoint>;

// The parts of a loop with a property: polylines; one that comes back to its start repeats it at its end.
//     contourParts(loop, [](const ContourPoint& p) { return p.outline; })
template <class Has>
std::vector<std::vector<ContourPoint>> contourParts(const ContourLoop& loop, Has&& has) {
    std::vector<std::vector<ContourPoint>> parts;
    std::size_t start = 0;  // a place where a part begins, if there is one
    while (start < loop.size() && !(has(loop[start]) && !has(loop[(start + loop.size() - 1) % loop.size()])))
        ++start;
    bool open = false;
    for (std::size_t n = 0; n < loop.size(); ++n) {
        const std::size_t i = (start + n) % loop.size();
        if (has(loop[i])) {
            if (!open) parts.emplace_back(1, loop[i]);
            parts.back().push_back(loop[(i + 1) % loop.size()]);
        }
        open = has(loop[i]);
    }
    return parts;
}

class Silhouette {
  public:
    // Refuses what is not a closed manifold turned outward; `where` is the subject of that sentence.
    static Result<Silhouette> prepare(TriangleMesh mesh, const std::string& where = "mesh");

    // Refuses options outside their limits and a mesh that is not wholly in front of the source. Throws
    // std::logic_error for a C-arm that does not validate.
    Result<std::vector<ContourLoop>> project(const CArm& carm, const Rigid3& imager_from_mesh,
                                             const SilhouetteOptions& options = {}) const;

    const TriangleMesh& mesh() const;

  private:
    struct Prepared;
    explicit Silhouette(std::shared_ptr<const Prepared> prepared) : prepared_(std::move(prepared)) {}
    std::shared_ptr<const Prepared> prepared_;
};

}  // namespace fluorocut
