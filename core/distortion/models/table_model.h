// A map as a table: bicubic B-splines through its values on a coarse square grid, its covariance interpolated linearly.
// Made from other maps (interpolated between poses), or stands in for a model with holes; never fitted to points.
//
// parameters: corner_px [u, v] of the first node, step_px [h], nodes [across, down], x_mm and y_mm (values at the
// nodes, row by row), xx_mm2, xy_mm2, yy_mm2 (covariance at the nodes). The splines run straight on (second derivative
// zero) at the border, which lies outside the image; beyond it the map is that of the border.
#pragma once

#include <functional>

#include <Eigen/Core>

#include "core/distortion/distortion_model.h"

namespace fluorocut {

class TableModel final : public DistortionModel {
  public:
    // x, y, and the covariance's xx, xy, yy at the nodes (row: v, column: u).
    using Layers = std::array<Eigen::MatrixXd, 5>;

    TableModel(const Vector2& corner_px, double step_px, Layers nodes);

    // Samples functions all over an image and four steps round it. Where `value` is not finite, a smooth surface takes
    // its place: a cubic through the rest, and Laplace's equation for what remains. Null when less than a fifth of the
    // nodes have values. What is not finite of the covariance is taken from the largest that is.
    static std::shared_ptr<const TableModel> sampled(int columns, int rows, double step_px,
                                                     const std::function<Vector2(const Vector2&)>& value,
                                                     const std::function<Matrix2(const Vector2&)>& covariance);

    std::string_view name() const override { return "table"; }
    Vector2 plateFromPixel(const Vector2& pixel) const override;
    Matrix2 jacobian(const Vector2& pixel) const override;
    Matrix2 covariance(const Vector2& pixel) const override;
    bool answersEverywhere() const override { return true; }
    Fields parameters() const override;

    static std::shared_ptr<const DistortionModel> read(JsonObject& parameters);

  private:
    struct Place {
        int column, row;  // of the node before
        double s, t;      // from there, in steps
    };
    Place place(const Vector2& pixel) const;

    Vector2 corner_;
    double step_;
    Layers nodes_;
    Eigen::MatrixXd x_, y_;  // B-spline coefficients, one more on every side
};

}  // namespace fluorocut
