// What a revision surgeon finds after taking a stem out: head and neck gone, a stem-shaped cavity, widened by
// loosening, with a sclerotic rim, remains of the cement mantle along its wall and, perhaps, lytic defects. Frame
// `bone` (femur_shape.h), mm, HU.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "core/simulation/femur_shape.h"
#include "core/simulation/lattice_noise.h"

namespace fluorocut {

struct ImplantRemoval {
    double resection_height_mm = 14;  // of the neck cut above the lesser trochanter, at the medial cortex
    double stem_length_mm = 120;      // of the cavity, from the cut down
    double widening_mm = 1.0;         // of the cavity beyond the old stem and its mantle: what loosening wore away
    double cement_coverage = 0.4;     // fraction of the cavity's wall that still carries cement, 0 to 1
    double cement_hu = 1100;          // PMMA with 10 % barium sulphate
    double filling_hu = 40;           // blood and fluid; -1000 for air
    int lytic_defects = 2;            // granulomas eaten into the wall, 0 to 8
    // Names the field, the value and the limit.
    Result<void> validate() const;
};

inline const Vector3 kNotSet = Vector3::Constant(std::numeric_limits<double>::quiet_NaN());

// Facts, in the CT's frame, mm.
struct RemovedImplantFacts {
    Vector3 resection_point;           // on the plane of the neck cut
    Vector3 resection_normal;          // unit, toward the removed head
    std::vector<Vector3> cavity_axis;  // centres of the cavity, from the cut to the tip
};

class RemovedImplant {
  public:
    RemovedImplant(const FemurShape& shape, const ImplantRemoval& options, double isthmus_canal_mm, std::uint64_t seed);

    // Negative where bone was cut off with the head and neck.
    double resected(const Vector3& p) const;
    // Negative inside the cavity, cement remains and lytic defects included. It never breaks through the cortex:
    // `outer_mm` is the shape's outer(p), a thin wall is left.
    double cavity(const Vector3& p, double outer_mm) const;
    // HU inside the cavity.
    double filling(const Vector3& p) const;
    // Negative in the plug of cement that closes the canal below the old tip.
    double plug(const Vector3& p) const;
    // How sclerotic spongy bone is at a distance outside the cavity: 0 to 1.
    double sclerosis(double distance_mm) const;

    const RemovedImplantFacts& facts() const { return facts_; }

  private:
    struct Level {
        Vector3 center;
        double half_x, half_y;
    };
    Level level(double z) const;
    double stemCavity(const Vector3& p) const;

    const FemurShape& shape_;
    ImplantRemoval options_;
    RemovedImplantFacts facts_;
    double top_z_, tip_z_, tip_radius_, lateral_x_;
    struct Defect {
        Vector3 center, half;
    };
    std::vector<Defect> defects_;
    LatticeNoise noise_;
};

}  // namespace fluorocut
