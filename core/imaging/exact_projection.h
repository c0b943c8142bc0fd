// The exact line integral through a volume, ray by ray: the reference of volume_projector.h.
//
// The trilinear interpolant of mu, padded with air, is a cubic polynomial of the ray's parameter inside each cell of
// eight neighbouring voxel centres, so two Gauss-Legendre points integrate it exactly. Cells are visited in order
// (Amanatides and Woo 1987) inside blocks of 8 x 8 x 8 cells; empty blocks are stepped over whole.
#pragma once

#include <cstdint>
#include <vector>

#include "core/image/image.h"
#include "core/image/volume.h"
#include "core/imaging/projection_geometry.h"

namespace fluorocut {

// Which blocks of 8^3 cells hold anything. Cell c of an axis has the voxels c - 1 and c as its corners, c in [0, size].
class OccupiedBlocks {
  public:
    static constexpr int kCells = 8;

    OccupiedBlocks(const Volume& hounsfield, float air_below_hu);

    std::array<int, 3> count() const { return count_; }
    bool occupied(int bi, int bj, int bk) const {
        return occupied_[(static_cast<std::size_t>(bk) * static_cast<std::size_t>(count_[1]) +
                          static_cast<std::size_t>(bj)) *
                             static_cast<std::size_t>(count_[0]) +
                         static_cast<std::size_t>(bi)] != 0;
    }

  private:
    std::array<int, 3> count_;
    std::vector<std::uint8_t> occupied_;
};

// mu = scale_per_hu * (HU + 1000) where HU > air_below_hu, else 0.
Image projectExactly(const Volume& hounsfield, const OccupiedBlocks& blocks, float air_below_hu, double scale_per_hu,
                     const ProjectionGeometry& geometry);

}  // namespace fluorocut
