// The observations of a robot-corkscrew calibration, fluorocut/hand-eye/1:
//     {"schema": "fluorocut/hand-eye/1", "carm": "carm.json", "corkscrew": "corkscrew.json",
//      "observations": [
//        {"name": "image 1", "imager": "ap", "robot_from_flange": [[...], [...], [...], [0, 0, 0, 1]],
//         "imager_from_corkscrew": [[...], [...], [...], [0, 0, 0, 1]], "covariance": [[... 6] ... 6]},
//        {"robot_from_flange_file": "robot2.json", "imager_from_corkscrew_file": "pose2.json"},
//        {"robot_from_flange_file": "robot3.json", "image": "image3.png", "imager": "lateral", "carm":
//        "lateral.json"}]}
//
// Each observation has one of robot_from_flange (4x4, row major, mm) and robot_from_flange_file (fluorocut/pose/1), and
// one of imager_from_corkscrew, imager_from_corkscrew_file and image. `covariance` (optional) goes with
// imager_from_corkscrew; a pose's file has its own. `imager` names the C-arm's position, "imager" by default: it did
// not move between observations of one name. `name` is "observation N" by default, or the image's path. Paths are
// relative to the file. `carm` and `corkscrew` are needed for images only; `carm` may be given for one observation.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/registration/hand_eye.h"

namespace fluorocut {

struct HandEyeEntry {
    HandEyeObservation observation;  // without its pose when there is an image
    std::filesystem::path image;     // empty: none
    std::filesystem::path carm;      // of the image
};

struct HandEyeFile {
    std::filesystem::path corkscrew;  // empty: none
    std::vector<HandEyeEntry> entries;
    std::vector<std::filesystem::path> inputs;  // every file that it names
};

// Pose files are read, images are not.
Result<HandEyeFile> readHandEyeFile(const std::filesystem::path& path);

}  // namespace fluorocut
