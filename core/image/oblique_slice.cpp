#include "core/image/oblique_slice.h"

#include <cmath>
#include <stdexcept>

#include "core/base/parallel.h"
#include "core/geometry/mesh_section.h"

namespace fluorocut {

SlicePlane sliceAbout(const Vector3& center, const Vector3& right, const Vector3& down, const Vector2& size_mm,
                      double spacing_mm) {
    SlicePlane plane;
    plane.right = right.normalized();
    plane.down = (down - plane.right.dot(down) * plane.right).normalized();
    const Vector2 pixels = size_mm / spacing_mm;
    if (!(std::abs(plane.right.norm() - 1) < 1e-9 && std::abs(plane.down.norm() - 1) < 1e-9 &&
          std::abs(plane.right.dot(plane.down)) < 1e-6))
        throw std::logic_error("sliceAbout: directions that are zero or parallel");
    if (!(pixels.minCoeff() >= 1 && pixels.prod() <= 1 << 26))
        throw std::logic_error("sliceAbout: a slice of no size or of too many pixels");
    plane.spacing_mm.setConstant(spacing_mm);
    plane.width = static_cast<int>(std::lround(pixels.x()));
    plane.height = static_cast<int>(std::lround(pixels.y()));
    plane.origin = center - 0.5 * spacing_mm * ((plane.width - 1) * plane.right + (plane.height - 1) * plane.down);
    return plane;
}

Image obliqueSlice(const Volume& volume, const SlicePlane& plane, float outside) {
    const VolumeGrid& grid = volume.grid();
    const Vector3 first = grid.indexFromPoint(plane.origin);
    const Vector3 per_x = grid.indexFromPoint(plane.pointAt({1, 0})) - first;
    const Vector3 per_y = grid.indexFromPoint(plane.pointAt({0, 1})) - first;
    Image slice(plane.width, plane.height);
    parallelFor(static_cast<std::size_t>(plane.height), 16, [&](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
            for (int x = 0; x < plane.width; ++x)
                slice(x, y) = sampleLinear(volume, first + x * per_x + y * per_y, outside);
    });
    return slice;
}

std::vector<std::vector<Vector2>> sectionInSlice(const HalfEdgeMesh& mesh, const Rigid3& volume_from_mesh,
                                                 const SlicePlane& plane) {
    const Rigid3 mesh_from_volume = volume_from_mesh.inverse();
    const Plane cut{mesh_from_volume * plane.origin, mesh_from_volume.rotate(plane.right.cross(plane.down))};
    std::vector<std::vector<Vector2>> polygons;
    for (const auto& polygon : sectionPolygons(mesh, cut)) {
        std::vector<Vector2>& pixels = polygons.emplace_back();
        for (const Vector3& corner : polygon)
            pixels.push_back(plane.pixelAt(volume_from_mesh * corner));
    }
    return polygons;
}

}  // namespace fluorocut
