// Pose files, fluorocut/pose/1:
//     {"schema": "fluorocut/pose/1", "target": "imager", "source": "femur", "matrix": [[...], [...], [...], [0, 0, 0,
//     1]],
//      "covariance": [[... 6] ... 6]}
// Matrix: 4x4, row major, p_target = M p_source, mm. Covariance (optional, null when unknown): 6x6, (tx ty tz) mm and
// (rx ry rz) rad in the target frame, as core/geometry/pose.h has it; symmetric and positive semi-definite.
#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

#include "core/base/result.h"
#include "core/geometry/pose.h"
#include "core/io/json_file.h"

namespace fluorocut {

Result<Pose> readPose(const std::filesystem::path& path);

// The same, and refuses a pose between other frames than the two expected.
Result<Pose> readPose(const std::filesystem::path& path, Frame target, Frame source);

// The field of that name of a file, absent or null: nothing.
std::optional<Matrix6> readCovariance(JsonObject& file, std::string_view field);

Result<void> writePose(const std::filesystem::path& path, const Pose& pose);

}  // namespace fluorocut
