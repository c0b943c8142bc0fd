#include "core/image/offset_surface.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include <Eigen/Cholesky>

#include "core/base/parallel.h"

namespace fluorocut {
namespace {

constexpr double kPull = 0.005;  // toward the mean of a cell's points, as a share of the planes' weight: where they
                                 // leave a direction free

constexpr double kBeside = 0.75;  // of a cell: how far its vertex may leave it
constexpr double kDeepEnough_mm = 0.002;

using Index = std::array<int, 3>;

// Where a grid edge passes through the surface, and the tangent plane there: normal . x = offset.
struct Crossing {
    Index at;  // the edge's lower end
    std::size_t axis;
    Vector3 point, normal;
    double offset = 0;
};

std::vector<Crossing> findCrossings(const Volume& field, double level) {
    std::vector<Crossing> crossings;
    for (int k = 0; k < field.size(2); ++k) {
        for (int j = 0; j < field.size(1); ++j) {
            for (int i = 0; i < field.size(0); ++i) {
                const double here = field(i, j, k);
                for (std::size_t axis = 0; axis < 3; ++axis) {
                    Index next{i, j, k};
                    if (++next[axis] >= field.size(static_cast<int>(axis))) continue;
                    const double there = field(next[0], next[1], next[2]);
                    if ((here < level) == (there < level)) continue;
                    Vector3 index(i, j, k);
                    index[static_cast<int>(axis)] += std::clamp((level - here) / (there - here), 0.0, 1.0);
                    crossings.push_back({{i, j, k}, axis, field.grid().pointFromIndex(index), Vector3::Zero()});
                }
            }
        }
    }
    return crossings;
}

void fitPlanes(const MeshDistance& wall, double depth_mm, std::vector<Crossing>& crossings) {
    parallelFor(crossings.size(), 256, [&](std::size_t begin, std::size_t end) {
        std::int32_t guess = -1;
        for (std::size_t n = begin; n < end; ++n) {
            Crossing& crossing = crossings[n];
            const NearestPoint nearest = wall.nearest(crossing.point, 2 * depth_mm, guess);
            guess = nearest.triangle;
            if (!(nearest.distance_mm > 0) || nearest.triangle < 0) continue;
            crossing.normal = (crossing.point - nearest.point) / nearest.distance_mm;
            crossing.offset = crossing.normal.dot(nearest.point) + depth_mm;
            crossing.point += (depth_mm - nearest.distance_mm) * crossing.normal;
        }
    });
}

// The planes of a cell's edges: least squares of normal . x - offset.
struct Fit {
    Matrix3 normal_matrix = Matrix3::Zero();
    Vector3 right = Vector3::Zero(), sum = Vector3::Zero();
    int count = 0;
};

class Contour {
  public:
    explicit Contour(const Volume& field)
        : grid_(field.grid()), vertex_of_(field.voxels().size(), -1), stride_{1, field.size(0), 0} {
        stride_[2] = static_cast<std::ptrdiff_t>(field.size(0)) * field.size(1);
    }

    void add(const Crossing& crossing) {
        forEachCell(crossing, [&](std::size_t cell) {
            if (vertex_of_[cell] < 0) {
                vertex_of_[cell] = static_cast<std::int32_t>(fits_.size());
                fits_.emplace_back();
                cells_.push_back(cell);
            }
            Fit& fit = fits_[static_cast<std::size_t>(vertex_of_[cell])];
            fit.normal_matrix += crossing.normal * crossing.normal.transpose();
            fit.right += crossing.offset * crossing.normal;
            fit.sum += crossing.point;
            ++fit.count;
        });
    }

    TriangleMesh mesh(const std::vector<Crossing>& crossings, const MeshDistance& wall, double depth_mm) const {
        TriangleMesh mesh;
        mesh.vertices.resize(fits_.size());
        parallelFor(fits_.size(), 256, [&](std::size_t begin, std::size_t end) {
            for (std::size_t v = begin; v < end; ++v)
                mesh.vertices[v] = pulledIn(vertexOf(fits_[v], cells_[v]), wall, depth_mm);
        });
        const auto vertex = [&](std::int32_t v) -> const Vector3& {
            return mesh.vertices[static_cast<std::size_t>(v)];
        };
        for (const Crossing& crossing : crossings) {
            std::array<std::int32_t, 4> quad{};
            std::size_t count = 0;
            forEachCell(crossing, [&](std::size_t cell) { quad[count++] = vertex_of_[cell]; });
            if (count < 4) continue;  // at the grid's border
            // the diagonal that passes nearer to the plane
            const auto off = [&](std::size_t a, std::size_t b) {
                return std::abs(crossing.normal.dot(0.5 * (vertex(quad[a]) + vertex(quad[b]))) - crossing.offset);
            };
            const std::size_t first = off(0, 2) <= off(1, 3) ? 0 : 1;
            mesh.triangles.push_back({quad[first], quad[first + 1], quad[first + 2]});
            mesh.triangles.push_back({quad[first], quad[first + 2], quad[(first + 3) % 4]});
        }
        return mesh;
    }

  private:
    // The cells round an edge, in order; a cell is numbered by its lowest corner.
    template <class Use>
    void forEachCell(const Crossing& crossing, Use&& use) const {
        const std::size_t u = (crossing.axis + 1) % 3, v = (crossing.axis + 2) % 3;
        constexpr std::array<std::array<int, 2>, 4> kRound{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
        for (const auto& [back_u, back_v] : kRound) {
            const int at_u = crossing.at[u] - back_u, at_v = crossing.at[v] - back_v;
            if (at_u < 0 || at_v < 0 || at_u + 1 >= grid_.size[u] || at_v + 1 >= grid_.size[v]) continue;
            use(static_cast<std::size_t>(at_u * stride_[u] + at_v * stride_[v] +
                                         crossing.at[crossing.axis] * stride_[crossing.axis]));
        }
    }

    Vector3 vertexOf(const Fit& fit, std::size_t cell) const {
        const Vector3 mean = fit.sum / fit.count;
        const Matrix3 pulled = fit.normal_matrix + kPull * fit.count * Matrix3::Identity();
        const Vector3 best = mean + pulled.ldlt().solve(fit.right - fit.normal_matrix * mean);
        const auto at = static_cast<std::ptrdiff_t>(cell);
        const Vector3 corner(static_cast<double>(at % stride_[1]), static_cast<double>(at % stride_[2] / stride_[1]),
                             static_cast<double>(at / stride_[2]));
        // An edge's line may pass beside the cell in which the two faces are seen.
        const Vector3 beside = Vector3::Constant(kBeside);
        const Vector3 low = grid_.pointFromIndex(corner - beside);
        const Vector3 high = grid_.pointFromIndex(corner + Vector3::Ones() + beside);
        return best.cwiseMax(low).cwiseMin(high);
    }

    // Planes round a tight curve meet beyond it: back to the depth.
    static Vector3 pulledIn(Vector3 vertex, const MeshDistance& wall, double depth_mm) {
        std::int32_t guess = -1;
        for (int step = 0; step < 3; ++step) {
            const NearestPoint nearest = wall.nearest(vertex, depth_mm - kDeepEnough_mm, guess);
            if (nearest.triangle < 0 || !(nearest.distance_mm > 0)) break;
            guess = nearest.triangle;
            vertex += (depth_mm - nearest.distance_mm) / nearest.distance_mm * (vertex - nearest.point);
        }
        return vertex;
    }

    const VolumeGrid& grid_;
    std::vector<std::int32_t> vertex_of_;
    std::array<std::ptrdiff_t, 3> stride_;
    std::vector<Fit> fits_;
    std::vector<std::size_t> cells_;
};

}  // namespace

TriangleMesh offsetSurface(const MeshDistance& wall, double depth_mm, const Volume& field, double level) {
    std::vector<Crossing> crossings = findCrossings(field, level);
    fitPlanes(wall, depth_mm, crossings);
    Contour contour(field);
    for (const Crossing& crossing : crossings)
        contour.add(crossing);
    return contour.mesh(crossings, wall, depth_mm);
}

}  // namespace fluorocut
