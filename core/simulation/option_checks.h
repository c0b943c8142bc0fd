// One-line checks for the options of the generated patients: the sentence names the field, the value and the limits.
#pragma once

#include <string>

#include <fmt/format.h>

#include "core/base/result.h"

namespace fluorocut {

// Written so that NaN fails.
inline Result<void> requireRange(const char* field, double value, double low, double high, const char* unit) {
    if (value >= low && value <= high) return {};
    return invalidOption(field, fmt::format("{}", value),
                         fmt::format("{} to {}{}{}", low, high, *unit ? " " : "", unit));
}

// The largest volume that is generated: 2 GB of float voxels.
inline constexpr double kMaxPhantomVoxels = 5e8;

inline Result<void> requireVoxelCount(double count) {
    if (count <= kMaxPhantomVoxels) return {};
    return invalidOption("voxel_mm", fmt::format("{:.3g} voxels", count),
                         fmt::format("at most {:.3g} voxels in the whole volume", kMaxPhantomVoxels),
                         "choose larger voxels or a smaller object");
}

}  // namespace fluorocut
