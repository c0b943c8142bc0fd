// LatticeMap: where a pixel lies in the lattice of grooves, in pitches, as two polynomials in the pixel. The coarse
// model that detection grows and steps along; not the model of the distortion.
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
    static constexpr int kMaxOrder = 5;

    // Polynomials of total degree up to `order` in (pixel - center) / radius.
    LatticeMap(int order, const Vector2& center, double radius);

    // Robust least squares (Tukey's weights, cut at `cut` robust standard deviations, at least `least_cut`) of one
    // coordinate. False when the samples cannot hold a polynomial of this order.
    bool fit(int coordinate, std::span<const LatticeSample> samples, double least_cut);

    // All values times `scale`, plus `shift`.
    LatticeMap transformed(double scale, const Vector2& shift) const;
    // The same lattice in an image whose pixels are `factor` times smaller.
    LatticeMap magnified(int factor) const;

    Vector2 at(const Vector2& pixel) const;
    LatticePlace place(const Vector2& pixel) const;
    // Newton from `start`; nothing when that leaves the neighbourhood of `start` (3 pitches) or does not settle.
    std::optional<Vector2> pixelOf(const Vector2& lattice, const Vector2& start) const;

    int order() const { return order_; }

    static int coefficientCount(int order) { return (order + 1) * (order + 2) / 2; }

  private:
    using Coefficients = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, (kMaxOrder + 1) * (kMaxOrder + 2) / 2, 1>;

    Coefficients basis(const Vector2& pixel) const;

    int order_;
    Vector2 center_;
    double radius_;
    std::array<Coefficients, 2> coefficients_;
};

}  // namespace fluorocut::grooves
