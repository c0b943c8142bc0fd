// The radial profile of a bead's shadow, and its derivatives:
//     g(d) = Gaussian(blur) * (1 - exp(-k sqrt(1 - (d/R)^2))) / (1 - exp(-k)),   0 outside of R,   g(0) = 1 without
//     blur
// The blur of a radial function is an integral over the radius (the angle's integral is a Bessel function):
//     g(d) = int_0^R f(r) r/s^2 exp(-(r - d)^2 / 2 s^2) I0e(r d / s^2) dr,   I0e(x) = exp(-x) I0(x)
// done with r = R sin(t), which takes the square root away, by Gauss-Legendre panels, then tabulated over d and
// interpolated by cubics: absolute error below 1e-4. px.
#pragma once

#include <vector>

namespace fluorocut::detection {

struct BeadShape {
    double radius_px;
    double log_steepness;  // ln k
    double log_blur;       // ln(blur_px)
};

// Value and derivatives at one distance.
struct ProfilePoint {
    double value = 0;
    double by_distance = 0;
    double by_radius = 0;
    double by_log_steepness = 0;
    double by_log_blur = 0;
};

class BeadProfile {
  public:
    explicit BeadProfile(const BeadShape& shape);
    ProfilePoint at(double distance_px) const;

  private:
    double step_;
    std::vector<ProfilePoint> table_;  // at (i - 1) * step_; by_distance is not filled in
};

// I0e(x) = exp(-x) I0(x), x >= 0, to 2e-7 (Abramowitz and Stegun 9.8.1, 9.8.2).
double scaledBesselI0(double x);

}  // namespace fluorocut::detection
