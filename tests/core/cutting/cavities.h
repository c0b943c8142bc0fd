// Cavities whose signed distance is known without any mesh, for tests of cutting. Frame `cavity`, mm; all run on upward
// for ever, their top (where the path begins) is at z = 0.
#pragma once

#include <functional>

#include "core/cutting/tool_path.h"
#include "core/geometry/triangle_mesh.h"
#include "core/image/volume.h"

namespace fluorocut {

struct CavityShape {
    std::function<double(const Vector3&)> distance;                              // exact inside, negative there
    Vector3 low, high;                                                           // a box that holds it up to its top
    std::function<Vector2(double)> axis = [](double) { return Vector2(0, 0); };  // a place inside, at every z
    double middle = 0;  // z of a place on the axis near the bottom, from which all of the bottom is seen
};

// Flat floor at z = -depth, its edge rounded.
CavityShape cylinderCavity(double radius, double depth, double rounding = 0);

// A cone round +z with a round tip: balls of radius tip at z = tip - depth, and `top` at z = 0, and all between.
CavityShape coneCavity(double tip, double top, double depth);

// Four leaning walls and a flat floor, all edges rounded by `rounding`; half widths (x, y) at the floor and at z = 0.
CavityShape squaredCavity(const Vector2& floor, const Vector2& top, double depth, double rounding);

// A tube of this radius round an arc from the origin down to z = -depth, at first straight down, then toward +x. Not
// swept: with the spindle along z its lower end is out of reach.
CavityShape bowedCavity(double radius, double depth, double bow_radius);

// A pit between two cylinders round +z, flat at its bottom.
CavityShape ringCavity(double inner, double outer, double depth);
TriangleMesh ringMesh(double inner, double outer, double depth, int segments);

CavityShape moved(const CavityShape& shape, const Vector2& shift);

// Its closed mesh, flat at z = 0: vertices on the surface, along rays from the axis.
TriangleMesh meshOf(const CavityShape& shape, int sections, int segments);

// Farthest that the cutter, ball or shank, leaves the shape on any move, by brute force: every move sampled at
// `step_mm` (or 100 times, if it is long) against the shape's own distance. Above the top the way in is the top's
// section, straight up to `open_mm`, where it ends; a ball above that counts as outside by so much.
double mostBeyond(const ToolPath& path, const CavityShape& shape, double open_mm, double step_mm = 0.2);

// On a grid with room around it.
Volume fieldOf(const CavityShape& shape, double spacing);

}  // namespace fluorocut
