// TriangleMesh: vertices (mm, in the frame the owner says) and counter-clockwise triangles, seen from outside.
// A plain value; adjacency lives in HalfEdgeMesh, built from it once.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/geometry/rigid3.h"

namespace fluorocut {

using Triangle = std::array<std::int32_t, 3>;

struct TriangleMesh {
    std::vector<Vector3> vertices;
    std::vector<Triangle> triangles;
};

}  // namespace fluorocut
