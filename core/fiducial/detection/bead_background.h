// What lies behind a bead: the log intensity around it, continued below it. Pixels.
//
// A plane; and where a lattice of lines explains much more, a plane + p(x') + q(y') with free functions p, q of the
// coordinates along two perpendicular axes (fitted in turn, as in a two-way analysis of variance): grooves of a plate
// that pass below the bead are known from their course beside it.
//
// Grooves that are milled do not add where they cross: the union is cut away. With crossings the model is, in intensity
// relative to the plane's, plane + p + q + c p q: c is Tukey's one degree of freedom for non-additivity (Biometrics 5,
// 1949). Of the two models the one stays that explains the bead's surroundings better.
#pragma once

#include <complex>
#include <vector>

#include "core/geometry/rigid3.h"
#include "core/image/image.h"

namespace fluorocut::detection {

struct Disk {
    Vector2 center_px;
    double radius_px;
};

// Directions of edges all over the image, as sums of |gradient|^2 exp(4 i angle) over cells: perpendicular lines add
// up, round things cancel.
class LatticeDirections {
  public:
    explicit LatticeDirections(const Image& log_intensity);
    // Angle of one of the two axes at a place, in [-pi/4, pi/4].
    double angleAt(const Vector2& place_px) const;

  private:
    static constexpr int kCell = 16;
    int columns_, rows_;
    std::vector<std::complex<double>> cells_;
};

struct BackgroundPatch {
    int left = 0;  // of the patch in the image
    int top = 0;
    Image log_level;  // background, also below the bead
    Mask usable;      // 1: inside the image and on no other bead
    bool lattice = false;
    double contrast = 0;  // mean of level - log intensity over the bead's inner half
    double noise = 0;     // robust standard deviation of log intensity about the background, outside the bead
    bool valid = false;
};

// `half_px` is half the patch's size; `bead` is left out, and `others` where they cannot be part of a lattice.
// `crossings`: tries that model as well.
BackgroundPatch backgroundAround(const Image& log_intensity, const LatticeDirections& directions, const Disk& bead,
                                 const std::vector<Disk>& others, int half_px, bool crossings);

}  // namespace fluorocut::detection
