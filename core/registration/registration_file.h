// The measurements of a registration chain as a file, fluorocut/registration/1, for those who measure poses by other
// means:
//     {"schema": "fluorocut/registration/1",
//      "flange_from_corkscrew": {"matrix": [[...], [...], [...], [0, 0, 0, 1]], "covariance": [[... 6] ... 6]},
//      "calibration": {"focal_length": 0.001, "principal_point_mm": 0.3, "focal_length_mm": 1000},
//      "views": [
//        {"name": "ap", "time": "2026-03-01T09:30:00Z", "imager": "C-arm",
//         "robot_from_flange": {"file": "robot_ap.json"},
//         "imager_from_corkscrew": {"matrix": [...], "covariance": [...]},
//         "imager_from_femur": {"file": "femur_ap.json"}}],
//      "points": [{"name": "stem's tip", "in_femur_mm": [0, 0, -120]}]}
//
// A pose is a matrix (4x4, row major, mm) with a covariance (6x6, (tx ty tz) mm and (rx ry rz) rad in the target frame)
// or the path of a fluorocut/pose/1 file, relative to this one. Without covariance robot and hand-eye pose are exact;
// the imager's poses need one.
//
// `calibration` (optional): standard deviations of the relative focal length and of the image centre at the detector
// that all views of one `imager` (optional, one for all by default) share; then the covariances of the imager's poses
// must not hold them. Their effect is taken to first order from the pose: a focal length that is too long by 1 % puts
// an object of known size 1 % too deep; an image centre that is off by 1 mm at the detector, off by depth / focal
// length.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/registration/chain.h"

namespace fluorocut {

struct RegistrationFile {
    ChainProblem problem;
    std::vector<std::string> times;  // of the views; empty: not told
    std::vector<NamedPoint> points;
    std::vector<std::filesystem::path> inputs;  // every file that it names
};

Result<RegistrationFile> readRegistration(const std::filesystem::path& path);

}  // namespace fluorocut
