// Slices of a volume along any plane, and what a solid's surface leaves in them: planning on a CT along the stem's
// axes.
//
// A slice is an image whose pixel (x, y) shows the place origin + x spacing_x right + y spacing_y down (pixel centres
// at integers), in the volume's frame, mm. Values by trilinear interpolation: exact for what is linear in space.
#pragma once

#include <vector>

#include "core/geometry/half_edge_mesh.h"
#include "core/geometry/rigid3.h"
#include "core/image/image.h"
#include "core/image/volume.h"

namespace fluorocut {

struct SlicePlane {
    Vector3 origin = Vector3::Zero();  // the centre of pixel (0, 0)
    Vector3 right = Vector3::UnitX();  // unit, along rows
    Vector3 down = Vector3::UnitY();   // unit, across `right`
    Vector2 spacing_mm{0.5, 0.5};
    int width = 256, height = 256;

    Vector3 pointAt(const Vector2& pixel) const {
        return origin + pixel.x() * spacing_mm.x() * right + pixel.y() * spacing_mm.y() * down;
    }
    Vector2 pixelAt(const Vector3& point) const {
        return {right.dot(point - origin) / spacing_mm.x(), down.dot(point - origin) / spacing_mm.y()};
    }
};

// A slice about `center`, of width_mm x height_mm; `down` is made orthogonal to `right`. Throws std::logic_error for
// directions that are zero or parallel, or a size of no or more than 2^26 pixels.
SlicePlane sliceAbout(const Vector3& center, const Vector3& right, const Vector3& down, const Vector2& size_mm,
                      double spacing_mm);

// `outside` beyond the outermost voxel centres.
Image obliqueSlice(const Volume& volume, const SlicePlane& plane, float outside);

// Where the slice cuts a closed mesh: closed polygons in its pixels, exact. Throws std::logic_error for an open mesh.
std::vector<std::vector<Vector2>> sectionInSlice(const HalfEdgeMesh& mesh, const Rigid3& volume_from_mesh,
                                                 const SlicePlane& plane);

}  // namespace fluorocut
