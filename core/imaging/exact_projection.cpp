#include "core/imaging/exact_projection.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/parallel.h"

namespace fluorocut {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Visits, in order, the unit cells (times `size`) that the segment origin + t * direction, t in [t0, t1], crosses.
// visit(cell, t_in, t_out); cells are clamped to [low, high] so that rounding at a face cannot leave the range.
template <class Visit>
void traverse(const Vector3& origin, const Vector3& direction, double t0, double t1, int size,
              const std::array<int, 3>& low, const std::array<int, 3>& high, const Visit& visit) {
    std::array<int, 3> cell;
    std::array<int, 3> step;
    std::array<double, 3> next, delta;
    const double middle = t0 + 1e-9 * (t1 - t0);  // just inside, so that a start on a face falls into the right cell
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<Eigen::Index>(axis);
        const double position = (origin[a] + middle * direction[a]) / size;
        cell[axis] = std::clamp(static_cast<int>(std::floor(position)), low[axis], high[axis]);
        if (direction[a] > 0) {
            step[axis] = 1;
            delta[axis] = size / direction[a];
            next[axis] = ((cell[axis] + 1) * static_cast<double>(size) - origin[a]) / direction[a];
        } else if (direction[a] < 0) {
            step[axis] = -1;
            delta[axis] = -size / direction[a];
            next[axis] = (cell[axis] * static_cast<double>(size) - origin[a]) / direction[a];
        } else {
            step[axis] = 0;
            delta[axis] = kInfinity;
            next[axis] = kInfinity;
        }
    }
    double t = t0;
    while (t < t1) {
        std::size_t axis = next[0] < next[1] ? 0 : 1;
        if (next[2] < next[axis]) axis = 2;
        const double t_out = std::min(next[axis], t1);
        if (t_out > t) visit(cell, t, t_out);
        t = std::max(t, t_out);
        if (next[axis] >= t1) break;
        cell[axis] += step[axis];
        if (cell[axis] < low[axis] || cell[axis] > high[axis]) break;
        next[axis] += delta[axis];
    }
}

class RayIntegral {
  public:
    RayIntegral(const Volume& hounsfield, const OccupiedBlocks& blocks, float air_below_hu)
        : volume_(hounsfield), blocks_(blocks), air_(air_below_hu) {}

    // The integral over t in [0, 1] of the interpolant of (HU + 1000) at origin + t * direction, in cell coordinates
    // (index + 1, so that cell 0 begins at index -1).
    double operator()(const Vector3& origin, const Vector3& direction) const {
        double t0 = 0, t1 = 1;
        for (int axis = 0; axis < 3; ++axis) {
            const double end = volume_.size(axis) + 1;
            if (direction[axis] == 0) {
                if (!(origin[axis] >= 0 && origin[axis] <= end)) return 0;
                continue;
            }
            const double at_low = -origin[axis] / direction[axis];
            const double at_high = (end - origin[axis]) / direction[axis];
            t0 = std::max(t0, std::min(at_low, at_high));
            t1 = std::min(t1, std::max(at_low, at_high));
        }
        if (!(t0 < t1)) return 0;

        const std::array<int, 3> count = blocks_.count();
        double sum = 0;
        traverse(
            origin, direction, t0, t1, OccupiedBlocks::kCells, {0, 0, 0}, {count[0] - 1, count[1] - 1, count[2] - 1},
            [&](const std::array<int, 3>& block, double block_in, double block_out) {
                if (!blocks_.occupied(block[0], block[1], block[2])) return;
                std::array<int, 3> low, high;
                for (std::size_t axis = 0; axis < 3; ++axis) {
                    low[axis] = block[axis] * OccupiedBlocks::kCells;
                    high[axis] = std::min(low[axis] + OccupiedBlocks::kCells - 1, volume_.size(static_cast<int>(axis)));
                }
                traverse(origin, direction, block_in, block_out, 1, low, high,
                         [&](const std::array<int, 3>& cell, double t_in, double t_out) {
                             sum += cellIntegral(cell, origin, direction, t_in, t_out);
                         });
            });
        return sum;
    }

  private:
    float value(int i, int j, int k) const {
        if (i < 0 || j < 0 || k < 0 || i >= volume_.size(0) || j >= volume_.size(1) || k >= volume_.size(2)) return 0;
        const float hu = volume_(i, j, k);
        return hu > air_ ? hu + 1000 : 0;
    }

    double cellIntegral(const std::array<int, 3>& cell, const Vector3& origin, const Vector3& direction, double t_in,
                        double t_out) const {
        const int i = cell[0] - 1, j = cell[1] - 1, k = cell[2] - 1;
        double v[8];
        double any = 0;
        for (int corner = 0; corner < 8; ++corner) {
            v[corner] = value(i + (corner & 1), j + ((corner >> 1) & 1), k + (corner >> 2));
            any += v[corner];
        }
        if (any == 0) return 0;
        const double half = 0.5 * (t_out - t_in), middle = 0.5 * (t_out + t_in);
        double sum = 0;
        for (const double node : {-0.57735026918962576, 0.57735026918962576}) {
            const double t = middle + node * half;
            const double x = origin[0] + t * direction[0] - cell[0];
            const double y = origin[1] + t * direction[1] - cell[1];
            const double z = origin[2] + t * direction[2] - cell[2];
            const double v00 = v[0] + x * (v[1] - v[0]), v10 = v[2] + x * (v[3] - v[2]);
            const double v01 = v[4] + x * (v[5] - v[4]), v11 = v[6] + x * (v[7] - v[6]);
            const double v0 = v00 + y * (v10 - v00), v1 = v01 + y * (v11 - v01);
            sum += v0 + z * (v1 - v0);
        }
        return sum * half;
    }

    const Volume& volume_;
    const OccupiedBlocks& blocks_;
    float air_;
};

}  // namespace

OccupiedBlocks::OccupiedBlocks(const Volume& hounsfield, float air_below_hu) {
    for (int axis = 0; axis < 3; ++axis) {
        count_[static_cast<std::size_t>(axis)] = hounsfield.size(axis) / kCells + 1;  // cells 0 .. size
    }
    occupied_.assign(
        static_cast<std::size_t>(count_[0]) * static_cast<std::size_t>(count_[1]) * static_cast<std::size_t>(count_[2]),
        0);
    // Block b has the cells 8b .. 8b + 7 and so the voxels 8b - 1 .. 8b + 7.
    parallelFor(static_cast<std::size_t>(count_[2]), 1, [&](std::size_t begin, std::size_t end) {
        for (int bk = static_cast<int>(begin); bk < static_cast<int>(end); ++bk) {
            const int k_end = std::min(kCells * (bk + 1), hounsfield.size(2));
            for (int k = std::max(kCells * bk - 1, 0); k < k_end; ++k) {
                for (int j = 0; j < hounsfield.size(1); ++j) {
                    const float* row = hounsfield.row(j, k);
                    for (int i = 0; i < hounsfield.size(0); ++i) {
                        if (!(row[i] > air_below_hu)) continue;
                        // A voxel that is the last of one block is also the first of the next.
                        for (int bj = j / kCells; bj <= (j + 1) / kCells; ++bj) {
                            for (int bi = i / kCells; bi <= (i + 1) / kCells; ++bi) {
                                occupied_[(static_cast<std::size_t>(bk) * static_cast<std::size_t>(count_[1]) +
                                           static_cast<std::size_t>(bj)) *
                                              static_cast<std::size_t>(count_[0]) +
                                          static_cast<std::size_t>(bi)] = 1;
                            }
                        }
                    }
                }
            }
        }
    });
}

Image projectExactly(const Volume& hounsfield, const OccupiedBlocks& blocks, float air_below_hu, double scale_per_hu,
                     const ProjectionGeometry& geometry) {
    Image image(geometry.columns, geometry.rows);
    const RayIntegral integral(hounsfield, blocks, air_below_hu);
    const Vector3 origin = geometry.source + Vector3::Ones();
    parallelFor(static_cast<std::size_t>(geometry.rows), 4, [&](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            for (int x = 0; x < geometry.columns; ++x) {
                const Eigen::Vector2f ideal = geometry.idealPixel(x, y);
                const Vector3 ray = geometry.detectorPoint(ideal.x(), ideal.y()) - geometry.source;
                const double length_mm = ray.cwiseProduct(geometry.spacing_mm).norm();
                image(x, y) = static_cast<float>(scale_per_hu * length_mm * integral(origin, ray));
            }
        }
    });
    return image;
}

}  // namespace fluorocut
