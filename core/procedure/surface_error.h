// What an uncertain pose means for a cavity's wall, and how far one cavity lies from another: the numbers by which the
// procedure announces, plans and judges. Frame of meshes `cavity`; mm, rad.
#pragma once

#include <limits>
#include <vector>

#include "core/geometry/pose.h"
#include "core/geometry/triangle_mesh.h"
#include "core/planning/containment.h"

namespace fluorocut {

// Of the walls: the opening at the top, however the mesh closes it, does not count.
std::vector<SurfacePoint> wallPoints(const TriangleMesh& cavity, double top_mm);

struct SurfaceError {
    // Radius of the sphere that holds the worst place of the wall with 95 % (core/geometry/point_error.h).
    double bound_mm = std::numeric_limits<double>::quiet_NaN();
    Vector3 worst_in_cavity = Vector3::Constant(std::numeric_limits<double>::quiet_NaN());
};

// `place`: any frame from cavity, with its covariance.
SurfaceError surfaceError(const std::vector<SurfacePoint>& walls, const Pose& place);

// The inset with which the cavity stays inside with this probability (containment.h).
double insetFor(const std::vector<SurfacePoint>& walls, const Pose& place, double probability);

struct CavityOffset {
    double most_mm = std::numeric_limits<double>::quiet_NaN();    // of the worst place of the wall
    double middle_mm = std::numeric_limits<double>::quiet_NaN();  // of the wall's middle
    double turn_rad = std::numeric_limits<double>::quiet_NaN();
};

CavityOffset offsetOf(const std::vector<SurfacePoint>& walls, const Rigid3& planned, const Rigid3& found);

}  // namespace fluorocut
