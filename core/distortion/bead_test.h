// The paper's test of a distortion map: beads glued in a square lattice of known spacing over the plate, seen in
// another image and mapped to mm; the distances between neighbours tell how good the map is, without any other
// instrument.
//
// Input are mapped bead centres (mm in the detector plane, axes along the image's, origin in its middle): in any order,
// some missing, some false. Beads lie nearer to the source than the plate plane and are seen enlarged by f / (f - h),
// for which distances are corrected.
#pragma once

#include <limits>
#include <vector>

#include "core/base/acceptance.h"
#include "core/base/result.h"
#include "core/geometry/rigid3.h"

namespace fluorocut {

struct BeadTestOptions {
    double spacing_mm = 20;
    double centre_half_mm = 60;  // pairs with both beads within this of the middle, along x and y, are the centre's
    double bead_height_mm = 0;   // h: of the beads' centres over the plate plane
    double source_mm = 1000;     // f: source to plate plane

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

struct DistanceErrors {
    int pairs = 0;
    double mean_mm = std::numeric_limits<double>::quiet_NaN();  // of absolute values
    double rms_mm = std::numeric_limits<double>::quiet_NaN();
    double largest_mm = std::numeric_limits<double>::quiet_NaN();
};

struct BeadTest {
    int beads = 0;                                                   // in the lattice
    int stray = 0;                                                   // points that belong to no place of it
    double rotation_rad = std::numeric_limits<double>::quiet_NaN();  // of the lattice, within 45 degrees
    // Of the mapped lattice against the spacing, best fit: 1 when the map's mm are right.
    double scale = std::numeric_limits<double>::quiet_NaN();
    DistanceErrors centre, margin;  // of neighbours
    DistanceErrors all_neighbours;
    DistanceErrors all_pairs;                                // every bead with every other
    std::vector<double> centre_errors_mm, margin_errors_mm;  // measured minus true, signed, of each pair
};

// noSolution, in words, when no lattice of that spacing is there: at least 6 beads in 2 rows and 2 columns.
Result<BeadTest> beadTest(const std::vector<Vector2>& points_mm, const BeadTestOptions& options = {});

// The paper's own figures: no map has to be worse than those of the year 2000.
struct BeadTestLimits {
    double max_centre_mm = 0.12;
    double max_margin_mm = 0.25;  // judged when there are pairs in the margin
};
Acceptance judge(const BeadTest& test, const BeadTestLimits& limits = {});

}  // namespace fluorocut
