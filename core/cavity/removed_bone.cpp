#include "core/cavity/removed_bone.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "core/base/parallel.h"
#include "core/image/voxelize.h"

namespace fluorocut::cavity {
namespace {

constexpr double kReachMm = 2.5;     // of the part of the CT around the cavity, so that it may move within it
constexpr double kMostVoxels = 2e7;  // of the cavity's own grid

// The trilinear interpolant of `fraction` at `index`, 0 outside its voxel centres.
float sampled(const Volume& fraction, const Eigen::Vector3f& index) {
    const auto i = static_cast<int>(std::floor(index[0])), j = static_cast<int>(std::floor(index[1])),
               k = static_cast<int>(std::floor(index[2]));
    if (i < 0 || j < 0 || k < 0 || i + 1 >= fraction.size(0) || j + 1 >= fraction.size(1) || k + 1 >= fraction.size(2))
        return 0;
    const float a = index[0] - static_cast<float>(i), b = index[1] - static_cast<float>(j),
                c = index[2] - static_cast<float>(k);
    const float *r00 = fraction.row(j, k) + i, *r10 = fraction.row(j + 1, k) + i, *r01 = fraction.row(j, k + 1) + i,
                *r11 = fraction.row(j + 1, k + 1) + i;
    const auto along = [a](const float* row) { return row[0] + a * (row[1] - row[0]); };
    const float low = along(r00) + b * (along(r10) - along(r00)), high = along(r01) + b * (along(r11) - along(r01));
    return low + c * (high - low);
}

// Where a finer voxel lies between the CT's.
struct Place {
    int low, high;
    float part;
};

std::vector<Place> placesOf(int first, int count, int parts, int size) {
    std::vector<Place> places;
    for (int i = 0; i < count; ++i) {
        const double at = std::clamp(first + (i + 0.5) / parts - 0.5, 0.0, size - 1.0);
        const int low = static_cast<int>(at);
        places.push_back({low, std::min(low + 1, size - 1), static_cast<float>(at - low)});
    }
    return places;
}

// The steps i in [0, count) of a row for which first + i step lies in the grid, give or take one.
std::pair<int, int> within(const VolumeGrid& grid, const Vector3& first, const Vector3& step, int count) {
    double from = 0, to = count - 1;
    for (int axis = 0; axis < 3; ++axis) {
        const double low = -1 - first[axis], high = grid.size[static_cast<std::size_t>(axis)] - first[axis];
        if (std::abs(step[axis]) < 1e-9) {
            if (low > 0 || high < 0) return {0, 0};
            continue;
        }
        from = std::max(from, std::min(low / step[axis], high / step[axis]));
        to = std::min(to, std::max(low / step[axis], high / step[axis]));
    }
    if (!(from <= to)) return {0, 0};
    return {static_cast<int>(std::ceil(from)), static_cast<int>(std::floor(to)) + 1};
}

}  // namespace

Result<RemovedBone> RemovedBone::prepare(std::shared_ptr<const Volume> ct, const TriangleMesh& mesh,
                                         const AttenuationOptions& attenuation, int finer) {
    Vector3 low = Vector3::Constant(1e30), high = -low;
    for (const Vector3& vertex : mesh.vertices) {
        low = low.cwiseMin(vertex);
        high = high.cwiseMax(vertex);
    }
    double spacing = ct->grid().spacing_mm.minCoeff() / finer;
    spacing = std::max(spacing, std::cbrt((high - low).prod() / kMostVoxels));
    VolumeGrid grid;
    grid.spacing_mm.setConstant(spacing);
    grid.origin_mm = low - Vector3::Constant(1.5 * spacing);  // empty voxels all around
    for (int axis = 0; axis < 3; ++axis)
        grid.size[static_cast<std::size_t>(axis)] = static_cast<int>(std::ceil((high - low)[axis] / spacing)) + 4;
    Result<VoxelCoverage> coverage = voxelize(mesh, Rigid3::identity(), grid, "cavity");
    if (!coverage) return coverage.error();
    Volume fraction(grid);
    const Volume& part = coverage->fraction;
    const auto& [di, dj, dk] = coverage->offset;
    for (int k = 0; k < part.size(2); ++k)
        for (int j = 0; j < part.size(1); ++j)
            std::copy_n(part.row(j, k), part.size(0), fraction.row(j + dj, k + dk) + di);
    return RemovedBone(std::move(ct), std::move(fraction), attenuation);
}

RemovedBone::Block RemovedBone::blockAround(const Rigid3& femur_from_cavity, double reach_mm) const {
    const VolumeGrid& own = fraction_.grid();
    const VolumeGrid& grid = ct_->grid();
    Vector3 low = Vector3::Constant(1e30), high = -low;
    for (int corner = 0; corner < 8; ++corner) {
        const Vector3 at(corner & 1 ? own.size[0] - 1 : 0, corner & 2 ? own.size[1] - 1 : 0,
                         corner & 4 ? own.size[2] - 1 : 0);
        const Vector3 index = grid.indexFromPoint(femur_from_cavity * own.pointFromIndex(at));
        low = low.cwiseMin(index);
        high = high.cwiseMax(index);
    }
    Block block;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<int>(axis);
        const double reach = reach_mm / grid.spacing_mm[a], most = grid.size[axis];
        block.first[axis] = static_cast<int>(std::clamp(std::floor(low[a] - reach), 0.0, most));
        block.last[axis] = static_cast<int>(std::clamp(std::ceil(high[a] + reach) + 1, 0.0, most));
    }
    return block;
}

Result<void> RemovedBone::settle(const Rigid3& femur_from_cavity, int finer) {
    finer_ = finer;
    block_ = blockAround(femur_from_cavity, kReachMm);
    for (std::size_t axis = 0; axis < 3; ++axis) {
        if (block_.last[axis] - block_.first[axis] < 2) {
            return noSolution("cavity location", "a cavity that lies outside the CT", "a cavity in the femur of the CT",
                              "see that femur_from_cavity belongs to this CT");
        }
    }
    return {};
}

bool RemovedBone::settledFor(const Rigid3& femur_from_cavity, double reach_mm) const {
    const Block needed = blockAround(femur_from_cavity, reach_mm);
    for (std::size_t axis = 0; axis < 3; ++axis)
        if (needed.first[axis] < block_.first[axis] || needed.last[axis] > block_.last[axis]) return false;
    return true;
}

Result<Removed> RemovedBone::at(const Rigid3& femur_from_cavity) const {
    const VolumeGrid& grid = ct_->grid();
    const VolumeGrid& own = fraction_.grid();
    // Each voxel of the block in `parts` along every axis, thick slices in more of them.
    std::array<int, 3> parts{};
    VolumeGrid part = grid;
    const double target = grid.spacing_mm.minCoeff() / finer_;
    std::array<std::vector<Place>, 3> places;
    Vector3 first_index;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<int>(axis);
        parts[axis] = std::max(1, static_cast<int>(std::lround(grid.spacing_mm[a] / target)));
        part.size[axis] = (block_.last[axis] - block_.first[axis]) * parts[axis];
        part.spacing_mm[a] /= parts[axis];
        places[axis] = placesOf(block_.first[axis], part.size[axis], parts[axis], grid.size[axis]);
        first_index[a] = block_.first[axis] + 0.5 / parts[axis] - 0.5;
    }
    part.origin_mm = grid.pointFromIndex(first_index);
    auto bone = std::make_shared<Volume>(part, -1000.0f);
    auto length = std::make_shared<Volume>(part, -1000.0f);
    // Index in the cavity's grid: an affine function of the index in the part.
    const Rigid3 cavity_from_femur = femur_from_cavity.inverse();
    const Vector3 start = own.indexFromPoint(cavity_from_femur * part.origin_mm);
    const Matrix3 steps = own.spacing_mm.cwiseInverse().asDiagonal() *
                          (own.direction.transpose() * cavity_from_femur.rotationMatrix() * grid.direction) *
                          part.spacing_mm.asDiagonal();
    const Eigen::Vector3f along = steps.col(0).cast<float>();
    const auto per_mm = static_cast<float>(1000 / attenuation_.mu_water_per_mm);
    parallelFor(static_cast<std::size_t>(part.size[2]), 4, [&](std::size_t begin, std::size_t end) {
        for (auto k = static_cast<int>(begin); k < static_cast<int>(end); ++k) {
            const Place& z = places[2][static_cast<std::size_t>(k)];
            for (int j = 0; j < part.size[1]; ++j) {
                const Place& y = places[1][static_cast<std::size_t>(j)];
                const Vector3 first = start + steps * Vector3(0, j, k);
                const auto [from, to] = within(own, first, steps.col(0), part.size[0]);
                float* way = length->row(j, k);
                float* row = bone->row(j, k);
                const float* rows[4] = {ct_->row(y.low, z.low), ct_->row(y.high, z.low), ct_->row(y.low, z.high),
                                        ct_->row(y.high, z.high)};
                for (int i = from; i < to; ++i) {
                    const float fraction = sampled(fraction_, first.cast<float>() + static_cast<float>(i) * along);
                    if (fraction <= 0) continue;
                    const Place& x = places[0][static_cast<std::size_t>(i)];
                    // mu is linear in HU + 1000, and nothing below air.
                    const auto mu = [&](const float* hu) {
                        const float low = std::max(0.0f, hu[x.low] + 1000), high = std::max(0.0f, hu[x.high] + 1000);
                        return low + x.part * (high - low);
                    };
                    const float near = mu(rows[0]) + y.part * (mu(rows[1]) - mu(rows[0])),
                                far = mu(rows[2]) + y.part * (mu(rows[3]) - mu(rows[2]));
                    row[i] = fraction * (near + z.part * (far - near)) - 1000;
                    way[i] = fraction * per_mm - 1000;
                }
            }
        }
    });
    // A trace in two opposite corners: the projector lays its grid around what is not air, which then is the part as a
    // whole, wherever the cavity lies in it.
    const auto mark = [&](Volume& volume) {
        const float trace = 1e-4f * (*std::max_element(volume.voxels().begin(), volume.voxels().end()) + 1000);
        volume.voxels().front() = std::max(volume.voxels().front(), trace - 1000);
        volume.voxels().back() = std::max(volume.voxels().back(), trace - 1000);
    };
    mark(*bone);
    mark(*length);
    Result<VolumeProjector> of_bone = VolumeProjector::prepare(bone, attenuation_);
    if (!of_bone) return of_bone.error();
    Result<VolumeProjector> of_length = VolumeProjector::prepare(length, attenuation_);
    if (!of_length) return of_length.error();
    return Removed{std::move(*of_bone), std::move(*of_length)};
}

}  // namespace fluorocut::cavity
