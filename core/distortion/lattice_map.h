// LatticeMap: where a pixel lies in the lattice of grooves, in pitches, as two polynomials of degree 5 in the pixel.
// The coarse model that detection grows and steps along; not the model of the distortion.
//
// A polynomial of degree 5 through half a field knows nothing of the other half, unless it is told how images bend.
// The coefficients therefore have a prior: normal, of mean zero above the linear terms, of the size that image
// intensifiers show (a few percent of the field's radius at the rim). What the map says far from its samples is then
// the most plausible, and `sigma` says how plausible: whether a groove seen beyond a gap can be numbered.
#pragma once

#include <array>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "core/geometry/rigid3.h"

namespace fluorocut::grooves {

// Value c(pixel) that one coordinate should have at a pixel.
struct LatticeSample {
    Vector2 pixel = Vector2::Zero();
    double value = 0;
    double weight = 1;
};

struct LatticePlace {
    Vector2 lattice = Vector2::Zero();
    Eigen::Matrix2d jacobian = Eigen::Matrix2d::Zero();  // d lattice / d pixel
    std::array<Eigen::Matrix2d, 2> hessian = {Eigen::Matrix2d::Zero(), Eigen::Matrix2d::Zero()};
};

class LatticeMap {
  public:
    static constexpr int kOrder = 5;
    static constexpr int kTerms = (kOrder + 1) * (kOrder + 2) / 2;

    // Polynomials in (pixel - center) / radius. `jacobian`: d lattice / d pixel as far as it is known (to about 15 %).
    LatticeMap(const Vector2& center, double radius, const Eigen::Matrix2d& jacobian);

    // Robust least squares (Tukey's weights, cut at 4 robust standard deviations, at least `least_cut`) of one
    // coordinate; weights are inverse variances (per pitch^2). False when there is nothing to fit.
    bool fit(int coordinate, std::span<const LatticeSample> samples, double least_cut);

    // Standard deviation of a value, pitches, as the prior and the samples leave it.
    double sigma(int coordinate, const Vector2& pixel) const;

    // All values times `scale`, plus `shift`.
    LatticeMap transformed(double scale, const Vector2& shift) const;
    // The same lattice in an image whose pixels are `factor` times smaller.
    LatticeMap magnified(int factor) const;

    Vector2 at(const Vector2& pixel) const;
    LatticePlace place(const Vector2& pixel) const;
    // Newton from `start`; nothing when that leaves the neighbourhood of `start` (3 pitches) or does not settle.
    std::optional<Vector2> pixelOf(const Vector2& lattice, const Vector2& start) const;

  private:
    using Terms = Eigen::Matrix<double, kTerms, 1>;
    using Square = Eigen::Matrix<double, kTerms, kTerms>;

    Terms basis(const Vector2& pixel) const;

    Vector2 center_;
    double radius_;
    std::array<Terms, 2> prior_mean_;
    Terms prior_precision_;
    std::array<Terms, 2> coefficients_;
    std::array<Square, 2> covariance_;
};

}  // namespace fluorocut::grooves
