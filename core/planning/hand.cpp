#include "core/planning/hand.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fluorocut {
namespace {

// Of the imager's frame, so that distances from the image plane stay as they are.
Rigid3 moved(const View& view, const Rigid3& femur_from_implant, const Vector3& by_in_imager) {
    const Vector3 by = view.imager_from_world.inverse().rotate(by_in_imager);
    return {femur_from_implant.rotation(), femur_from_implant.translation() + by};
}

// About an axis of the femur's frame through a point of the implant.
Rigid3 turnedAbout(const Rigid3& femur_from_implant, const Vector3& pivot, const Vector3& rotation_in_femur) {
    const Eigen::Quaterniond turn = expRotation(rotation_in_femur);
    const Vector3 place = femur_from_implant * pivot;
    return {turn * femur_from_implant.rotation(), place + turn * (femur_from_implant.translation() - place)};
}

// Where a pixel's ray passes at a depth: x and y in the imager's frame.
std::optional<Vector2> atDepth(const CArm& carm, const Vector2& pixel, double depth_mm) {
    const Vector3 on_detector = carm.detectorPoint(pixel);
    if (!(depth_mm > 0) || !on_detector.allFinite()) return std::nullopt;
    return Vector2(on_detector.head<2>() * (depth_mm / carm.focal_length_mm));
}

// The distances along a ray (origin, direction) at which it passes the triangle's plane inside the triangle (Moeller
// and Trumbore 1997).
std::optional<double> meets(const Vector3& origin, const Vector3& direction, const Vector3& a, const Vector3& b,
                            const Vector3& c) {
    const Vector3 ab = b - a, ac = c - a, p = direction.cross(ac);
    const double determinant = ab.dot(p);
    if (determinant == 0) return std::nullopt;
    const Vector3 from_a = origin - a;
    const double u = from_a.dot(p) / determinant;
    if (!(u >= 0 && u <= 1)) return std::nullopt;
    const Vector3 q = from_a.cross(ab);
    const double v = direction.dot(q) / determinant;
    if (!(v >= 0 && u + v <= 1)) return std::nullopt;
    return ac.dot(q) / determinant;
}

}  // namespace

StemGrip gripOf(const TriangleMesh& mesh, double resection_z_mm) {
    double lowest = resection_z_mm;
    for (const Vector3& p : mesh.vertices)
        lowest = std::min(lowest, p.z());
    return {{0, 0, resection_z_mm}, {0, 0, lowest}};
}

std::optional<Vector3> underPixel(const View& view, const TriangleMesh& mesh, const Rigid3& femur_from_mesh,
                                  const Vector2& pixel) {
    const Ray ray = pixelRay(view.carm, view.imager_from_world * femur_from_mesh, pixel);
    if (!ray.direction.allFinite()) return std::nullopt;
    double first = std::numeric_limits<double>::infinity(), last = 0;
    for (const Triangle& t : mesh.triangles) {
        const auto corner = [&](std::size_t i) -> const Vector3& {
            return mesh.vertices[static_cast<std::size_t>(t[i])];
        };
        if (const auto at = meets(ray.origin, ray.direction, corner(0), corner(1), corner(2)); at && *at > 0) {
            first = std::min(first, *at);
            last = std::max(last, *at);
        }
    }
    if (!(last > 0)) return std::nullopt;
    return Vector3(ray.origin + 0.5 * (first + last) * ray.direction);
}

std::optional<Rigid3> dragged(const View& view, const Rigid3& femur_from_implant, const Vector3& held,
                              const Vector2& to_px) {
    const Vector3 place = view.imager_from_world * (femur_from_implant * held);
    const auto to = atDepth(view.carm, to_px, place.z());
    if (!to) return std::nullopt;
    return shifted(view, femur_from_implant, *to - place.head<2>());
}

Rigid3 shifted(const View& view, const Rigid3& femur_from_implant, const Vector2& by_mm) {
    return moved(view, femur_from_implant, {by_mm.x(), by_mm.y(), 0});
}

Rigid3 turned(const View& view, const Rigid3& femur_from_implant, const Vector3& pivot, double angle_rad) {
    const Vector3 axis = view.imager_from_world.inverse().rotate(Vector3::UnitZ());
    return turnedAbout(femur_from_implant, pivot, angle_rad * axis);
}

std::optional<double> turnToward(const View& view, const Rigid3& femur_from_implant, const Vector3& pivot,
                                 const Vector3& handle, const Vector2& to_px) {
    const Rigid3 imager_from_implant = view.imager_from_world * femur_from_implant;
    const Vector3 from = imager_from_implant * handle;
    const Vector2 center = (imager_from_implant * pivot).head<2>();
    const auto to = atDepth(view.carm, to_px, from.z());
    if (!to) return std::nullopt;
    const Vector2 a = from.head<2>() - center, b = *to - center;
    if (!(a.norm() > 1e-9 && b.norm() > 1e-9)) return std::nullopt;
    return std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
}

Rigid3 tilted(const View& view, const Rigid3& femur_from_implant, const Vector3& pivot, double angle_rad) {
    const Rigid3 femur_from_imager = view.imager_from_world.inverse();
    const Vector3 stem = (view.imager_from_world * femur_from_implant).rotate(Vector3::UnitZ());
    // Turning about -(z x stem) lowers the stem's end and raises its tip toward the detector.
    Vector3 axis = stem.cross(Vector3::UnitZ());
    axis = axis.norm() > 1e-9 ? axis.normalized() : Vector3(Vector3::UnitX());
    return turnedAbout(femur_from_implant, pivot, -angle_rad * femur_from_imager.rotate(axis));
}

Rigid3 rolled(const Rigid3& femur_from_implant, const Vector3& pivot, double angle_rad) {
    return turnedAbout(femur_from_implant, pivot, angle_rad * femur_from_implant.rotate(Vector3::UnitZ()));
}

Rigid3 snappedTo(const AxisLine& canal, const Rigid3& femur_from_implant, const Vector3& reference) {
    const Vector3 axis = canal.direction();
    const Eigen::Quaterniond turn =
        Eigen::Quaterniond::FromTwoVectors(femur_from_implant.rotate(Vector3::UnitZ()), axis);
    const Vector3 place = femur_from_implant * reference;
    const Vector3 on_axis = canal.distal + axis.dot(place - canal.distal) * axis;
    return {turn * femur_from_implant.rotation(), on_axis + turn * (femur_from_implant.translation() - place)};
}

Vector3 keptPoint(const Implant& implant, KeptPoint kept) {
    Vector3 point(0, 0, implant.resection_z_mm);
    if (kept == KeptPoint::resection) return point;
    constexpr double kInPlaneMm = 0.01;
    for (const Vector3& p : implant.in_bone.vertices)
        if (std::abs(p.z() - implant.resection_z_mm) < kInPlaneMm && p.x() < point.x()) point.head<2>() = p.head<2>();
    return point;
}

Rigid3 resized(const Rigid3& femur_from_implant, const Implant& now, const Implant& next, KeptPoint kept) {
    return femur_from_implant * Rigid3::fromTranslation(keptPoint(now, kept) - keptPoint(next, kept));
}

std::optional<std::string> neighbourSize(const ImplantFamily& family, const std::string& size, int steps) {
    for (std::size_t i = 0; i < family.sizes.size(); ++i) {
        if (family.sizes[i].name != size) continue;
        const auto at = static_cast<std::ptrdiff_t>(i) + steps;
        if (at < 0 || at >= static_cast<std::ptrdiff_t>(family.sizes.size())) return std::nullopt;
        return family.sizes[static_cast<std::size_t>(at)].name;
    }
    return std::nullopt;
}

}  // namespace fluorocut
