#include "core/geometry/shaded_mesh.h"

#include <cmath>

namespace fluorocut {
namespace {

// The vertices that a mesh's vertex has become, one for every smooth patch that meets there, as a list in one array.
struct Patch {
    Vector3 first_normal;    // unit, of the triangle that began it
    std::int32_t next = -1;  // of the same vertex
};

}  // namespace

ShadedMesh shadedMesh(const TriangleMesh& mesh, double crease_rad) {
    const double least_cosine = std::cos(crease_rad);
    ShadedMesh result;
    result.vertices = mesh.vertices;
    result.normals.assign(mesh.vertices.size(), Vector3::Zero());
    result.triangles.reserve(mesh.triangles.size());
    std::vector<Patch> patches(mesh.vertices.size(), {Vector3::Zero(), -1});

    for (const Triangle& triangle : mesh.triangles) {
        const auto corner = [&](std::size_t i) { return mesh.vertices.at(static_cast<std::size_t>(triangle[i])); };
        const Vector3 a = corner(0), b = corner(1), c = corner(2);
        const Vector3 area = (b - a).cross(c - a);
        const double size = area.norm();
        Triangle shaded = triangle;
        if (size > 0) {
            const Vector3 normal = area / size;
            for (std::int32_t& vertex : shaded) {
                std::int32_t patch = vertex;
                for (;;) {
                    Patch& tried = patches[static_cast<std::size_t>(patch)];
                    if (tried.first_normal.isZero()) tried.first_normal = normal;
                    if (tried.first_normal.dot(normal) >= least_cosine) break;
                    if (tried.next < 0) {
                        const auto added = static_cast<std::int32_t>(patches.size());
                        tried.next = added;
                        patches.push_back({normal, -1});
                        result.vertices.push_back(mesh.vertices[static_cast<std::size_t>(vertex)]);
                        result.normals.push_back(Vector3::Zero());
                        patch = added;
                        break;
                    }
                    patch = tried.next;
                }
                result.normals[static_cast<std::size_t>(patch)] += area;
                vertex = patch;
            }
        }
        result.triangles.push_back(shaded);
    }
    for (Vector3& normal : result.normals) {
        const double size = normal.norm();
        if (size > 0) normal /= size;
    }
    return result;
}

std::optional<double> firstHit(const ShadedMesh& mesh, const Vector3& origin, const Vector3& direction) {
    std::optional<double> first;
    for (const Triangle& triangle : mesh.triangles) {
        const Vector3& a = mesh.vertices[static_cast<std::size_t>(triangle[0])];
        const Vector3 ab = mesh.vertices[static_cast<std::size_t>(triangle[1])] - a;
        const Vector3 ac = mesh.vertices[static_cast<std::size_t>(triangle[2])] - a;
        const Vector3 across = direction.cross(ac);
        const double determinant = ab.dot(across);
        if (determinant == 0) continue;
        const Vector3 from_a = origin - a;
        const double u = from_a.dot(across) / determinant;
        if (!(u >= 0 && u <= 1)) continue;
        const Vector3 along = from_a.cross(ab);
        const double v = direction.dot(along) / determinant;
        if (!(v >= 0 && u + v <= 1)) continue;
        const double t = ac.dot(along) / determinant;
        if (t > 0 && (!first || t < *first)) first = t;
    }
    return first;
}

}  // namespace fluorocut
