// The paper's test object: a block of acrylic (PMMA) in air, as a CT.
//
// Frame: the CT's (femur), mm, Hounsfield units. The block is centred on the origin with its long axis along z, the
// axis along which pockets are milled; its faces are parallel to the axes. Faces, rounded edges and beads have partial
// volumes: a voxel's value is the mean over the voxel, exact at the faces (the overlap of two boxes), from 8 x 8 x 8
// points at rounded edges and beads.
//
// Hounsfield units: PMMA at 60 to 70 keV is 120 to 140 (density 1.18 g/cm3; NIST XCOM: mu/rho 0.192 against water's
// 0.206 cm2/g at 60 keV gives mu 10 % above water's, +100, beam hardening of a real scanner some 20 more).
#pragma once

#include <cstddef>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/image/volume.h"

namespace fluorocut {

struct AcrylicOptions {
    Vector3 size_mm{50, 50, 90};  // room for a pocket of 23 x 23 x 40 mm with walls of more than 13 mm
    double edge_radius_mm =
        0;  // rounding of all edges and corners; at most half the shortest side (a fifth with beads)
    double voxel_mm = 0.8;
    double air_margin_mm = 8;  // air around the block on all sides
    double acrylic_hu = 125;
    double air_hu = -1000;

    // Steel beads as fiducials, in the walls, well away from the axis: 0 to 24, no two at one level.
    int beads = 0;
    double bead_diameter_mm = 3;
    double bead_hu = 20000;  // steel is beyond the range of real scanners; this fits a 16-bit file

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

struct AcrylicPhantom {
    Volume ct;
    std::vector<Vector3> bead_centers_mm;  // in the CT's frame
};

// Fails with invalidOption, or cancelled.
Result<AcrylicPhantom> generateAcrylicBlock(const AcrylicOptions& options = {}, Progress& progress = Progress::none());

}  // namespace fluorocut
