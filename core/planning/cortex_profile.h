// One ray through a bone's wall: where its cortex begins and ends (core/planning/bone_walls.h has the model). mm from
// the ray's start in the marrow, HU.
#pragma once

#include <limits>
#include <optional>
#include <vector>

namespace fluorocut {

struct CortexProfile {
    double step_mm = 0.2;
    double exit_mm = 0;  // where the ray leaves the bone, within a voxel
    std::vector<float> hounsfield;

    double at(double r_mm) const;  // linear; the ends repeat themselves
    double peak() const;           // before the exit
    // The cortex's own density and the blur of its outer edge where it is thick: above `threshold_hu` for at least
    // `thick_mm` up to the exit.
    struct Thick {
        double hounsfield, blur_mm;
    };
    std::optional<Thick> plateau(double threshold_hu, double thick_mm) const;
};

struct CortexWalls {
    double inner_mm = std::numeric_limits<double>::quiet_NaN();
    double outer_mm = std::numeric_limits<double>::quiet_NaN();
};

// `model`: by the blurred box; otherwise where the profile passes half of its height.
CortexWalls cortexWalls(const CortexProfile& profile, double cortical_hu, double blur_mm, bool model);

}  // namespace fluorocut
