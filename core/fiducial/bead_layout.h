// BeadLayout: spheres of known size at known places: a calibration phantom, beads in a bone. Files: fluorocut/beads/1
//     {"schema": "fluorocut/beads/1", "frame": "phantom",
//      "beads": [{"name": "b1", "center_mm": [x, y, z], "diameter_mm": 2.0}]}
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/frames.h"
#include "core/geometry/rigid3.h"

namespace fluorocut {

struct Bead {
    std::string name;
    Vector3 center_mm = Vector3::Zero();
    double diameter_mm = 2;
};

struct BeadLayout {
    Frame frame = Frame::phantom;
    std::vector<Bead> beads;

    // Names the field, the value and the limit: at least one bead, unique names, no two beads in one place.
    Result<void> validate() const;
};

Result<BeadLayout> readBeadLayout(const std::filesystem::path& path);
Result<void> writeBeadLayout(const std::filesystem::path& path, const BeadLayout& layout);

}  // namespace fluorocut
