// From implant to cavity: the bone that has to go so that the stem can be put in, and that a cutter can take away.
//
//   offset      the implant's surface moved outward (cement mantle) or inward (press fit)
//   sweep       along the insertion axis (+z of `cavity`, proximal), so that the stem can be pushed in: what is added
//               was an undercut
//   cutter      opened by the cutter's ball: only what a ball of its radius reaches from inside is cavity; the rest
//               stays bone and is reported with its greatest thickness over the implant
//
// Since the swept solid widens toward the top, the shank passes wherever the ball does: the cavity can be milled with
// the spindle along the axis. Frame `cavity`, mm. The field runs on above the top (as the opening through which cutter
// and stem come); the mesh is closed by a plane there.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/geometry/triangle_mesh.h"
#include "core/image/volume.h"

namespace fluorocut {

struct CavityOptions {
    double offset_mm = 0;          // + cement mantle, - press fit
    double cutter_radius_mm = 3;   // of its ball
    std::optional<double> top_mm;  // z of the resection; unset: the implant's highest point (without offset)
    double spacing_mm = 0.5;       // of the field

    Result<void> validate() const;
};

struct Cavity {
    Volume field;       // signed distance (exact within a few mm of the surface), open at the top
    TriangleMesh mesh;  // closed, top at top_mm
    double top_mm = std::numeric_limits<double>::quiet_NaN();
    double bottom_mm = std::numeric_limits<double>::quiet_NaN();
    double volume_mm3 = std::numeric_limits<double>::quiet_NaN();
    double undercut_mm3 = std::numeric_limits<double>::quiet_NaN();     // added by the sweep
    double unreachable_mm3 = std::numeric_limits<double>::quiet_NaN();  // left by the cutter
    double unreachable_mm = std::numeric_limits<double>::quiet_NaN();   // its greatest depth inside the wanted cavity
    double cutter_radius_mm = std::numeric_limits<double>::quiet_NaN();
    std::vector<std::string> warnings;
};

// invalidInput when the mesh is no solid or too small for the cutter (nothing of it can be milled).
Result<Cavity> planCavity(const TriangleMesh& implant, const CavityOptions& options = {},
                          Progress& progress = Progress::none());

// The stage that lies `inset_mm` inside the final cavity everywhere but at the top: again open to the same cutter.
// Contained by construction; an inset that leaves nothing to mill is noSolution, saying what is the largest possible.
Result<Cavity> insetCavity(const Cavity& final, double inset_mm, Progress& progress = Progress::none());

// Insets of n stages, falling to 0: the first is what the uncertainty asks for (containedInset()), those between share
// the way so that each leaves the next an even layer, none thinner than `least_layer_mm`.
std::vector<double> stageInsets(int stages, double first_inset_mm, double least_layer_mm = 0.3);

}  // namespace fluorocut
