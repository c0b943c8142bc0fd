// What is wrong with a path's numbers, whatever the envelope: asked by both checks before any geometry.
#pragma once

#include <string>

#include "core/cutting/tool_path.h"
#include "core/geometry/triangle_mesh.h"

namespace fluorocut {

// Of one move, in words; empty: nothing. `open_mm`: z of the envelope's open end.
std::string moveFlaw(const ToolPath& path, std::size_t move, double open_mm);

}  // namespace fluorocut
