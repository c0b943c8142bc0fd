// The paper's model: each groove's middle line is a polynomial curve in the Bernstein basis (equation 5), and what lies
// between the curves follows from a cubic spline across them on each scan line.
//
//     s = sum_k a_k binomial(5, k) (1 - t)^(5-k) t^k,      t in [0, 1] along the groove's piece that was seen      (5)
//
// s and t are pixels across and along the grooves in axes turned to the plate's, so that a plate may lie at any angle;
// t is scaled to each groove's own ends. A groove with fewer than 12 points gets the order 3, with fewer than 8 none.
// A scan line crosses the curves at s_i, where x = i * pitch: the spline through (s_i, x_i), with its third derivative
// continuous at the first and last inner knot ("not-a-knot"), gives x; y alike from the grooves along x.
// NaN outside the outermost curves, beyond the curves' ends, and where fewer than 4 are crossed or they cross.
//
// False points are rejected beforehand, by a robust polynomial through all points; a single groove has too few to tell.
// Covariance: of the curves at the crossings (noise pooled over all grooves), carried through the spline's weights.
//
// parameters: centre_px, turn_rad [angle of the plate's x axis in the image], and x_curves, y_curves: for each groove
// [value mm, begin px, end px, order n, a_0 ... a_n, root of their covariance: upper triangle row by row].
#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

#include "core/distortion/distortion_model.h"

namespace fluorocut {

struct GrooveCurve {
    using Basis = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 6, 1>;  // of order 5 at most

    double value_mm = 0;
    double begin_px = 0, end_px = 0;  // along it
    Basis coefficients;               // px across
    Eigen::MatrixXd covariance_root;  // upper triangular

    Basis basis(double along_px) const;
    double across(double along_px) const { return basis(along_px).dot(coefficients); }
};

class BernsteinModel final : public DistortionModel {
  public:
    // curves[0]: of the grooves along y, by value; curves[1]: of those along x.
    BernsteinModel(const Vector2& centre_px, double turn_rad, std::array<std::vector<GrooveCurve>, 2> curves);

    std::string_view name() const override { return "bernstein"; }
    Vector2 plateFromPixel(const Vector2& pixel) const override;
    Matrix2 jacobian(const Vector2& pixel) const override;
    Matrix2 covariance(const Vector2& pixel) const override;
    bool answersEverywhere() const override { return false; }
    Fields parameters() const override;

    // The curve of a groove in the image, for pictures: `count` points from end to end.
    std::vector<Vector2> curvePixels(const GrooveCurve& curve, bool along_y, int count) const;
    const std::array<std::vector<GrooveCurve>, 2>& curves() const { return curves_; }

    static std::shared_ptr<const DistortionModel> read(JsonObject& parameters);

  private:
    // (across, along) of a pixel for the curves of one direction.
    Vector2 local(int axis, const Vector2& pixel) const;
    // The plate's coordinate at (across, along) from the curves that reach `reach_along`; NaN without an answer.
    double value(int axis, const Vector2& at, double reach_along) const;
    double variance(int axis, const Vector2& at) const;

    Vector2 centre_;
    double turn_rad_;
    Matrix2 plate_axes_;  // rows: the plate's axes in the image
    std::array<std::vector<GrooveCurve>, 2> curves_;
};

Result<FittedModel> fitBernsteinModel(const GroovePoints& points, const DistortionFitOptions& options,
                                      Progress& progress);

}  // namespace fluorocut
