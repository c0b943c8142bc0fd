// A C-arm as it is, and the same C-arm as a calibration leaves it known: what an experiment on poses hands to the
// estimator.
//
// The bent one: an intensifier somewhere in the room (its pincushion and S-shape of that pose); an image of the grooved
// plate; grooves found in it, a map fitted (core/distortion). The picture of a plate can not tell how the detector's
// axes are turned about the beam, nor where the principal point lies: the known C-arm's frame `imager` is therefore the
// true one turned about the beam by a fraction of a degree, and its principal point is where a perfect calibration of
// the imager would have found it (core/fiducial/imager_calibration.h): least squares between map and truth. What is
// left between the two is the map's error alone.
#pragma once

#include <vector>

#include "core/base/random.h"
#include "core/base/result.h"
#include "core/distortion/distortion_map.h"
#include "core/imaging/carm.h"

namespace fluorocut {

struct SimulatedImagerOptions {
    int size_px = 512;
    double pixel_mm = 0.32;
    double focal_length_mm = 1000;
    bool bent = false;  // by an intensifier, whose lit field is round
    // Of the calibration's picture: photons per pixel in the open beam, and the grooves' contrast there.
    double plate_photons = 2000;
    double plate_contrast = 0.065;
    // Standard deviations of what the calibration has wrong besides.
    double focal_length_error = 0;  // relative
    double principal_point_error_mm = 0;

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

struct SimulatedImager {
    CArm truth;
    CArm known;
    Rigid3 known_from_true;                                          // imager frames: a turn about the beam
    double lit_radius_mm = std::numeric_limits<double>::infinity();  // of the round field, about the picture's middle
    double map_error_mm = 0;  // root mean square over the lit field, of the two axes together

    bool lit(const Vector2& pixel) const;
};

// noSolution when the plate's image does not give a map.
Result<SimulatedImager> simulateImager(const SimulatedImagerOptions& options, Random& random);

// The turn and shift with to ~ motion * from, by least squares. At least two points; the same number of both.
PlaneMotion bestMotion(const std::vector<Vector2>& from, const std::vector<Vector2>& to);

}  // namespace fluorocut
