// The paper's test of its distortion correction, many times over, in simulation. Each trial, with another imager,
// C-arm position, plate placement, dose and groove depth:
//
//   1. an image of the grooved plate, with or without a limb, clamp and screws over it;
//   2. grooves found, a map fitted by each model;
//   3. with the C-arm where it was, beads 20 mm apart stuck over the plate, another image;
//   4. beads found, mapped by the saved map, distances of neighbours held against 20 mm.
//
// Paper: 0.12 mm mean in the centre (about 120 x 120 mm), 0.25 mm in the margin, 0.32 mm pixels. Beside it stands what
// a real experiment can not measure: the map's error against the truth, after the best rigid motion, at every 16th
// pixel that the map vouches for; and whether every groove was given its right number.
//
// Lengths in mm in the detector plane. The same options give the same figures.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/experiments/error_figures.h"
#include "core/geometry/rigid3.h"

namespace fluorocut {

struct DewarpExperimentOptions {
    int trials = 20;
    std::uint64_t seed = 1;
    int size_px = 512;
    double pixel_mm = 0.32;
    // Drawn uniformly: detected photons per pixel, mean over the picture; contrast of the grooves' log intensity.
    double least_photons = 500, most_photons = 2000;
    double least_contrast = 0.05, most_contrast = 0.08;
    bool objects = false;  // a limb, a clamp and screws over the plate
    double bead_spacing_mm = 20;
    double bead_diameter_mm = 3;
    std::vector<std::string> models{"polynomial", "bernstein", "thin-plate-spline"};

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

struct DewarpModelFigures {
    std::string model;
    ErrorFigures beads_centre, beads_margin;  // of distances between neighbours
    ErrorFigures map_centre, map_margin;
    int fits = 0;         // that succeeded
    double coverage = 0;  // mean share of the image
};

struct DewarpExperimentResult {
    int trials = 0;
    int refused = 0;  // no lattice was found that could be trusted
    int wrong = 0;    // accepted with a groove that has a wrong number
    std::vector<DewarpModelFigures> models;
    double detect_ms = 0;  // medians
    double fit_ms = 0;     // of the first model
};

// noSolution never comes from here: what a trial refuses is counted.
Result<DewarpExperimentResult> runDewarpExperiment(const DewarpExperimentOptions& options,
                                                   Progress& progress = Progress::none());

}  // namespace fluorocut
