// Thin-plate regression spline: x and y on the plate are each a smoothing spline with few knots,
//
//     f(p) = cubic(p) + sum_k d_k r_k^2 log(r_k^2),     r_k = |p - knot_k|,   sum d = 0,  sum d knot = 0,
//
// that minimises  sum ((value - f) / sigma)^2 + lambda * bending energy  (Duchon 1977; Wood, Generalized Additive
// Models, 2017, 5.5). The energy is that of the second term; the cubic is
// not penalised: pincushion is one, and a penalty on it costs 40 % more error (measured). lambda is chosen by
// restricted maximum likelihood, with the bending part as a random effect (Wood 2011); false points are rejected by a
// robust polynomial first and then by Tukey's weights on the spline's own residuals.
//
// Covariance: the posterior of that random effect, s^2 (A^T A + lambda P)^-1 (Wahba 1983; Nychka 1988): averaged over
// the field its regions hold noise and smoothing bias alike.
//
// parameters: centre_px [u, v] and unit_px [h]: coordinates are (p - centre) / h; knots [u0, v0, u1, ...] in them; x_mm
// and y_mm [of 1, u, v, uu, uv, vv, uuu, uuv, uvv, vvv; d_0, ...]; x_covariance_root and y_covariance_root [upper
// triangle row by row].
#pragma once

#include <array>

#include <Eigen/Core>

#include "core/distortion/distortion_model.h"

namespace fluorocut {

class ThinPlateSplineModel final : public DistortionModel {
  public:
    struct Coordinate {
        Eigen::VectorXd coefficients;
        Eigen::MatrixXd covariance_root;  // upper triangular
    };

    ThinPlateSplineModel(const Vector2& centre_px, double unit_px, std::vector<Vector2> knots,
                         std::array<Coordinate, 2> coordinates);

    std::string_view name() const override { return "thin-plate-spline"; }
    Vector2 plateFromPixel(const Vector2& pixel) const override;
    Matrix2 jacobian(const Vector2& pixel) const override;
    Matrix2 covariance(const Vector2& pixel) const override;
    bool answersEverywhere() const override { return true; }
    Fields parameters() const override;

    static std::shared_ptr<const DistortionModel> read(JsonObject& parameters);

  private:
    Vector2 centre_;
    double unit_;
    std::vector<Vector2> knots_;
    std::array<Coordinate, 2> coordinates_;
};

Result<FittedModel> fitThinPlateSplineModel(const GroovePoints& points, const DistortionFitOptions& options,
                                            Progress& progress);

}  // namespace fluorocut
