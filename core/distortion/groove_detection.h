// Groove detection: finds a grooved plate's lattice in an X-ray image and measures where its grooves run.
//
// Input: linear intensity, bright = more photons, of any scale; a constant offset, saturation and a dark surround of a
// round field are normal. Neither the pixel size nor how the plate lies is known: any rotation, mirrored or not, pitch
// of 8 to 80 px. Output: GroovePoints (core/distortion/groove_points.h), one point for each segment of a groove between
// two crossings, at the middle of the segment. Lengths in px, contrasts as differences of log intensity.
//
// Steps
// 1. Log intensity, local mean removed, clipped; dark surround, metal and saturated pixels masked.
// 2. The averaged spectrum of overlapping patches gives pairs of perpendicular waves of equal length: candidates.
// 3. The image demodulated with both waves gives the phase of the lattice nearly everywhere (geometric phase analysis:
//    Hytch et al. 1998). Unwrapped outward from the best place; polynomials of rising order through it.
// 4. The image folded into one cell must look like a crossing of bright grooves of the plate's relative width. That
//    settles what spectra leave open: half or double pitch, diagonals, half a pitch off, brightness inverted.
// 5. Each segment: least squares on its raw pixels of box * blur in intensity, seen in the log, on a linear
//    background; the softness of the edges is found from the image. No resampling, hence no bias from it, and
//    standard deviations that follow from the pixels' scatter.
// 6. Segments under objects are rejected by amplitude, by residual, and by continuity with their neighbours. Parts that
//    are cut off from the main one are kept only when their index is certain.
//
// Fails with noSolution, in words, whenever the lattice cannot be trusted: what was seen, and what to do.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/distortion/groove_points.h"
#include "core/distortion/grooved_plate.h"
#include "core/image/image.h"

namespace fluorocut {

struct GrooveDetectionOptions {
    double min_pitch_px = 8;
    double max_pitch_px = 80;
    // Segments found / segments that the lattice lets expect in the lit field. Below it the lattice is not trusted.
    double min_found_share = 0.4;

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

// One segment of a groove between two crossings.
struct GrooveCounts {
    int expected = 0;  // found + hidden + doubtful
    int found = 0;
    int hidden = 0;    // no groove to be seen there: metal, saturation, too much noise
    int doubtful = 0;  // seen, but bent by something that lies over it
    int outside = 0;   // reach over the edge of the lit field, not counted as expected
};

struct GrooveDetection {
    GroovePoints points;
    double pitch_px = std::numeric_limits<double>::quiet_NaN();      // at the image's middle
    double rotation_rad = std::numeric_limits<double>::quiet_NaN();  // from +u to the plate's x there, toward +v
    double contrast = std::numeric_limits<double>::quiet_NaN();      // log intensity of groove minus land, median
    double noise = std::numeric_limits<double>::quiet_NaN();  // standard deviation of a pixel's log intensity, median
    double edge_blur_px = std::numeric_limits<double>::quiet_NaN();  // softness of the edges as a Gaussian's sigma
    GrooveCounts along_y;
    GrooveCounts along_x;
    double coverage = std::numeric_limits<double>::quiet_NaN();  // share of the lit field within a pitch of points of
                                                                 // both kinds
    std::vector<std::string> warnings;
    double elapsed_ms = std::numeric_limits<double>::quiet_NaN();
};

Result<GrooveDetection> detectGrooves(const Image& image, const GroovedPlate& plate,
                                      const GrooveDetectionOptions& options, Progress& progress);

}  // namespace fluorocut
