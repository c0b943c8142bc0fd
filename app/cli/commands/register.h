// The parts of `register`, each in its own file, and what they share.
#pragma once

#include <string>
#include <vector>

#include "app/cli/command.h"
#include "app/cli/commands/corkscrew_views.h"
#include "core/base/acceptance.h"
#include "core/fiducial/femur_beads.h"
#include "core/imaging/carm.h"
#include "core/registration/registration_file.h"

namespace fluorocut::cli {

Command declareRegisterBeads(CLI::App& parent);
Command declareRegisterChain(CLI::App& parent);
Command declareRegisterAdvise(CLI::App& parent);

// "A,B,C" into exactly so many parts; the first may hold commas. `form` is what is asked for: "IMAGE,CARM".
Result<std::vector<std::string>> partsOf(const std::string& option, const std::string& text, std::size_t count,
                                         const std::string& form);

struct BeadImage {
    std::string image, carm;
    int frame = 1;
};

struct PictureOfImager {
    Image image;
    CArm carm;
};

// An image of its C-arm's size, that is not the same as one before.
Result<PictureOfImager> pictureOf(const BeadImage& files, Pictures& before);

// Shadows of beads of the layout's sizes in an image of a patient, that is not the same as one before.
Result<FemurView> beadViewOf(const BeadImage& image, const BeadLayout& layout, bool bright, Pictures& before,
                             Progress& progress);

// The points whose errors are wanted: "[NAME=]x,y,z" in mm of the femur.
Result<std::vector<NamedPoint>> pointsOf(const std::vector<std::string>& texts);

// Where a chain's measurements come from: a file of measured poses, or images.
struct ChainInput {
    std::string measurements;
    std::vector<std::string> views;
    std::string corkscrew = "corkscrew", beads, flange_from_corkscrew;
    bool bright = false;
    BeadUncertainty uncertainty;
    double focal_percent = 100 * BeadUncertainty{}.focal_length;
    double dimensions_mm = 0.02;
    RobotNoise robot;
    std::vector<std::string> at;
};
void declareInput(CLI::App& app, ChainInput& input);
struct Measured {
    RegistrationFile file;
    std::vector<std::string> warnings;  // of the images
    Acceptance acceptance;              // of corkscrew and beads in them; nothing for a file
};
Result<Measured> measure(const ChainInput& input, Progress& progress);

}  // namespace fluorocut::cli
