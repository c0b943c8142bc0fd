// The volume as the slab projector streams through it: int16 copies in which the rows of every orientation are
// contiguous, with the extent of what is not air in each slice.
//
// value = round(scale * (HU + 1000)) where HU > air_below_hu, else 0; scale uses the full range of int16, so the
// rounding error is at most 1/65534 of the densest voxel.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "core/image/volume.h"

namespace fluorocut {

// The volume seen along one main axis: slices of rows.
struct SlabOrientation {
    struct Extent {  // first and last row and column that hold anything; empty when row_first > row_last
        int row_first, row_last, column_first, column_last;
        bool empty() const { return row_first > row_last; }
    };

    int main_axis = 0, column_axis = 0, row_axis = 0;  // rows run along column_axis and are stacked along row_axis
    int slices = 0, rows = 0, columns = 0;
    std::ptrdiff_t row_stride = 0, slice_stride = 0;
    const std::int16_t* first = nullptr;   // voxel (0, 0, 0); a row may be read 1 before and 64 beyond its columns
    std::vector<Extent> extents;           // one per slice
    int slice_first = 0, slice_last = -1;  // slices that hold anything
};

class SlabVolume {
  public:
    SlabVolume(const Volume& hounsfield, float air_below_hu);

    const SlabOrientation& orientation(int main_axis) const {
        return orientations_[static_cast<std::size_t>(main_axis)];
    }
    // The box, in index coordinates, outside which the interpolated attenuation is zero; a point when all is air.
    std::pair<Vector3, Vector3> occupied() const;
    double huPerUnit() const { return hu_per_unit_; }

  private:
    std::shared_ptr<std::int16_t> rows_along_i_, rows_along_j_;
    std::array<SlabOrientation, 3> orientations_;
    double hu_per_unit_ = 1;
};

}  // namespace fluorocut
