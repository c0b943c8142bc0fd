// Volumes: a regular grid of voxels, index (i, j, k) with i fastest, voxel centres at integer indices.
// `grid` places it in its frame (for a CT: femur, DICOM LPS, mm):
//     point = origin + direction * diag(spacing) * index
// `direction` has orthonormal columns (the axes i, j, k as seen in the frame) and may be left-handed, as DICOM and
// NIfTI allow. A CT holds Hounsfield units.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <utility>
#include <vector>

#include "core/geometry/rigid3.h"

namespace fluorocut {

struct VolumeGrid {
    std::array<int, 3> size{0, 0, 0};
    Vector3 spacing_mm = Vector3::Ones();
    Vector3 origin_mm = Vector3::Zero();  // centre of voxel (0, 0, 0)
    Matrix3 direction = Matrix3::Identity();

    std::size_t voxelCount() const {
        return static_cast<std::size_t>(size[0]) * static_cast<std::size_t>(size[1]) *
               static_cast<std::size_t>(size[2]);
    }
    Vector3 pointFromIndex(const Vector3& index) const {
        return origin_mm + direction * spacing_mm.cwiseProduct(index);
    }
    Vector3 indexFromPoint(const Vector3& point) const {
        return (direction.transpose() * (point - origin_mm)).cwiseQuotient(spacing_mm);
    }
    Vector3 center() const { return pointFromIndex(0.5 * Vector3(size[0] - 1, size[1] - 1, size[2] - 1)); }

    friend bool operator==(const VolumeGrid&, const VolumeGrid&) = default;
};

template <class T>
class BasicVolume {
  public:
    BasicVolume() = default;
    explicit BasicVolume(const VolumeGrid& grid, T fill = T{}) : grid_(grid), voxels_(grid.voxelCount(), fill) {}
    BasicVolume(const VolumeGrid& grid, std::vector<T> voxels) : grid_(grid), voxels_(std::move(voxels)) {
        if (voxels_.size() != grid.voxelCount()) {
            throw std::logic_error("BasicVolume: size does not match the number of voxels");
        }
    }

    const VolumeGrid& grid() const { return grid_; }
    int size(int axis) const { return grid_.size[static_cast<std::size_t>(axis)]; }
    bool empty() const { return voxels_.empty(); }

    T& operator()(int i, int j, int k) { return voxels_[index(i, j, k)]; }
    const T& operator()(int i, int j, int k) const { return voxels_[index(i, j, k)]; }
    T* row(int j, int k) { return voxels_.data() + index(0, j, k); }
    const T* row(int j, int k) const { return voxels_.data() + index(0, j, k); }
    std::vector<T>& voxels() { return voxels_; }
    const std::vector<T>& voxels() const { return voxels_; }

  private:
    std::size_t index(int i, int j, int k) const {
        return (static_cast<std::size_t>(k) * static_cast<std::size_t>(grid_.size[1]) + static_cast<std::size_t>(j)) *
                   static_cast<std::size_t>(grid_.size[0]) +
               static_cast<std::size_t>(i);
    }

    VolumeGrid grid_;
    std::vector<T> voxels_;
};

using Volume = BasicVolume<float>;

// The value at a real-valued index by trilinear interpolation; `outside` beyond the outermost voxel centres.
float sampleLinear(const Volume& volume, const Vector3& index, float outside);

}  // namespace fluorocut
