#include "core/image/isosurface.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace fluorocut {
namespace {

constexpr double kNearestToEnd = 1e-3;  // of an edge

// A cell's corners are numbered by bits: 1 along i, 2 along j, 4 along k. An edge joins a corner to one that has more
// bits; it belongs to the grid point at its lower end and is numbered there by the bits that it adds (1 to 7; 0 is the
// grid point itself).
using Tetrahedron = std::array<int, 4>;
constexpr std::array<Tetrahedron, 6> kTetrahedra{
    {{0, 1, 3, 7}, {0, 5, 1, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 4, 5, 7}, {0, 6, 4, 7}}};  // all turned alike

// Even permutations that bring one corner, or two, to the front.
constexpr std::array<Tetrahedron, 4> kOneFirst{{{0, 1, 2, 3}, {1, 0, 3, 2}, {2, 0, 1, 3}, {3, 0, 2, 1}}};
constexpr std::array<Tetrahedron, 6> kTwoFirst{
    {{0, 1, 2, 3}, {0, 2, 3, 1}, {0, 3, 1, 2}, {1, 2, 0, 3}, {1, 3, 2, 0}, {2, 3, 0, 1}}};

// The faces of a cell on the grid's border: corners counter-clockwise seen from above (along the axis, downward), with
// the diagonal of the tetrahedra between the first and the third.
constexpr std::array<std::array<int, 4>, 3> kFaces{{{0, 2, 6, 4}, {0, 4, 5, 1}, {0, 1, 3, 2}}};

class Extraction {
  public:
    Extraction(const Volume& volume, double level, GridBorder border)
        : volume_(volume),
          level_(level),
          closed_(border == GridBorder::closed),
          turned_(volume.grid().direction.determinant() < 0),
          width_(volume.size(0)),
          height_(volume.size(1)),
          depth_(volume.size(2)) {
        const std::size_t points = static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
        for (Slice& slice : slices_) {
            slice.inside.resize(points);
            slice.vertices.resize(8 * points);
        }
    }

    TriangleMesh run() {
        if (width_ < 2 || height_ < 2 || depth_ < 2) return {};
        enter(slices_[1], 0);
        for (layer_ = 0; layer_ + 1 < depth_; ++layer_) {
            std::swap(slices_[0], slices_[1]);
            enter(slices_[1], layer_ + 1);
            for (int j = 0; j + 1 < height_; ++j) {
                for (int i = 0; i + 1 < width_; ++i)
                    cell(i, j);
            }
        }
        return std::move(mesh_);
    }

  private:
    struct Slice {
        std::vector<std::uint8_t> inside;
        std::vector<std::int32_t> vertices;  // eight of every grid point; -1: not made yet
    };

    std::size_t point(int i, int j) const {
        return static_cast<std::size_t>(j) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(i);
    }

    void enter(Slice& slice, int k) {
        const float* values = volume_.row(0, k);
        for (std::size_t n = 0; n < slice.inside.size(); ++n)
            slice.inside[n] = values[n] < level_;
        std::fill(slice.vertices.begin(), slice.vertices.end(), -1);
    }

    void cell(int i, int j) {
        const std::size_t at = point(i, j), up = at + static_cast<std::size_t>(width_);
        int inside = 0;
        for (std::size_t k = 0; k < 2; ++k) {
            const auto& flags = slices_[k].inside;
            inside |= (flags[at] | flags[at + 1] << 1 | flags[up] << 2 | flags[up + 1] << 3) << 4 * k;
        }
        if (inside == 0) return;
        i_ = i;
        j_ = j;
        inside_ = inside;
        if (inside != 255) {
            for (const Tetrahedron& corners : kTetrahedra)
                tetrahedron(corners);
        }
        if (closed_) close();
    }

    bool isInside(int corner) const { return (inside_ >> corner & 1) != 0; }

    // One vertex for every edge, made when it is first met. Equal corners: the grid point itself.
    std::int32_t vertex(int a, int b) {
        const int low = a & b, high = a | b;
        Slice& slice = slices_[low >> 2];
        const int i = i_ + (low & 1), j = j_ + (low >> 1 & 1), k = layer_ + (low >> 2);
        std::int32_t& id = slice.vertices[8 * point(i, j) + static_cast<std::size_t>(high ^ low)];
        if (id < 0) {
            const Vector3 step(high & ~low & 1, (high & ~low) >> 1 & 1, (high & ~low) >> 2 & 1);
            double t = 0;
            if (high != low) {
                const double from = value(low), to = value(high);
                t = (level_ - from) / (to - from);
                if (!(t >= kNearestToEnd)) t = kNearestToEnd;
                if (!(t <= 1 - kNearestToEnd)) t = 1 - kNearestToEnd;
            }
            id = static_cast<std::int32_t>(mesh_.vertices.size());
            mesh_.vertices.push_back(volume_.grid().pointFromIndex(Vector3(i, j, k) + t * step));
        }
        return id;
    }

    double value(int corner) const {
        return volume_(i_ + (corner & 1), j_ + (corner >> 1 & 1), layer_ + (corner >> 2));
    }

    void add(std::int32_t a, std::int32_t b, std::int32_t c) {
        if (turned_) std::swap(b, c);
        mesh_.triangles.push_back({a, b, c});
    }

    void tetrahedron(const Tetrahedron& corners) {
        unsigned mask = 0;
        for (unsigned n = 0; n < 4; ++n)
            mask |= static_cast<unsigned>(isInside(corners[n])) << n;
        const auto edge = [&](int from, int to) {
            return vertex(corners[static_cast<std::size_t>(from)], corners[static_cast<std::size_t>(to)]);
        };
        for (std::size_t n = 0; n < 4; ++n) {
            const auto& [a, b, c, d] = kOneFirst[n];
            if (mask == 1U << n) return add(edge(a, b), edge(a, c), edge(a, d));
            if (mask == (15U & ~(1U << n))) return add(edge(a, b), edge(a, d), edge(a, c));
        }
        for (const auto& [a, b, c, d] : kTwoFirst) {
            if (mask != ((1U << a) | (1U << b))) continue;
            const std::array<std::int32_t, 4> quad{edge(a, c), edge(a, d), edge(b, d), edge(b, c)};
            const auto squaredLength = [&](std::size_t p, std::size_t q) {
                return (mesh_.vertices[static_cast<std::size_t>(quad[p])] -
                        mesh_.vertices[static_cast<std::size_t>(quad[q])])
                    .squaredNorm();
            };
            const std::size_t first = squaredLength(0, 2) <= squaredLength(1, 3) ? 0 : 1;  // the shorter diagonal
            add(quad[first], quad[first + 1], quad[first + 2]);
            add(quad[first], quad[first + 2], quad[(first + 3) % 4]);
            return;
        }
    }

    // The flat faces where the cell lies at the grid's border.
    void close() {
        const std::array<int, 3> index{i_, j_, layer_}, last{width_ - 2, height_ - 2, depth_ - 2};
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const auto& f = kFaces[axis];
            const int up = 1 << axis;
            if (index[axis] == last[axis]) {
                face(f[0] | up, f[1] | up, f[2] | up);
                face(f[0] | up, f[2] | up, f[3] | up);
            }
            if (index[axis] == 0) {
                face(f[0], f[2], f[1]);
                face(f[0], f[3], f[2]);
            }
        }
    }

    // The part of a triangle of grid points that is inside.
    void face(int a, int b, int c) {
        for (int turn = 0; turn < 3; ++turn) {
            const bool in_a = isInside(a), in_b = isInside(b), in_c = isInside(c);
            if (in_a && in_b && in_c) return add(vertex(a, a), vertex(b, b), vertex(c, c));
            if (in_a && !in_b && !in_c) return add(vertex(a, a), vertex(a, b), vertex(a, c));
            if (in_a && in_b) {
                add(vertex(a, a), vertex(b, b), vertex(b, c));
                return add(vertex(a, a), vertex(b, c), vertex(a, c));
            }
            std::swap(a, b);
            std::swap(b, c);
        }
    }

    const Volume& volume_;
    const double level_;
    const bool closed_, turned_;
    const int width_, height_, depth_;
    std::array<Slice, 2> slices_;  // below and above the cells of a layer
    TriangleMesh mesh_;
    int layer_ = 0, i_ = 0, j_ = 0, inside_ = 0;  // the cell at hand
};

}  // namespace

TriangleMesh isosurface(const Volume& volume, double level, GridBorder border) {
    return Extraction(volume, level, border).run();
}

}  // namespace fluorocut
