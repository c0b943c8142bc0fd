#include "core/image/bone_surface.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/base/option_checks.h"
#include "core/base/parallel.h"
#include "core/image/isosurface.h"

namespace fluorocut {
namespace {

constexpr float kNothing = -1000;  // a voxel that is not finite
constexpr float kSmoothedReach =
    200;  // about the level: as far as soft tissue is from it, so that both sides weigh alike
constexpr float kFilledAbove = 500;  // the level, where the bone's inside is filled

std::array<int, 3> averagingFactors(const VolumeGrid& grid, const BoneSurfaceOptions& options) {
    for (double voxel_mm = options.voxel_mm;; voxel_mm *= 1.1) {
        std::array<int, 3> factors{};
        double voxels = 1;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const double wanted = std::round(voxel_mm / grid.spacing_mm[static_cast<Eigen::Index>(axis)]);
            factors[axis] = static_cast<int>(std::clamp(wanted, 1.0, std::max(1.0, grid.size[axis] / 2.0)));
            voxels *= std::max(1, grid.size[axis] / factors[axis]);
        }
        const bool at_the_end = voxel_mm > 1e3;
        if (voxels <= options.most_voxels || at_the_end) return factors;
    }
}

// Means of blocks; what is left over at the far ends is dropped.

Volume averaged(const Volume& ct, const std::array<int, 3>& factors) {
    VolumeGrid grid = ct.grid();
    Vector3 first_middle;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<Eigen::Index>(axis);
        grid.size[axis] = std::max(1, grid.size[axis] / factors[axis]);
        grid.spacing_mm[a] *= factors[axis];
        first_middle[a] = 0.5 * (factors[axis] - 1);
    }
    grid.origin_mm = ct.grid().pointFromIndex(first_middle);
    Volume result(grid);
    const float weight = 1.0F / static_cast<float>(factors[0] * factors[1] * factors[2]);
    parallelFor(static_cast<std::size_t>(grid.size[2]), 1, [&](std::size_t begin, std::size_t end) {
        for (int k = static_cast<int>(begin); k < static_cast<int>(end); ++k)
            for (int j = 0; j < grid.size[1]; ++j) {
                float* to = result.row(j, k);
                for (int c = 0; c < factors[2]; ++c)
                    for (int b = 0; b < factors[1]; ++b) {
                        const float* from = ct.row(j * factors[1] + b, k * factors[2] + c);
                        for (int i = 0; i < grid.size[0]; ++i)
                            for (int a = 0; a < factors[0]; ++a) {
                                const float value = from[i * factors[0] + a];
                                to[i] += weight * (std::isfinite(value) ? value : kNothing);
                            }
                    }
            }
    });
    return result;
}

// A plane of the grid across `axis`, as a picture of pixels in the volume.
class Section {
  public:
    Section(Volume& volume, int axis, int level)
        : volume_(volume), u_(axis == 0 ? 1 : 0), v_(axis == 2 ? 1 : 2), axis_(axis), level_(level) {}

    int width() const { return volume_.size(u_); }
    int height() const { return volume_.size(v_); }
    float& at(int x, int y) const {
        std::array<int, 3> index{};
        index[static_cast<std::size_t>(u_)] = x;
        index[static_cast<std::size_t>(v_)] = y;
        index[static_cast<std::size_t>(axis_)] = level_;
        return volume_(index[0], index[1], index[2]);
    }

  private:
    Volume& volume_;
    int u_, v_, axis_, level_;
};

// What the border cannot reach is raised above the level.
void fillHoles(const Section& section, float level) {
    const int width = section.width(), height = section.height();
    const auto pixel = [&](int x, int y) {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
    };
    std::vector<char> reached(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
    std::vector<std::array<int, 2>> front;
    const auto reach = [&](int x, int y) {
        if (x < 0 || y < 0 || x >= width || y >= height || reached[pixel(x, y)] || section.at(x, y) >= level) return;
        reached[pixel(x, y)] = 1;
        front.push_back({x, y});
    };
    for (int x = 0; x < width; ++x) {
        reach(x, 0);
        reach(x, height - 1);
    }
    for (int y = 0; y < height; ++y) {
        reach(0, y);
        reach(width - 1, y);
    }
    while (!front.empty()) {
        const auto [x, y] = front.back();
        front.pop_back();
        reach(x - 1, y);
        reach(x + 1, y);
        reach(x, y - 1);
        reach(x, y + 1);
    }
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            float& value = section.at(x, y);
            if (!reached[pixel(x, y)] && value < level) value = level + kFilledAbove;
        }
}

// Values held within `reach` of the level, then the mean of each with its neighbours (1 2 1) along every axis: slices
// that were filled and slices that were not leave no steps, and the surface stays where it is.
void smooth(Volume& volume, float level, float reach) {
    for (float& value : volume.voxels())
        value = std::clamp(value, level - reach, level + reach);
    std::vector<float> line;
    for (int axis = 0; axis < 3; ++axis) {
        const int u = axis == 0 ? 1 : 0, n = volume.size(axis);
        for (int k = 0; k < (axis == 2 ? 1 : volume.size(2)); ++k)
            for (int j = 0; j < (axis == 1 ? volume.size(u) : volume.size(1)); ++j)
                for (int i = 0; i < (axis == 2 ? volume.size(0) : 1); ++i) {
                    const auto at = [&](int t) -> float& {
                        return axis == 0 ? volume(t, j, k) : axis == 1 ? volume(j, t, k) : volume(i, j, t);
                    };
                    line.resize(static_cast<std::size_t>(n));
                    for (int t = 0; t < n; ++t)
                        line[static_cast<std::size_t>(t)] = at(t);
                    for (int t = 0; t < n; ++t) {
                        const auto of = [&](int place) {
                            return line[static_cast<std::size_t>(std::clamp(place, 0, n - 1))];
                        };
                        at(t) = 0.25F * (of(t - 1) + 2 * of(t) + of(t + 1));
                    }
                }
    }
}

// Without the connected parts of fewer than `least_share` of the largest part's triangles, and without their vertices.
TriangleMesh largeParts(const TriangleMesh& mesh, double least_share) {
    std::vector<std::int32_t> parent(mesh.vertices.size());
    std::iota(parent.begin(), parent.end(), 0);
    const auto root = [&](std::int32_t vertex) {
        while (parent[static_cast<std::size_t>(vertex)] != vertex) {
            auto& above = parent[static_cast<std::size_t>(vertex)];
            above = parent[static_cast<std::size_t>(above)];
            vertex = above;
        }
        return vertex;
    };
    for (const Triangle& triangle : mesh.triangles) {
        parent[static_cast<std::size_t>(root(triangle[1]))] = root(triangle[0]);
        parent[static_cast<std::size_t>(root(triangle[2]))] = root(triangle[0]);
    }
    std::vector<std::size_t> triangles_of(mesh.vertices.size(), 0);
    for (const Triangle& triangle : mesh.triangles)
        ++triangles_of[static_cast<std::size_t>(root(triangle[0]))];
    const auto largest = std::max_element(triangles_of.begin(), triangles_of.end());
    if (largest == triangles_of.end()) return {};
    const double least = least_share * static_cast<double>(*largest);

    TriangleMesh kept;
    std::vector<std::int32_t> number(mesh.vertices.size(), -1);
    for (Triangle triangle : mesh.triangles) {
        if (static_cast<double>(triangles_of[static_cast<std::size_t>(root(triangle[0]))]) < least) continue;
        for (std::int32_t& vertex : triangle) {
            std::int32_t& now = number[static_cast<std::size_t>(vertex)];
            if (now < 0) {
                now = static_cast<std::int32_t>(kept.vertices.size());
                kept.vertices.push_back(mesh.vertices[static_cast<std::size_t>(vertex)]);
            }
            vertex = now;
        }
        kept.triangles.push_back(triangle);
    }
    return kept;
}

}  // namespace

Result<void> BoneSurfaceOptions::validate() const {
    return requireRanges({{"level_hu", level_hu, -500, 3000, "HU"},
                          {"voxel_mm", voxel_mm, 0.1, 10, "mm"},
                          {"least_share", least_share, 0, 1, ""},
                          {"most_voxels", static_cast<double>(most_voxels), 1000, 1e9, ""}});
}

Result<TriangleMesh> boneSurface(const Volume& ct, const BoneSurfaceOptions& options, Progress& progress) {
    if (auto ok = options.validate(); !ok) return ok.error();
    if (ct.empty()) return TriangleMesh{};
    progress.report(0, "the bone's surface");
    Volume bone = averaged(ct, averagingFactors(ct.grid(), options));
    progress.report(0.3, "the bone's surface");
    if (progress.isCancelled()) return cancelled("the bone's surface");

    Eigen::Index axial = 2;
    bone.grid().direction.row(2).cwiseAbs().maxCoeff(&axial);
    const auto level = static_cast<float>(options.level_hu);
    parallelFor(static_cast<std::size_t>(bone.size(static_cast<int>(axial))), 1,
                [&](std::size_t begin, std::size_t end) {
                    for (std::size_t k = begin; k < end; ++k)
                        fillHoles(Section(bone, static_cast<int>(axial), static_cast<int>(k)), level);
                });
    progress.report(0.5, "the bone's surface");
    if (progress.isCancelled()) return cancelled("the bone's surface");

    smooth(bone, level, kSmoothedReach);
    // Inside is where values are low: turned over, that is the bone.
    for (float& value : bone.voxels())
        value = -value;
    const TriangleMesh surface = isosurface(bone, -options.level_hu);
    progress.report(0.9, "the bone's surface");
    if (progress.isCancelled()) return cancelled("the bone's surface");
    return largeParts(surface, options.least_share);
}

}  // namespace fluorocut
