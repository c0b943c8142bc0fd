// The soft tissue around a hip and upper thigh: skin, subcutaneous fat, and muscles that lie against each other with
// thin planes of fat between. Frame `bone` (femur_shape.h), mm, HU.
//
// The skin is a tapering thigh joined to the trunk. Muscles are bars of varying thickness along their course from
// origin to insertion; a point belongs to the nearest one (measured from its surface), and where two are nearly equally
// near lies the fat between them. What no muscle claims is fat.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/geometry/rigid3.h"
#include "core/simulation/lattice_noise.h"

namespace fluorocut {

class SoftTissue {
  public:
    // `scale` 1 goes with a femoral head of 46 mm; `head_center` moves the muscles of the hip with the joint.
    SoftTissue(double scale, const Vector3& head_center, double fat_mm, std::uint64_t seed);

    static constexpr double kFatHu = -100;
    static constexpr double kMuscleHu = 55;

    // The tissue within a small box (some mm), where only a few muscles are near and the skin, the bending of the
    // muscles and slow variations are linear enough to be interpolated from the corners: ten times faster than point by
    // point.
    class Box {
      public:
        // Signed distance to the skin, and HU at a point inside it.
        double skin(const Vector3& p) const;
        double tissue(const Vector3& p) const;
        bool allOutside(double margin_mm) const { return lowest_skin_ > margin_mm; }
        bool allInside(double margin_mm) const { return highest_skin_ < -margin_mm; }

      private:
        friend class SoftTissue;
        struct Slow {
            double skin, variation, fat_thickness;
            Vector3 bent;  // p, moved by the bending
        };
        Slow slow(const Vector3& p) const;

        const SoftTissue* owner_ = nullptr;
        Vector3 low_, size_;
        std::array<Slow, 8> corners_;
        std::vector<std::size_t> near_;              // muscles that can matter here
        double lowest_skin_ = 0, highest_skin_ = 0;  // of the corners
    };
    Box box(const Vector3& low, const Vector3& high) const;

  private:
    struct Muscle {
        Vector3 from, to;
        double radius_from, radius_to;
        int owner;  // bars of one muscle have no fat between them

        double distance(const Vector3& p) const;
    };
    double skin(const Vector3& p) const;
    Box::Slow slowAt(const Vector3& p) const;

    std::vector<Muscle> muscles_;
    double scale_, fat_mm_;
    LatticeNoise noise_;
};

}  // namespace fluorocut
