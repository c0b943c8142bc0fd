// Images of one corkscrew: its pose in each, and what they say together (for calibrate robot and coregister).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "app/cli/pictures.h"
#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/fiducial/corkscrew_pose.h"
#include "core/io/image_file.h"
#include "core/registration/shared_prior.h"

namespace fluorocut::cli {

struct CorkscrewImage {
    std::filesystem::path image;
    std::filesystem::path carm;
    int frame = 1;
};

struct CorkscrewView {
    Image image;
    ImageInfo info;
    CArm carm;
    CorkscrewPose pose;
    PoseEvidence evidence;   // with all of this image's own errors: photons, and what the distortion map leaves
    Matrix6 own_covariance;  // of the pose, of the same errors
};

// Errors name the image, also one that is the same as one before.
Result<CorkscrewView> viewOf(const CorkscrewImage& image, const CorkscrewLayout& layout,
                             const CalibrationUncertainty& calibration, Pictures& before, Progress& progress);
// Options that commands of such images share.
struct RobotNoise {
    double place_mm = 0, rotation_deg = 0;
};
void declareRobotNoise(CLI::App& app, RobotNoise& robot, const std::string& where = "");
void declareDistortion(CLI::App& app, double& distortion_mm);
void declareDimensions(CLI::App& app, double& dimensions_mm);
// Acceptance limits: standard deviations of these.
void declareLimits(CLI::App& app, double& most_place_mm, const std::string& place, double& most_rotation_deg,
                   const std::string& rotation);

// A corkscrew's file, or the name of one that comes with FluoroCut.
Result<CorkscrewLayout> layoutOf(const std::string& corkscrew);

// The image asked again: at other values of the C-arm's and the corkscrew's parameters.
Result<PoseEvidence> askAgain(const CorkscrewView& view, const CorkscrewLayout& layout, const Rigid3& pose,
                              const Eigen::VectorXd& parameters);

// What is known of the parameters beforehand; `focal_change`: standard deviation of the focal length (relative) from
// position to position of the C-arm.
SharedPrior priorOf(const CorkscrewLayout& layout, const CArm& carm, const CalibrationUncertainty& calibration,
                    double focal_change);

}  // namespace fluorocut::cli
