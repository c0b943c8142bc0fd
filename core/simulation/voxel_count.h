// How large the generated patients may be.
#pragma once

#include <fmt/format.h>

#include "core/base/result.h"

namespace fluorocut {

// The largest volume that is generated: 1 GB of float voxels.
inline constexpr double kMaxPhantomVoxels = 2.5e8;

inline Result<void> requireVoxelCount(double count) {
    if (count <= kMaxPhantomVoxels) return {};
    return invalidOption("voxel_mm", fmt::format("{:.3g} voxels", count),
                         fmt::format("at most {:.3g} voxels in the whole volume", kMaxPhantomVoxels),
                         "choose larger voxels or a smaller object");
}

}  // namespace fluorocut
