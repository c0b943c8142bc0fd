#include "core/simulation/pelvis_shape.h"

#include "core/simulation/implicit.h"

namespace fluorocut {

using namespace implicit;

namespace {

constexpr double kJointSpace = 4;  // mm; 3 to 5 on radiographs of healthy hips

// The direction in which the socket opens: 45 degrees of inclination, 18 of anteversion (Murray 1993, radiographic).
const Vector3 kOpening = Vector3(0.67, -0.31, -0.67).normalized();

}  // namespace

PelvisShape::PelvisShape(const Vector3& head_center, double head_radius_mm, double scale)
    : center_(head_center), socket_radius_(head_radius_mm + kJointSpace * scale), scale_(scale), bumps_(5) {}

double PelvisShape::outer(const Vector3& p) const {
    const Vector3 q = (p - center_) / scale_;
    const double r = socket_radius_ / scale_;
    // Cup: a thick shell cut off by the plane of its rim.
    double f = smoothIntersection(q.norm() - (r + 6.5), q.dot(kOpening) - 5, 3);
    // Ilium: a column above the roof that widens into the wing.
    f = smoothUnion(f, roundCone(q, {-8, 2, 34}, {-16, 14, 80}, 15, 11), 14);
    const Matrix3 wing = (Eigen::AngleAxisd(-0.35, Vector3::UnitY()) * Eigen::AngleAxisd(0.3, Vector3::UnitZ()))
                             .toRotationMatrix()
                             .transpose();
    f = smoothUnion(f, ellipsoid(q, {-10, 2, 92}, {9, 58, 48}, wing), 12);
    // Ischium down and back to its tuberosity.
    f = smoothUnion(f, roundCone(q, {-22, 22, -14}, {-20, 35, -46}, 12, 15), 12);
    // Upper ramus of the pubis to the symphysis, lower ramus back to the tuberosity.
    f = smoothUnion(f, roundCone(q, {-30, -14, 2}, {-62, -28, -20}, 12, 8), 12);
    f = smoothUnion(f, roundCone(q, {-62, -28, -20}, {-84, -32, -28}, 8, 13), 10);
    f = smoothUnion(f, roundCone(q, {-80, -28, -40}, {-34, 28, -60}, 8, 7.5), 8);
    // Posterior column from the sciatic notch to the ischium, anterior column from the ilium to the pubis.
    f = smoothUnion(f, roundCone(q, {-18, 20, 58}, {-25, 24, -16}, 10, 11), 12);
    f = smoothUnion(f, roundCone(q, {-14, -10, 34}, {-34, -14, 0}, 11, 10), 12);
    f += 1.1 * bumps_(q / 11);
    // The socket itself, the fossa at its bottom and the notch below.
    f = smoothSubtraction(f, q.norm() - r, 1.5);
    f = smoothSubtraction(f, roundCone(q, {-20, 2, -8}, {-14, -4, -30}, 11, 9), 3);
    return scale_ * f;
}

double PelvisShape::tissue(const Vector3& p, double depth_mm, const LatticeNoise& noise, double trabecular_hu) const {
    const Vector3 q = (p - center_) / scale_;
    // Subchondral bone is dense, most of all in the roof that carries the weight (the sourcil).
    const double near_socket = smoothStep(6, 0, q.norm() - socket_radius_ / scale_);
    const double roof = smoothStep(0.55, 0.9, q.normalized().z());
    const double shell = 1.3 + near_socket * (0.7 + 1.6 * roof);
    const double cortical = 1050 + 150 * near_socket;
    const double stress = std::exp(-std::max(0.0, q.norm() - 30) / 30) * std::max(0.2, q.normalized().z() + 0.4);
    // Oblique to the voxels, so that no lattice shows.
    const Vector3 turned((0.8 * p.x() + 0.6 * p.z()) / 2.1, p.y() / 9, (0.8 * p.z() - 0.6 * p.x()) / 3.3);
    const double inside = trabecular_hu * (0.35 + 0.6 * stress) *
                          (1 + 0.7 * noise(turned) + 0.4 * noise(1.8 * turned + Vector3(40, 0, 0)));
    return cortical + smoothStep(shell - 0.4, shell + 0.4, depth_mm / scale_) * (inside - cortical);
}

}  // namespace fluorocut
