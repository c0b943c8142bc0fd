// From implant to cavity: the bone that has to go so that the stem can be put in, and that a cutter can take away.
//
//   sweep       the implant below the resection, pulled out along the insertion axis (+z of `cavity`, proximal): what
//               is added was an undercut
//   offset      its surface moved outward (cement mantle) or inward (press fit)
//   cutter      opened by the cutter's ball: only what a ball of its radius reaches from inside is cavity; the rest
//               stays bone and is reported with its greatest thickness
//
// (Outward, offset and sweep may be exchanged; inward, the offset of the swept shape keeps thin parts that the stem's
// own would lose.) In terms of the wanted shape's depth D(x), the distance to its border:
//
//     E(r) = {D >= r},   cavity = all balls of radius R with centres in E(R),   stage inset by d = those in E(R + d)
//
// so a stage needs nothing of its own but the depth, which is the same at R and more in the wanted shape and in the
// opened one. The swept shape widens toward the top, so the shank passes wherever the ball does and every part of E
// reaches the opening: the cavity can be milled with the spindle along the axis.
//
// Frame `cavity`, mm. The field runs on above the top (as the opening through which cutter and stem come) by the
// cutter's radius and kMostInset; the mesh is closed there by a plane at exactly top_mm.
//
// Errors, h being the spacing: where the ball's centre may be is right to 0.003 mm (but where it tapers to less than a
// voxel: 0.1 mm less); the mesh's facets lie inside round walls of radius r by up to 3 h^2 / (8 r), 0.03 mm in a corner
// of 3 mm at 0.5 mm.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/geometry/mesh_distance.h"
#include "core/geometry/triangle_mesh.h"
#include "core/image/volume.h"

namespace fluorocut {

inline constexpr double kMostInset_mm = 10;

struct CavityOptions {
    double offset_mm = 0;          // + cement mantle, - press fit
    double cutter_radius_mm = 3;   // of its ball
    std::optional<double> top_mm;  // z of the resection; unset: the implant's highest point (without offset)
    double spacing_mm = 0.5;       // of the field; at most half the cutter's radius

    Result<void> validate() const;
};

struct Cavity {
    Volume field;       // signed distance: exact to 3 mm outside, within from the cutter's radius to kMostInset deeper;
                        // nearer to the wall no more than the depth. Open at the top
    TriangleMesh mesh;  // closed, top at top_mm
    double top_mm = std::numeric_limits<double>::quiet_NaN();
    double bottom_mm = std::numeric_limits<double>::quiet_NaN();
    double volume_mm3 = std::numeric_limits<double>::quiet_NaN();
    double undercut_mm3 = std::numeric_limits<double>::quiet_NaN();     // added by the sweep to the implant itself
    double unreachable_mm3 = std::numeric_limits<double>::quiet_NaN();  // left by the cutter
    double unreachable_mm = std::numeric_limits<double>::quiet_NaN();   // its greatest thickness over the cavity
    double cutter_radius_mm = std::numeric_limits<double>::quiet_NaN();
    std::vector<std::string> warnings;

    // What stages are made of: the swept implant's own surface, and how deep in it the wanted shape begins.
    std::optional<MeshDistance> wall;
    double wall_depth_mm = std::numeric_limits<double>::quiet_NaN();
};

// invalidInput when the mesh is no solid; noSolution when nothing of it can be milled, saying how large a ball may be.
Result<Cavity> planCavity(const TriangleMesh& implant, const CavityOptions& options = {},
                          Progress& progress = Progress::none());

// The stage that lies `inset_mm` (0 to kMostInset) inside the final cavity everywhere but at the top: again open to the
// same cutter. Contained by construction; an inset that leaves nothing to mill is noSolution, saying what is the
// largest possible.
Result<Cavity> insetCavity(const Cavity& final, double inset_mm, Progress& progress = Progress::none());

// Insets of n stages, falling to 0: the first is what the uncertainty asks for (containedInset()), those between share
// the way so that each leaves the next an even layer. Layers thinner than `least_layer_mm` are made that thick, so the
// first inset may be more than was asked for. One stage is the final cavity itself.
std::vector<double> stageInsets(int stages, double first_inset_mm, double least_layer_mm = 0.3);

}  // namespace fluorocut
