#include "core/image/voxelize.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "core/base/parallel.h"
#include "core/geometry/mesh_properties.h"

namespace fluorocut {
namespace {

// Voxel coordinates of the block: voxel (i, j, k) is the box [i, i + 1] x [j, j + 1] x [k, k + 1].
constexpr double kRounding = 1e-9;  // fractions nearer than this to 0 and 1 are 0 and 1

// A convex piece of a triangle: three corners and one more for each of six cuts at most. The room above nine is for
// pieces that rounding made not quite convex; a corner beyond it, a rounding's breadth from its neighbours, is left
// out.
struct Piece {
    int count = 0;
    std::array<Vector3, 12> corners;

    void add(const Vector3& corner) {
        if (count < static_cast<int>(corners.size())) corners[static_cast<std::size_t>(count++)] = corner;
    }

    double min(int axis) const {
        return extreme(axis, [](double a, double b) { return a < b; });
    }
    double max(int axis) const {
        return extreme(axis, [](double a, double b) { return a > b; });
    }

  private:
    template <class Better>
    double extreme(int axis, Better better) const {
        double best = corners[0][axis];
        for (std::size_t i = 1; i < static_cast<std::size_t>(count); ++i) {
            if (better(corners[i][axis], best)) best = corners[i][axis];
        }
        return best;
    }
};

// Cuts `piece` at the plane coordinate[axis] = value: `piece` keeps what lies above, the result is what lies below.
Piece cutOffBelow(Piece& piece, int axis, double value) {
    Piece below, above;
    for (int i = 0; i < piece.count; ++i) {
        const Vector3& p = piece.corners[static_cast<std::size_t>(i)];
        const Vector3& q = piece.corners[static_cast<std::size_t>((i + 1) % piece.count)];
        const double dp = p[axis] - value, dq = q[axis] - value;
        if (dp <= 0) below.add(p);
        if (dp >= 0) above.add(p);
        if ((dp < 0 && dq > 0) || (dp > 0 && dq < 0)) {
            Vector3 crossing = p + dp / (dp - dq) * (q - p);
            crossing[axis] = value;
            below.add(crossing);
            above.add(crossing);
        }
    }
    piece = above;
    return below;
}

// Calls use(index, part) for the parts of a piece in the slabs [index, index + 1] of an axis that lie in [0, size).
// Parts below go to use(-1, part) when `keep_below`; parts above are dropped.
template <class Use>
void slice(Piece piece, int axis, int size, bool keep_below, Use&& use) {
    const double high = piece.max(axis);
    double low = piece.min(axis);
    if (low < 0) {
        const Piece below = cutOffBelow(piece, axis, 0);
        if (keep_below) use(-1, below);
        if (high <= 0) return;
        low = 0;
    }
    if (low >= size) return;
    for (int index = static_cast<int>(low); index < size; ++index) {
        if (high <= index + 1) {
            use(index, piece);
            return;
        }
        use(index, cutOffBelow(piece, axis, index + 1));
    }
}

// Adds a piece that lies inside row (j, k), at voxel i, to the row's differences: their running sum is the fraction. -1
// stands for "before the row". An outward normal toward -i means that the solid begins there, hence the sign.
void addToRow(double* row, int i, const Piece& piece, double sign) {
    double area = 0, moment = 0;  // projected along i; moment = integral of depth
    const Vector3& a = piece.corners[0];
    for (int n = 1; n + 1 < piece.count; ++n) {
        const Vector3& b = piece.corners[static_cast<std::size_t>(n)];
        const Vector3& c = piece.corners[static_cast<std::size_t>(n + 1)];
        const double part = 0.5 * ((b.y() - a.y()) * (c.z() - a.z()) - (b.z() - a.z()) * (c.y() - a.y()));
        area += part;
        moment += part * ((a.x() + b.x() + c.x()) / 3 - i);
    }
    if (i < 0) {
        row[0] -= sign * area;
    } else {
        row[i] -= sign * (area - moment);
        row[i + 1] -= sign * moment;
    }
}

// Block of voxels that bounds the vertices (voxel coordinates of the whole grid), cut to the grid.
struct Block {
    std::array<int, 3> offset{}, size{};
    bool empty() const { return size[0] == 0 || size[1] == 0 || size[2] == 0; }
};

Block boundingBlock(const Vector3& low, const Vector3& high, const VolumeGrid& grid) {
    Block block;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto clamped = [&](double value) {
            return static_cast<int>(std::clamp<double>(value, 0, grid.size[axis]));
        };
        block.offset[axis] = clamped(std::floor(low[static_cast<int>(axis)]));
        block.size[axis] = clamped(std::ceil(high[static_cast<int>(axis)])) - block.offset[axis];
    }
    return block;
}

// The triangles that touch each slab k, in their order: slab k owns triangles[first[k]] ... triangles[first[k + 1] -
// 1].
struct Slabs {
    std::vector<std::size_t> first;
    std::vector<std::int32_t> triangles;
};

Slabs sortIntoSlabs(const std::vector<Triangle>& triangles, const std::vector<Vector3>& vertices, int slabs) {
    const auto range = [&](const Triangle& t) {
        const auto z = [&](int corner) {
            return vertices[static_cast<std::size_t>(t[static_cast<std::size_t>(corner)])].z();
        };
        const auto [low, high] = std::minmax({z(0), z(1), z(2)});
        return std::pair(static_cast<std::size_t>(std::clamp<double>(std::floor(low), 0, slabs)),
                         static_cast<std::size_t>(std::clamp<double>(std::ceil(high), 0, slabs)));
    };
    Slabs result;
    result.first.assign(static_cast<std::size_t>(slabs) + 1, 0);
    for (const Triangle& t : triangles) {
        const auto [begin, end] = range(t);
        for (std::size_t k = begin; k < end; ++k)
            ++result.first[k + 1];
    }
    for (std::size_t k = 1; k < result.first.size(); ++k)
        result.first[k] += result.first[k - 1];
    result.triangles.resize(result.first.back());
    std::vector<std::size_t> fill(result.first.begin(), result.first.end() - 1);
    for (std::size_t f = 0; f < triangles.size(); ++f) {
        const auto [begin, end] = range(triangles[f]);
        for (std::size_t k = begin; k < end; ++k)
            result.triangles[fill[k]++] = static_cast<std::int32_t>(f);
    }
    return result;
}

}  // namespace

Result<VoxelCoverage> voxelize(const TriangleMesh& mesh, const Rigid3& volume_from_mesh, const VolumeGrid& grid,
                               const std::string& where) {
    if (!((grid.spacing_mm.array() > 0).all() && grid.size[0] >= 0 && grid.size[1] >= 0 && grid.size[2] >= 0)) {
        throw std::logic_error("voxelize: a grid with a negative size or spacing");
    }
    if (const Result<void> solid = requireSolid(mesh, where); !solid) return solid.error();

    std::vector<Vector3> vertices;
    vertices.reserve(mesh.vertices.size());
    for (const Vector3& v : mesh.vertices)
        vertices.push_back((grid.indexFromPoint(volume_from_mesh * v).array() + 0.5).matrix());
    Vector3 low = vertices[static_cast<std::size_t>(mesh.triangles[0][0])], high = low;
    for (const Triangle& t : mesh.triangles) {
        for (const std::int32_t v : t) {
            low = low.cwiseMin(vertices[static_cast<std::size_t>(v)]);
            high = high.cwiseMax(vertices[static_cast<std::size_t>(v)]);
        }
    }
    const Block block = boundingBlock(low, high, grid);
    VoxelCoverage coverage;
    if (block.empty()) return coverage;
    const Vector3 offset(block.offset[0], block.offset[1], block.offset[2]);
    for (Vector3& v : vertices)
        v -= offset;

    coverage.offset = block.offset;
    VolumeGrid block_grid = grid;
    block_grid.size = block.size;
    block_grid.origin_mm = grid.pointFromIndex(offset);
    coverage.fraction = Volume(block_grid);

    const auto [width, height, depth] = block.size;
    const std::size_t stride = static_cast<std::size_t>(width) + 1;
    const double sign = grid.direction.determinant() < 0 ? -1 : 1;  // a mirrored grid turns the surface inside out
    const Slabs slabs = sortIntoSlabs(mesh.triangles, vertices, depth);
    std::vector<double> filled(static_cast<std::size_t>(depth), 0);  // voxels filled in each slab
    parallelFor(static_cast<std::size_t>(depth), 1, [&](std::size_t begin, std::size_t end) {
        std::vector<double> differences;
        for (std::size_t k = begin; k < end; ++k) {
            differences.assign(stride * static_cast<std::size_t>(height), 0);
            for (std::size_t n = slabs.first[k]; n < slabs.first[k + 1]; ++n) {
                Piece piece;
                for (const std::int32_t v : mesh.triangles[static_cast<std::size_t>(slabs.triangles[n])])
                    piece.add(vertices[static_cast<std::size_t>(v)]);
                const auto plane = static_cast<double>(k);
                if (piece.min(2) < plane) (void)cutOffBelow(piece, 2, plane);
                if (piece.max(2) > plane + 1) piece = cutOffBelow(piece, 2, plane + 1);
                slice(piece, 1, height, false, [&](int j, const Piece& in_row) {
                    double* row = differences.data() + stride * static_cast<std::size_t>(j);
                    slice(in_row, 0, width, true,
                          [&](int i, const Piece& in_voxel) { addToRow(row, i, in_voxel, sign); });
                });
            }
            for (int j = 0; j < height; ++j) {
                const double* row = differences.data() + stride * static_cast<std::size_t>(j);
                float* fractions = coverage.fraction.row(j, static_cast<int>(k));
                double sum = 0;
                for (int i = 0; i < width; ++i) {
                    sum += row[i];
                    const double fraction = sum < kRounding ? 0 : sum > 1 - kRounding ? 1 : sum;
                    fractions[i] = static_cast<float>(fraction);
                    filled[k] += fraction;
                }
            }
        }
    });
    for (const double voxels : filled)
        coverage.volume_mm3 += voxels * grid.spacing_mm.prod();
    return coverage;
}

}  // namespace fluorocut
