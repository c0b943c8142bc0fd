// A stem's pose as the numbers that a surgeon says it with, against a femur's axis: its canal's and the direction in
// which the head lies (StemSeat, core/planning/templating.h).
//
// In the seat's axes (medial, anterior, proximal) the stem's own are turned by
//
//     R = R_anterior(varus) R_medial(flexion) R_proximal(version)          each positive as named:
//
//     varus    the stem's tip points laterally; negative: valgus
//     flexion  the stem's tip points forward; negative: extension
//     version  the stem is turned about its own axis so that its neck points forward
//
// and the stem's reference point (the middle of its resection) lies at (medial, anterior, height) from the seat's
// point. mm, rad; |varus| and |flexion| below pi / 2, as for every stem in a femur.
#pragma once

#include "core/planning/templating.h"

namespace fluorocut {

struct StemNumbers {
    double varus_rad = 0, flexion_rad = 0, version_rad = 0;
    double medial_mm = 0, anterior_mm = 0, height_mm = 0;
};

StemNumbers stemNumbers(const StemSeat& seat, const Rigid3& femur_from_cavity, double resection_z_mm = 0);
Rigid3 femurFromCavity(const StemSeat& seat, const StemNumbers& numbers, double resection_z_mm = 0);

}  // namespace fluorocut
