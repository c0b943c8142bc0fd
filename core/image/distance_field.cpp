#include "core/image/distance_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/parallel.h"
#include "core/geometry/mesh_properties.h"
#include "core/image/isosurface.h"

namespace fluorocut {
namespace {

constexpr double kMostVoxels = 1 << 27;
constexpr double kLookAhead = 8;    // voxels beyond the band, so that a search speaks for the next ones too
constexpr int kSlicesAtATime = 16;  // between questions whether to stop

// Where a row of voxels passes through the surface: into the solid (+1) or out of it (-1).
struct Crossing {
    std::size_t row;
    double i;
    int turn;
};

// On which side of the line from a to b, both in the plane across the rows, the row's point lies: twice the signed
// area. The order of the ends is made one's own, so that two triangles see their common edge alike, to the last bit. On
// the line the row counts as shifted by an infinitely small step along j, and a smaller one along k.
struct Side {
    double area = 0;
    int sign = 0;
};

Side sideOf(Vector2 a, Vector2 b, const Vector2& p) {
    const bool swapped = b.x() < a.x() || (b.x() == a.x() && b.y() < a.y());
    if (swapped) std::swap(a, b);
    const Vector2 along = b - a;
    const double area = along.x() * (p.y() - a.y()) - along.y() * (p.x() - a.x());
    int sign = area > 0 ? 1 : area < 0 ? -1 : 0;
    if (sign == 0) sign = along.y() < 0 ? 1 : along.y() > 0 ? -1 : along.x() > 0 ? 1 : along.x() < 0 ? -1 : 0;
    return swapped ? Side{-area, -sign} : Side{area, sign};
}

void addCrossings(const std::array<Vector3, 3>& corner, const VolumeGrid& grid, int orientation,
                  std::vector<Crossing>& crossings) {
    const auto range = [&](int axis) {
        const auto [low, high] = std::minmax({corner[0][axis], corner[1][axis], corner[2][axis]});
        const double last = grid.size[static_cast<std::size_t>(axis)] - 1;
        return std::pair(static_cast<int>(std::ceil(std::clamp(low, 0.0, last + 1))),
                         static_cast<int>(std::floor(std::clamp(high, -1.0, last))));
    };
    std::array<Vector2, 3> flat;
    for (std::size_t n = 0; n < 3; ++n)
        flat[n] = corner[n].tail<2>();
    const auto [first_j, last_j] = range(1);
    const auto [first_k, last_k] = range(2);
    for (int k = first_k; k <= last_k; ++k) {
        for (int j = first_j; j <= last_j; ++j) {
            std::array<Side, 3> side;
            for (std::size_t n = 0; n < 3; ++n)
                side[n] = sideOf(flat[(n + 1) % 3], flat[(n + 2) % 3], Vector2(j, k));
            const int turn = side[0].sign;
            if (turn == 0 || side[1].sign != turn || side[2].sign != turn) continue;
            const double area = side[0].area + side[1].area + side[2].area;
            double i = 0;
            for (std::size_t n = 0; n < 3; ++n)
                i += (area != 0 ? side[n].area / area : 1.0 / 3) * corner[n].x();
            // counter-clockwise seen from rising i: the surface faces that way, the row leaves the solid
            crossings.push_back(
                {static_cast<std::size_t>(k) * static_cast<std::size_t>(grid.size[1]) + static_cast<std::size_t>(j), i,
                 -turn * orientation});
        }
    }
}

Volume turnedRound(const TriangleMesh& mesh, const VolumeGrid& grid) {
    std::vector<Vector3> vertices;
    vertices.reserve(mesh.vertices.size());
    for (const Vector3& v : mesh.vertices)
        vertices.push_back(grid.indexFromPoint(v));
    const int orientation = grid.direction.determinant() < 0 ? -1 : 1;
    std::vector<Crossing> crossings;
    for (const auto& [a, b, c] : mesh.triangles) {
        addCrossings({vertices[static_cast<std::size_t>(a)], vertices[static_cast<std::size_t>(b)],
                      vertices[static_cast<std::size_t>(c)]},
                     grid, orientation, crossings);
    }
    std::sort(crossings.begin(), crossings.end(),
              [](const Crossing& a, const Crossing& b) { return a.row != b.row ? a.row < b.row : a.i < b.i; });
    Volume inside(grid, 1.0F);
    for (std::size_t n = 0; n + 1 < crossings.size(); ++n) {
        int turns = 0;
        const std::size_t row = crossings[n].row;
        float* voxels = inside.voxels().data() + row * static_cast<std::size_t>(grid.size[0]);
        for (; n + 1 < crossings.size() && crossings[n + 1].row == row; ++n) {
            turns += crossings[n].turn;
            if (turns <= 0) continue;
            const double last = grid.size[0] - 1;
            const double from = std::ceil(std::clamp(crossings[n].i, 0.0, last + 1));
            const double to = std::floor(std::clamp(crossings[n + 1].i, -1.0, last));
            for (int i = static_cast<int>(from); i <= static_cast<int>(to); ++i)
                voxels[i] = -1;
        }
    }
    return inside;
}

// Of the slice's voxels, `field` says on which side they are.
void fillSlice(Volume& field, int k, const MeshDistance& surface, double level, const FieldBand& band) {
    const VolumeGrid& grid = field.grid();
    const double step = grid.spacing_mm.x();
    for (int j = 0; j < field.size(1); ++j) {
        float* row = field.row(j, k);
        std::int32_t guess = -1;
        double least = 0;  // what the last search says of this voxel's distance: no less than that
        for (int i = 0; i < field.size(0); ++i, least -= step) {
            const bool inside = row[i] < level;
            const double limit = inside ? band.inside_mm : band.outside_mm;
            double distance = limit;
            if (limit > 0 && !(least >= limit)) {
                const double most = limit + kLookAhead * step;
                const NearestPoint nearest = surface.nearest(grid.pointFromIndex(Vector3(i, j, k)), most, guess);
                if (nearest.triangle >= 0) guess = nearest.triangle;
                least = std::min(nearest.distance_mm, most);
                distance = std::min(least, limit);
            }
            // inside is below zero, also on a face that another part covers
            row[i] = static_cast<float>(inside ? -std::max(distance, 1e-30) : distance);
        }
    }
}

}  // namespace

Result<VolumeGrid> gridAround(const Vector3& low, const Vector3& high, double spacing_mm, double margin_mm) {
    if (auto ok = requireRange("spacing_mm", spacing_mm, 1e-3, 100, "mm"); !ok) return ok.error();
    VolumeGrid grid;
    grid.spacing_mm.setConstant(spacing_mm);
    grid.origin_mm = low.array() - margin_mm;
    double voxels = 1;
    for (int axis = 0; axis < 3; ++axis) {
        // a box that is a whole number of voxels but for rounding gets no extra one
        const double steps = std::ceil((high[axis] - low[axis] + 2 * margin_mm) / spacing_mm - 1e-9);
        voxels *= std::max(steps, 1.0) + 1;
        if (!(voxels <= kMostVoxels)) {
            return invalidOption("spacing_mm",
                                 fmt::format("{:g} mm for a box of {:.4g} x {:.4g} x {:.4g} mm", spacing_mm,
                                             high.x() - low.x(), high.y() - low.y(), high.z() - low.z()),
                                 "no more than 2^27 voxels", "take a larger spacing");
        }
        grid.size[static_cast<std::size_t>(axis)] = static_cast<int>(std::max(steps, 1.0)) + 1;
    }
    return grid;
}

Result<Volume> sidesOf(const TriangleMesh& mesh, const VolumeGrid& grid, const std::string& where) {
    if (const Result<void> solid = requireSolid(mesh, where); !solid) return solid.error();
    return turnedRound(mesh, grid);
}

Result<Volume> distanceField(const TriangleMesh& mesh, const VolumeGrid& grid, const FieldBand& band,
                             Progress& progress, const std::string& where) {
    Result<Volume> sides = sidesOf(mesh, grid, where);
    if (!sides) return sides;
    const Result<MeshDistance> surface = MeshDistance::build(mesh, where);
    if (!surface) return surface.error();
    return distancesTo(*surface, std::move(*sides), 0, band, progress);
}

Result<Volume> distancesTo(const MeshDistance& surface, Volume field, double level, const FieldBand& band,
                           Progress& progress) {
    const int slices = field.size(2);
    for (int first = 0; first < slices; first += kSlicesAtATime) {
        progress.report(static_cast<double>(first) / slices, "distances");
        if (progress.isCancelled()) return cancelled("distance field");
        const int count = std::min(kSlicesAtATime, slices - first);
        parallelFor(static_cast<std::size_t>(count), 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t n = begin; n < end; ++n)
                fillSlice(field, first + static_cast<int>(n), surface, level, band);
        });
    }
    progress.report(1, "distances");
    return field;
}

Result<Volume> redistanced(const Volume& field, const FieldBand& band, double level, Progress& progress) {
    const Result<MeshDistance> surface = MeshDistance::build(isosurface(field, level, GridBorder::open));
    if (surface) return distancesTo(*surface, field, level, band, progress);
    Volume all(field.grid());  // no surface: everything is inside, or nothing
    for (std::size_t n = 0; n < all.voxels().size(); ++n)
        all.voxels()[n] = static_cast<float>(field.voxels()[n] < level ? -band.inside_mm : band.outside_mm);
    return all;
}

void sweepUp(Volume& field) {
    const std::size_t layer = static_cast<std::size_t>(field.size(0)) * static_cast<std::size_t>(field.size(1));
    std::vector<float>& voxels = field.voxels();
    for (std::size_t n = layer; n < voxels.size(); ++n)
        voxels[n] = std::min(voxels[n], voxels[n - layer]);
}

double sampleField(const Volume& field, const Vector3& point, double outside) {
    const Vector3 index = field.grid().indexFromPoint(point);
    return sampleLinear(field, index, static_cast<float>(outside));
}

Vector3 fieldGradient(const Volume& field, const Vector3& point) {
    const Vector3 index = field.grid().indexFromPoint(point);
    std::array<int, 3> base{};
    Vector3 weight;
    for (int axis = 0; axis < 3; ++axis) {
        const int last = field.size(axis) - 1;
        if (!(last >= 1 && index[axis] >= 0 && index[axis] <= last)) return Vector3::Zero();
        base[static_cast<std::size_t>(axis)] = std::min(static_cast<int>(index[axis]), last - 1);
        weight[axis] = index[axis] - base[static_cast<std::size_t>(axis)];
    }
    Vector3 gradient = Vector3::Zero();  // by index
    for (int corner = 0; corner < 8; ++corner) {
        const std::array<int, 3> bit{corner & 1, corner >> 1 & 1, corner >> 2 & 1};
        const double value = field(base[0] + bit[0], base[1] + bit[1], base[2] + bit[2]);
        for (int axis = 0; axis < 3; ++axis) {
            double w = bit[static_cast<std::size_t>(axis)] ? 1 : -1;
            for (int other = 0; other < 3; ++other) {
                if (other == axis) continue;
                w *= bit[static_cast<std::size_t>(other)] ? weight[other] : 1 - weight[other];
            }
            gradient[axis] += w * value;
        }
    }
    return field.grid().direction * gradient.cwiseQuotient(field.grid().spacing_mm);
}

}  // namespace fluorocut
