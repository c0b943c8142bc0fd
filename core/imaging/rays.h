// Rays of a C-arm, and what several views say together: epipolar lines and points triangulated from their pictures.
//
// "world" is whatever frame the views share (for a patient: femur). A view's `imager_from_world` is the paper's
// equation 1. Pixels are those of the image, distorted; "ideal" pixels are those without distortion (CArm::idealPixel).
// mm, rad.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/rigid3.h"
#include "core/imaging/carm.h"

namespace fluorocut {

struct View {
    CArm carm;
    Rigid3 imager_from_world;
    // Of imager_from_world, as Rigid3::perturbed has it; zero: exact.
    Matrix6 covariance = Matrix6::Zero();
};

struct Ray {
    Vector3 origin;     // the X-ray source
    Vector3 direction;  // unit, toward the detector
};

// The ray through a pixel, in the frame that `imager_from_world` starts from.
Ray pixelRay(const CArm& carm, const Rigid3& imager_from_world, const Vector2& pixel);

// Where the ray through `pixel` of view a is seen in view b.
//
// As a line in ideal pixels: (l0, l1, l2) with l0 u + l1 v + l2 = 0, scaled so that the left side is the distance in
// pixels. It is the trace of the plane through both sources (Hartley and Zisserman 2004, 9.2: l = F x). Fails when view
// b's source lies on the ray: then the whole ray is one point there.
Result<Vector3> epipolarLine(const View& a, const Vector2& pixel, const View& b);

// As a polyline in (distorted) pixels of b: only what can be the picture of a point, that is between source and
// detector of a and in front of b's source; vertices at most `step_px` apart, cut to b's image (up to a few pixels
// beyond its border where the distortion is strong). Empty when nothing of it is seen.
Result<std::vector<Vector2>> epipolarCurve(const View& a, const Vector2& pixel, const View& b, double step_px = 4);

struct Observation {
    View view;
    Vector2 pixel;
    double sigma_px = 0.3;  // standard deviation of u and of v
};

struct TriangulationOptions {
    double parallel_rad = 1e-3;  // all rays within this angle: refused, there is no point to be found
    double narrow_rad = 0.175;   // all rays within this angle (10 degrees): done, with a warning
    int iterations = 30;

    Result<void> validate() const;
};

struct TriangulatedPoint {
    Vector3 point;                      // world
    Matrix3 covariance;                 // mm^2, world
    std::vector<Vector2> residuals_px;  // seen - predicted, one for each observation
    double rms_px;                      // of all residual coordinates
    double chi_squared;                 // residuals over what pixels and poses allow; expected: degrees_of_freedom
    int degrees_of_freedom = 0;         // 2 n - 3
    double angle_rad;                   // the largest angle between two rays
    Vector3 weakest_direction;          // unit, world: where the point is known worst,
    double weakest_sigma_mm;            // and how badly
    std::vector<std::string> warnings;  // sentences
    int iterations = 0;

    TriangulatedPoint();  // all NaN: not run
};

// The point that minimises the reprojection error, each observation weighted by its pixel noise and its view's pose
// covariance brought to pixels (errors of different observations taken as independent):
//     minimise sum r_i^T S_i^-1 r_i,   S_i = sigma_i^2 I + J_pose C_i J_pose^T,   covariance = (sum J^T S_i^-1 J)^-1
// Starts at the midpoint of the rays, then Gauss-Newton. Fails, in words, for fewer than two observations, for (nearly)
// parallel rays and for a point behind a source.
Result<TriangulatedPoint> triangulate(const std::vector<Observation>& observations,
                                      const TriangulationOptions& options = {});

}  // namespace fluorocut
