// An implant for commands: one of the library by name, a file of fluorocut/implant/1, or a mesh whose unit, axis and
// reference point are guessed, which is said.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/planning/implant.h"

namespace CLI {
class App;
}

namespace fluorocut::cli {

struct ImplantWish {
    std::string name;
    std::string size;  // empty: the middle one
    std::string side;  // empty: left, or the mesh's own
    double head_mm = 32;
    double neck_mm = 0;
    int triangles = 12000;
};

// --size, --side, --head, --neck, --triangles.
void declareChoice(CLI::App& app, ImplantWish& wish);

struct ChosenImplant {
    Implant implant;
    std::vector<std::string> remarks;  // what was guessed
};
Result<ChosenImplant> implantOf(const ImplantWish& wish);

std::optional<Side> sideOf(const std::string& text);

}  // namespace fluorocut::cli
