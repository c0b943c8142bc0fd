// Tool paths as files, `fluorocut/tool-path/1` (JSON; mm, s, frame `cavity`):
//
//     {"schema": "fluorocut/tool-path/1", "frame": "cavity", "cutter": {"radius_mm": 3, "length_mm": 150},
//      "most_cusp_mm": 0.05, "layers": 119, "cutting_mm": 6791.2, "time_s": 530.1, "unreached": 0, "warnings": [],
//      "moves": [{"motion": "entry", "from_mm": [0, 0, 8], "to_mm": [0, 0, 2.2], "spindle": [0, 0, 1], "feed_mm_s":
//      20}]}
//
// Every move says where it begins, so that a lost line shows. A file is a proposal like any path: what is read from one
// goes through checkToolPath before a robot sees it. Numbers come back bit for bit.
#pragma once

#include <filesystem>

#include "core/base/result.h"
#include "core/cutting/tool_path.h"

namespace fluorocut {

Result<void> writeToolPath(const std::filesystem::path& file, const ToolPath& path);

// Refuses a file whose moves have spindles that are no unit vectors, feeds that are not positive, or that has a length
// or a time other than those of its moves.
Result<ToolPath> readToolPath(const std::filesystem::path& file);

}  // namespace fluorocut
