// From images that show corkscrew and beads together to the measurements of a registration chain
// (core/registration/chain.h): both poses in every image, each with the errors that are its own, and what it shares
// with the others: focal length, image centre, dimensions of the corkscrew, places of the beads.
//
// Failures name the image. noSolution: no corkscrew, or not the femur's beads, in one of them.
#pragma once

#include <string>
#include <vector>

#include "core/base/acceptance.h"
#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/fiducial/bead_layout.h"
#include "core/fiducial/corkscrew_layout.h"
#include "core/fiducial/corkscrew_pose.h"
#include "core/fiducial/femur_beads.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"
#include "core/registration/chain.h"

namespace fluorocut {

struct ChainImage {
    std::string name;
    Image image;
    CArm carm;
    // Images of one name share its parameters.
    std::string focal_length_of, image_centre_of;
    Pose robot_from_flange;  // without covariance: exact
};

struct ChainMeasurementOptions {
    BeadUncertainty beads;  // its focal length and image centre are those of the corkscrew's images too
    double corkscrew_mm = CalibrationUncertainty{}.dimensions_mm;   // of each of its dimensions
    double distortion_mm = CalibrationUncertainty{}.distortion_mm;  // left by the maps, at the detector
    bool bright_beads = false;
};

struct ChainMeasurement {
    ChainProblem problem;
    FemurBeads femur;
    Vector3 beads_middle = Vector3::Zero();
    std::vector<std::string> warnings;  // of corkscrew and beads
    Acceptance acceptance;
};

// Shadows of beads of the layout's sizes in an image of a patient. invalidInput: the image is not of the C-arm's size.
Result<FemurView> beadViewOf(const std::string& name, const Image& image, const CArm& carm, const BeadLayout& layout,
                             bool bright = false, Progress& progress = Progress::none());

Result<ChainMeasurement> measureChain(const std::vector<ChainImage>& images, const CorkscrewLayout& corkscrew,
                                      const BeadLayout& beads, const Pose& flange_from_corkscrew,
                                      const ChainMeasurementOptions& options = {},
                                      Progress& progress = Progress::none());

}  // namespace fluorocut
