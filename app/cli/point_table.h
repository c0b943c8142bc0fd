// Tables of points as other programs write them: two numbers a row, separated by comma, semicolon, tab or blanks; one
// header line at most; empty lines and lines that begin with # are skipped. Further columns are ignored.
#pragma once

#include <filesystem>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/rigid3.h"

namespace fluorocut::cli {

// invalidInput names the line.
Result<std::vector<Vector2>> readPointTable(const std::filesystem::path& path);

}  // namespace fluorocut::cli
