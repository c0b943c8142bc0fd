// What fills a femur: cortical bone, trabeculae along the lines of stress, marrow. Frame `bone` (femur_shape.h), mm,
// HU.
//
// Trabecular groups after Ward 1838 and Singh 1970: the principal compressive group runs from the medial cortex
// (calcar) as a fan to the top of the head; the principal tensile group arches from the lateral cortex below the
// greater trochanter through the upper neck to the lower half of the head; secondary compressive and greater-trochanter
// groups are weaker; between them Ward's triangle is nearly empty. Distally trabeculae withdraw to the endosteum and
// leave fatty marrow. The texture is noise stretched along each group, several mm deep across it, since trabeculae are
// plates there.
#pragma once

#include <cstdint>
#include <vector>

#include "core/simulation/femur_shape.h"
#include "core/simulation/lattice_noise.h"

namespace fluorocut {

struct BoneDensities {
    double cortical_hu = 1500;   // 1200-1800 in adults
    double trabecular_hu = 230;  // mean of the head between the groups; 100-500 in adults
    double marrow_hu = -40;      // fatty marrow of the shaft, -50 to 0
};

class FemurTissue {
  public:
    FemurTissue(const FemurShape& shape, const BoneDensities& densities, std::uint64_t seed);

    double cortical(const Vector3& p) const;
    // `depth_mm` below the endosteal surface.
    double inside(const Vector3& p, double depth_mm) const;

  private:
    // A bundle of trabeculae along a curve in the neck's plane.
    struct Group {
        std::vector<Vector2> curve;  // (medial, up), mm
        double width_begin, width_end;
        double strength;
    };
    // Along the curve, across it (signed), mm, and which fraction of its length.
    struct Place {
        double along, across, fraction;
    };
    static Place locate(const Group& group, const Vector2& at);

    const FemurShape& shape_;
    BoneDensities densities_;
    Vector3 medial_, across_;
    std::vector<Group> groups_;
    LatticeNoise fine_, coarse_;
};

}  // namespace fluorocut
