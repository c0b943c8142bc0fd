// A corkscrew's parts as closed meshes, turned outward, in its own frame: to be X-rayed in a simulation, or printed.
//
// Parts of one material never overlap. Wires, beads and the shaft's inner part lie within the rod, whose mesh has no
// holes for them: who adds up what the parts absorb counts them as displacing the rod's material.
//
// Round sections are regular polygons of the circle's area (makeTube), the chords of rings and helix lie as much
// outside as inside of the layout's line: path lengths and places are right on average at any fineness.
#pragma once

#include <vector>

#include "core/base/result.h"
#include "core/fiducial/corkscrew_layout.h"
#include "core/geometry/triangle_mesh.h"

namespace fluorocut {

struct CorkscrewFineness {
    int around_axis = 512;  // sides of the rod; chords of a ring and of each turn of the helix
    int around_shaft = 128;
    int around_wire = 64;
    int bead_subdivisions = 5;
    // Rod and shaft are cut into pieces so long, at most: nothing changes but that a projector finds small triangles
    // faster than needles.
    double piece_mm = 4;

    // For looking at and for printing: within 0.02 mm of the round shape, a tenth of the triangles.
    static CorkscrewFineness coarse() { return {128, 48, 16, 3, 1000}; }

    Result<void> validate() const;
};

struct CorkscrewSolid {
    TriangleMesh rod;
    TriangleMesh shaft_inside;   // of the rod; empty when the shaft does not reach into it
    TriangleMesh shaft_outside;  // none, one or two ends; empty when there are none
    std::vector<TriangleMesh> rings;
    TriangleMesh helix;
    std::vector<TriangleMesh> beads;
};

// invalidOption: a layout or a fineness that does not validate.
Result<CorkscrewSolid> corkscrewSolid(const CorkscrewLayout& layout, const CorkscrewFineness& fineness = {});

}  // namespace fluorocut
