// A CT for commands: read from a file or a DICOM folder, or one of the built-in patients by name.
#pragma once

#include <memory>
#include <string>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/image/volume.h"

namespace fluorocut::cli {

inline constexpr const char* kBuiltInFemur = "femur";
inline constexpr const char* kBuiltInAcrylic = "acrylic";

// "femur" and "acrylic" are generated with their default options, unless a file of that name exists.
Result<std::shared_ptr<const Volume>> loadCt(const std::string& name, Progress& progress);

}  // namespace fluorocut::cli
