#include "core/planning/stem_numbers.h"

#include <algorithm>
#include <cmath>

namespace fluorocut {
namespace {

// The seat's y is anterior on the left and posterior on the right: the mirror image.
double anteriorSign(const StemSeat& seat) {
    return seat.side == Side::left ? 1 : -1;
}

}  // namespace

// With s the sign of y being anterior: R = Ry(b) Rx(a) Rz(c), whose third column is (sin b cos a, -sin a, cos b cos a).
// The tip lies along its negative: laterally for b > 0, toward +y for a > 0.
StemNumbers stemNumbers(const StemSeat& seat, const Rigid3& femur_from_cavity, double resection_z_mm) {
    const double s = anteriorSign(seat);
    const Rigid3 seat_from_cavity = seat.femurFromCavity().inverse() * femur_from_cavity;
    const Matrix3 r = seat_from_cavity.rotationMatrix();
    const Vector3 reference = seat_from_cavity * Vector3(0, 0, resection_z_mm);
    StemNumbers numbers;
    numbers.varus_rad = std::atan2(r(0, 2), r(2, 2));
    numbers.flexion_rad = s * std::asin(std::clamp(-r(1, 2), -1.0, 1.0));
    numbers.version_rad = s * std::atan2(r(1, 0), r(1, 1));
    numbers.medial_mm = reference.x();
    numbers.anterior_mm = s * reference.y();
    numbers.height_mm = reference.z();
    return numbers;
}

Rigid3 femurFromCavity(const StemSeat& seat, const StemNumbers& numbers, double resection_z_mm) {
    const double s = anteriorSign(seat);
    const Eigen::Quaterniond turn = expRotation({0, numbers.varus_rad, 0}) *
                                    expRotation({s * numbers.flexion_rad, 0, 0}) *
                                    expRotation({0, 0, s * numbers.version_rad});
    const Rigid3 seat_from_cavity(turn, {numbers.medial_mm, s * numbers.anterior_mm, numbers.height_mm});
    return seat.femurFromCavity() * seat_from_cavity * Rigid3::fromTranslation({0, 0, -resection_z_mm});
}

}  // namespace fluorocut
