// The soft tissue around a hip and upper thigh: skin, subcutaneous fat, and muscles that lie against each other with
// thin planes of fat between. Frame `bone` (femur_shape.h), mm, HU.
//
// The skin is a tapering thigh joined to the trunk. Muscles are bars of varying thickness along their course from
// origin to insertion; a point belongs to the nearest one (measured from its surface), and where two are nearly equally
// near lies the fat between them. What no muscle claims is fat.
#pragma once

#include <cstdint>
#include <vector>

#include "core/geometry/rigid3.h"
#include "core/simulation/lattice_noise.h"

namespace fluorocut {

class SoftTissue {
  public:
    // `scale` 1 goes with a femoral head of 46 mm; `head_center` moves the muscles of the hip with the joint.
    SoftTissue(double scale, const Vector3& head_center, double fat_mm, std::uint64_t seed);

    // Signed distance to the skin, approximately.
    double skin(const Vector3& p) const;
    // HU at a point inside the skin; `skin_mm` is skin(p).
    double tissue(const Vector3& p, double skin_mm) const;

    static constexpr double kFatHu = -100;
    static constexpr double kMuscleHu = 55;

  private:
    struct Muscle {
        Vector3 from, to;
        double radius_from, radius_to;
        int owner;  // bars of one muscle have no fat between them
    };
    std::vector<Muscle> muscles_;
    Vector3 low_, high_;
    double scale_, fat_mm_;
    LatticeNoise noise_;
};

}  // namespace fluorocut
