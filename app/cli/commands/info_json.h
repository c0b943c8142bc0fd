// What a JSON file of FluoroCut holds, by its schema.
#pragma once

#include <filesystem>

#include "app/cli/report.h"
#include "core/base/result.h"

namespace fluorocut::cli {

Result<Report> infoOfJson(const std::filesystem::path& file);

}  // namespace fluorocut::cli
