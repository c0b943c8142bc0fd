// Walls of the femur drawn in one image, fluorocut/contours/1:
//     {"schema": "fluorocut/contours/1",
//      "walls": [{"side": "medial", "surface": "canal", "u_px": [...], "v_px": [...]}, ...]}
// `side`: medial, lateral, anterior or posterior; `surface`: canal or outer. Points run from proximal to distal, pixel
// centres at integers. Templating takes both canal walls of a view.
#pragma once

#include <filesystem>
#include <vector>

#include "core/base/result.h"
#include "core/planning/templating.h"

namespace fluorocut {

Result<std::vector<DrawnWall>> readContours(const std::filesystem::path& path);

}  // namespace fluorocut
