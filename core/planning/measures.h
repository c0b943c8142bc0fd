// Measures that a plan shows, each with its standard deviation and the plane or space it is taken in: a length read off
// one image is a length in that image's detector, or in a plane at a depth that somebody has stated, and says so.
//
// Errors are carried to first order: sigma^2 = g^T C g, g the gradient of the measure by everything it was computed
// from (central differences), C their covariance. Frames: pixels of the image in 2D, `femur` (the views' world) in 3D.
// mm, rad.
#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/imaging/rays.h"
#include "core/planning/bone_walls.h"
#include "core/planning/implant.h"
#include "core/planning/line_fit.h"

namespace fluorocut {

struct Measure {
    double value = std::numeric_limits<double>::quiet_NaN();
    double sigma = std::numeric_limits<double>::quiet_NaN();
    std::string unit;   // "mm", "rad"
    std::string plane;  // "in the detector plane", "in space", ...
    std::vector<std::string> warnings;
};

// A function of several numbers with their covariance. `steps`: of the differences, one for each number.
Measure propagated(const std::function<double(const Eigen::VectorXd&)>& f, const Eigen::VectorXd& at,
                   const Eigen::MatrixXd& covariance, const Eigen::VectorXd& steps);

// ---- in one image; clicks have the standard deviation `sigma_px` in u and in v, distortion is taken out ----

// |a - b| in the detector: with d = the direction from a to b, sigma^2 = 2 sigma_px^2 ((d_x p_x)^2 + (d_y p_y)^2).
Measure distanceInDetector(const CArm& carm, const Vector2& a, const Vector2& b, double sigma_px);
// The same in the plane at `depth_mm` from the source, parallel to the detector: times depth / focal length (one over
// the magnification). An error of the depth counts as a relative error of the length.
Measure distanceAtDepth(const CArm& carm, const Vector2& a, const Vector2& b, double sigma_px, double depth_mm,
                        double depth_sigma_mm);
// At the vertex between the directions to a and to b, in [0, pi]; the same in every plane parallel to the detector.
Measure angleInDetector(const CArm& carm, const Vector2& vertex, const Vector2& a, const Vector2& b, double sigma_px);
// Between two lines, each from its first click to its second, in [0, pi]; the same in every plane parallel to the
// detector.
Measure angleBetweenLines(const CArm& carm, const Vector2& a0, const Vector2& a1, const Vector2& b0, const Vector2& b1,
                          double sigma_px);

// ---- in space, from two views or more ----

// Points seen in the same views. What the views' poses are wrong by moves all of them together, so distances between
// them are known better than their places: the covariance is that of all of them jointly.
struct PointsInSpace {
    std::vector<Vector3> points;
    Eigen::MatrixXd covariance;  // 3n x 3n, mm^2
    std::vector<double> rms_px;  // of each point's residuals
    std::vector<std::string> warnings;
};
// pixels[point][view]. Fails as `triangulate` does, naming the point.
Result<PointsInSpace> pointsInSpace(const std::vector<View>& views, const std::vector<std::vector<Vector2>>& pixels,
                                    double sigma_px);
Measure distanceInSpace(const PointsInSpace& points, std::size_t a, std::size_t b);
Measure angleInSpace(const PointsInSpace& points, std::size_t vertex, std::size_t a, std::size_t b);

// ---- of the femur and its implant ----

// The canal's axis between two heights above the walls' distal end: a line through the canal's centres (its bow is in
// the residual).
LineFit canalAxis(const BoneWalls& walls, double from_mm, double to_mm);

struct UncertainPoint {
    Vector3 point = Vector3::Zero();
    Matrix3 covariance = Matrix3::Zero();  // mm^2
};

// Hip centres in the femur's frame, the leg in one position: where the head's centre was or should be, and where the
// plan puts it; likewise the socket's, when it is moved. `axis` points proximally.
struct HipCenters {
    UncertainPoint head_reference;  // the native head, or the other hip's, mirrored into this femur
    UncertainPoint head_planned;
    std::optional<UncertainPoint> socket_reference, socket_planned;
    LineFit axis;
};
// How much longer the leg becomes: the head's way proximally along the axis less the socket's.
Measure legLengthChange(const HipCenters& hip);
// How much farther the head's centre lies from the axis of the canal: the change of femoral offset.
Measure offsetChange(const HipCenters& hip);

// Anteversion: the angle, seen along the axis, from the reference direction (medial in the plane that counts: parallel
// to the line of the posterior condyles) to the neck's, positive when the neck points forward.
struct VersionInput {
    Vector3 neck = Vector3::UnitX();       // from the shaft toward the head's centre, of any length
    Vector3 reference = Vector3::UnitX();  // medial
    Vector3 axis = Vector3::UnitZ();       // proximal
    Side side = Side::left;
    Matrix3 neck_covariance = Matrix3::Zero(), reference_covariance = Matrix3::Zero(),
            axis_covariance = Matrix3::Zero();  // of the vectors as they are given
};
Measure version(const VersionInput& input);

// Thickness of the cortex at a level, along a ray; sigma: how well walls are found (core/planning/bone_walls.h).
struct LevelThickness {
    double along_mm = 0;
    Measure least, mean;
    Vector3 least_place = Vector3::Zero();  // on the outer surface
};
std::vector<LevelThickness> cortexThickness(const BoneWalls& walls);

// The sentence that the surgeon must see, or nothing: a wall that is thinner than the limit with more than 5 %
// probability.
std::optional<std::string> perforationWarning(const Measure& least_wall, const std::string& where, double limit_mm);

}  // namespace fluorocut
