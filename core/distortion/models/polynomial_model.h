// The global polynomial: x and y on the plate are each one polynomial of total degree `order` in the pixel's
// coordinates, in the Bernstein basis on a triangle round the image (triangle_polynomial.h). x is fitted to the points
// of the grooves along y, y to those along x: each point constrains one coordinate and the problem stays linear.
//
// Covariance: noise, and what the order cannot follow. With C_n the covariance of the fitted polynomial (robust_fit.h)
// and C_N that of one of degree N = n + 2 to the same points, the share of the residuals that the degrees above n
// explain, F = (S_n - S_N) / (q s^2), is 1 when they hold noise only. They are taken for random with the variance that
// the data show them to have:
//     C = C_n + max(0, F - 1) (C_N - C_n)
// Held as the upper triangular root U of C = U^T U in the basis of degree N, so that it cannot turn negative.
//
// parameters: order [n], covariance_order [N], triangle_px [u0, v0, u1, v1, u2, v2], x_mm and y_mm [coefficients; that
// of B_ijk at i (n + 1) - i (i - 1) / 2 + j], x_covariance_root and y_covariance_root [U row by row from the diagonal].
#pragma once

#include <array>

#include "core/distortion/distortion_model.h"
#include "core/distortion/models/triangle_polynomial.h"

namespace fluorocut {

class PolynomialModel final : public DistortionModel {
  public:
    static constexpr int kMaxOrder = 9, kExtraDegrees = 2;

    struct Coordinate {
        Eigen::VectorXd coefficients;
        Eigen::MatrixXd covariance_root;  // upper triangular
    };

    PolynomialModel(const BernsteinTriangle& triangle, int order, int covariance_order,
                    std::array<Coordinate, 2> coordinates);

    int order() const { return order_; }

    std::string_view name() const override { return "polynomial"; }
    Vector2 plateFromPixel(const Vector2& pixel) const override;
    Matrix2 jacobian(const Vector2& pixel) const override;
    Matrix2 covariance(const Vector2& pixel) const override;
    void plateFromRow(const Vector2& first, double step, std::span<Vector2> plate) const override;
    bool answersEverywhere() const override { return true; }
    Fields parameters() const override;

    static std::shared_ptr<const DistortionModel> read(JsonObject& parameters);

  private:
    using Powers = std::array<double, (kMaxOrder + 1) * (kMaxOrder + 1)>;  // of x^i y^j at i * (order + 1) + j

    BernsteinTriangle triangle_;
    int order_, covariance_order_;
    std::array<Coordinate, 2> coordinates_;
    std::array<Powers, 2> powers_;
};

Result<FittedModel> fitPolynomialModel(const GroovePoints& points, const DistortionFitOptions& options,
                                       Progress& progress);

}  // namespace fluorocut
