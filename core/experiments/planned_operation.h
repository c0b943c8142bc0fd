// What a scenario's patient and plan come to: the CT, the solid to be milled and its place, the beads.
//
// Built-in femurs and blocks are generated, CTs read. Above the resection the wound is open: within `open_wound_mm` of
// the cavity's axis there is air. Beads are spread in the bone beside the cavity, out of the reach of a first cut that
// goes astray, each as far from the others as there is bone. Everything is a function of the scenario.
//
// Frames `femur`, `cavity`; mm, HU.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/experiments/scenario.h"
#include "core/fiducial/bead_layout.h"
#include "core/geometry/triangle_mesh.h"
#include "core/image/volume.h"

namespace fluorocut {

struct PlannedOperation {
    std::shared_ptr<const Volume> ct;  // with the wound open
    std::string implant;               // "straight 12"
    TriangleMesh mesh;
    double top_mm = 0, bottom_mm = 0;  // of the mesh below the resection, along the cavity's z
    Rigid3 femur_from_cavity;
    BeadLayout beads;  // where they truly are
    std::vector<std::string> remarks;
};

// noSolution when no stem fits, or there is no bone for the beads; what reading and templating say.
Result<PlannedOperation> planOperation(const Scenario& scenario, Progress& progress = Progress::none());

}  // namespace fluorocut
