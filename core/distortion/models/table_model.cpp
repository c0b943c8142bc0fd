#include "core/distortion/models/table_model.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>
#include <Eigen/QR>
#include <fmt/format.h>

#include "core/base/parallel.h"
#include "core/distortion/models/groove_data.h"
#include "core/distortion/models/triangle_polynomial.h"

namespace fluorocut {
namespace {

constexpr int kRound = 4;  // steps round the image
constexpr int kLeastNodes = 4, kMostNodes = 1024;

// Coefficients of the cubic spline through `values` with straight ends; columns of the result have two more.
Eigen::MatrixXd coefficientsOf(const Eigen::MatrixXd& values) {
    // (c[i-1] + 4 c[i] + c[i+1]) / 6 = f[i]; c[-1] = 2 c[0] - c[1] makes c[0] = f[0].
    const auto along = [](const Eigen::MatrixXd& f) {
        const Eigen::Index n = f.rows();
        Eigen::MatrixXd c(n + 2, f.cols());
        Eigen::VectorXd upper(n);  // Thomas's algorithm
        c.row(1) = f.row(0);
        upper[0] = 0;
        for (Eigen::Index i = 1; i + 1 < n; ++i) {
            const double pivot = 4 - upper[i - 1];
            upper[i] = 1 / pivot;
            c.row(i + 1) = (6 * f.row(i) - c.row(i)) / pivot;
        }
        c.row(n) = f.row(n - 1);
        for (Eigen::Index i = n - 2; i > 0; --i)
            c.row(i + 1) -= upper[i] * c.row(i + 2);
        c.row(0) = 2 * c.row(1) - c.row(2);
        c.row(n + 1) = 2 * c.row(n) - c.row(n - 1);
        return c;
    };
    return along(along(values).transpose()).transpose();
}

Eigen::Vector4d weights(double t) {
    const double s = 1 - t;
    return {s * s * s / 6, 2.0 / 3 - t * t * (1 - t / 2), 2.0 / 3 - s * s * (1 - s / 2), t * t * t / 6};
}

Eigen::Vector4d slopes(double t) {
    const double s = 1 - t;
    return {-s * s / 2, t * (1.5 * t - 2), -s * (1.5 * s - 2), t * t / 2};
}

// Gives the nodes that are not finite the values of a smooth surface through the rest.
bool fillHoles(Eigen::MatrixXd& nodes) {
    std::vector<std::pair<Eigen::Index, Eigen::Index>> known, lost;
    for (Eigen::Index j = 0; j < nodes.rows(); ++j) {
        for (Eigen::Index i = 0; i < nodes.cols(); ++i)
            (std::isfinite(nodes(j, i)) ? known : lost).emplace_back(j, i);
    }
    if (lost.empty()) return true;
    if (known.size() * 5 < static_cast<std::size_t>(nodes.size()) || known.size() < 20) return false;
    constexpr int kDegree = 3;
    const BernsteinTriangle triangle =
        BernsteinTriangle::around(static_cast<int>(nodes.cols()), static_cast<int>(nodes.rows()));
    const auto basis = [&](const auto& node) {
        return triangle.basis(kDegree, Vector2(static_cast<double>(node.second), static_cast<double>(node.first)));
    };
    Eigen::MatrixXd design(static_cast<Eigen::Index>(known.size()), BernsteinTriangle::size(kDegree));
    Eigen::VectorXd values(design.rows());
    for (Eigen::Index k = 0; k < design.rows(); ++k) {
        const auto& node = known[static_cast<std::size_t>(k)];
        design.row(k) = basis(node).transpose();
        values[k] = nodes(node.first, node.second);
    }
    const Eigen::VectorXd cubic = design.colPivHouseholderQr().solve(values);
    Eigen::MatrixXd rest = Eigen::MatrixXd::Zero(nodes.rows(), nodes.cols());
    for (const auto& node : known)
        rest(node.first, node.second) = nodes(node.first, node.second) - basis(node).dot(cubic);
    // Successive over-relaxation; beyond the border the surface is level.
    constexpr double kOver = 1.8;
    for (int sweep = 0; sweep < 300; ++sweep) {
        for (const auto& [j, i] : lost) {
            const double mean =
                0.25 * (rest(std::max<Eigen::Index>(j - 1, 0), i) + rest(std::min(j + 1, nodes.rows() - 1), i) +
                        rest(j, std::max<Eigen::Index>(i - 1, 0)) + rest(j, std::min(i + 1, nodes.cols() - 1)));
            rest(j, i) += kOver * (mean - rest(j, i));
        }
    }
    for (const auto& node : lost)
        nodes(node.first, node.second) = rest(node.first, node.second) + basis(node).dot(cubic);
    return true;
}

}  // namespace

TableModel::TableModel(const Vector2& corner_px, double step_px, Layers nodes)
    : corner_(corner_px),
      step_(step_px),
      nodes_(std::move(nodes)),
      x_(coefficientsOf(nodes_[0])),
      y_(coefficientsOf(nodes_[1])) {}

std::shared_ptr<const TableModel> TableModel::sampled(int columns, int rows, double step_px,
                                                      const std::function<Vector2(const Vector2&)>& value,
                                                      const std::function<Matrix2(const Vector2&)>& covariance) {
    const Vector2 corner = Vector2::Constant(-kRound * step_px);
    const auto count = [&](int pixels) {
        return static_cast<Eigen::Index>(std::ceil((pixels - 1) / step_px)) + 1 + 2 * kRound;
    };
    const Eigen::Index across = count(columns), down = count(rows);
    Layers nodes;
    nodes.fill(Eigen::MatrixXd(down, across));
    parallelFor(static_cast<std::size_t>(down), 4, [&](std::size_t begin, std::size_t end) {
        for (auto j = static_cast<Eigen::Index>(begin); j < static_cast<Eigen::Index>(end); ++j) {
            for (Eigen::Index i = 0; i < across; ++i) {
                const Vector2 pixel = corner + step_px * Vector2(static_cast<double>(i), static_cast<double>(j));
                const Vector2 at = value(pixel);
                const Matrix2 spread = covariance(pixel);
                nodes[0](j, i) = at.x();
                nodes[1](j, i) = at.y();
                nodes[2](j, i) = spread(0, 0);
                nodes[3](j, i) = spread(0, 1);
                nodes[4](j, i) = spread(1, 1);
            }
        }
    });
    if (!fillHoles(nodes[0]) || !fillHoles(nodes[1])) return nullptr;
    for (std::size_t layer = 2; layer < 5; ++layer) {
        double largest = 0;
        for (const double one : nodes[layer].reshaped()) {
            if (std::isfinite(one)) largest = std::max(largest, one);
        }
        for (double& one : nodes[layer].reshaped()) {
            if (!std::isfinite(one)) one = layer == 3 ? 0 : largest;
        }
    }
    return std::make_shared<const TableModel>(corner, step_px, std::move(nodes));
}

TableModel::Place TableModel::place(const Vector2& pixel) const {
    const auto along = [](double at, Eigen::Index count, int& node, double& rest) {
        at = std::clamp(at, 0.0, static_cast<double>(count - 1));
        node = static_cast<int>(std::min(at, static_cast<double>(count - 2)));
        rest = at - node;
    };
    Place place{};
    const Vector2 steps = (pixel - corner_) / step_;
    along(steps.x(), nodes_[0].cols(), place.column, place.s);
    along(steps.y(), nodes_[0].rows(), place.row, place.t);
    return place;
}

Vector2 TableModel::plateFromPixel(const Vector2& pixel) const {
    if (!pixel.allFinite()) return Vector2::Constant(std::numeric_limits<double>::quiet_NaN());
    const Place at = place(pixel);
    const Eigen::Vector4d across = weights(at.s), down = weights(at.t);
    return {down.dot(x_.block<4, 4>(at.row, at.column) * across), down.dot(y_.block<4, 4>(at.row, at.column) * across)};
}

Matrix2 TableModel::jacobian(const Vector2& pixel) const {
    if (!pixel.allFinite()) return Matrix2::Constant(std::numeric_limits<double>::quiet_NaN());
    const Place at = place(pixel);
    const Eigen::Vector4d across = weights(at.s), down = weights(at.t);
    const Eigen::Matrix4d x = x_.block<4, 4>(at.row, at.column), y = y_.block<4, 4>(at.row, at.column);
    Matrix2 result;
    result << down.dot(x * slopes(at.s)), slopes(at.t).dot(x * across), down.dot(y * slopes(at.s)),
        slopes(at.t).dot(y * across);
    return result / step_;
}

Matrix2 TableModel::covariance(const Vector2& pixel) const {
    if (!pixel.allFinite()) return Matrix2::Constant(std::numeric_limits<double>::quiet_NaN());
    const Place at = place(pixel);
    const auto linear = [&](const Eigen::MatrixXd& n) {
        const auto four = n.block<2, 2>(at.row, at.column);
        return (1 - at.t) * ((1 - at.s) * four(0, 0) + at.s * four(0, 1)) +
               at.t * ((1 - at.s) * four(1, 0) + at.s * four(1, 1));
    };
    Matrix2 result;
    result << linear(nodes_[2]), linear(nodes_[3]), linear(nodes_[3]), linear(nodes_[4]);
    return result;
}

DistortionModel::Fields TableModel::parameters() const {
    Fields fields = {{"corner_px", {corner_.x(), corner_.y()}},
                     {"step_px", {step_}},
                     {"nodes", {static_cast<double>(nodes_[0].cols()), static_cast<double>(nodes_[0].rows())}}};
    const std::array<std::string, 5> names = {"x_mm", "y_mm", "xx_mm2", "xy_mm2", "yy_mm2"};
    for (std::size_t layer = 0; layer < 5; ++layer) {
        const Eigen::MatrixXd by_rows = nodes_[layer].transpose();
        fields.push_back({names[layer], {by_rows.data(), by_rows.data() + by_rows.size()}});
    }
    return fields;
}

std::shared_ptr<const DistortionModel> TableModel::read(JsonObject& parameters) {
    const Vector2 corner = parameters.vector<2>("corner_px");
    const std::vector<double> step = parameters.numbers("step_px", 1), size = parameters.numbers("nodes", 2);
    if (parameters.failed()) return nullptr;
    if (!(corner.cwiseAbs().maxCoeff() <= 1e6)) parameters.fail("corner_px", "a place far away", "one near the image");
    if (!(step[0] >= 0.5 && step[0] <= 1e4)) {
        parameters.fail("step_px", fmt::format("{}", step[0]), "0.5 to 10000 px");
    }
    for (const double one : size) {
        if (!(one >= kLeastNodes && one <= kMostNodes && one == std::floor(one))) {
            parameters.fail("nodes", fmt::format("{}", one), fmt::format("{} to {}", kLeastNodes, kMostNodes));
        }
    }
    if (parameters.failed()) return nullptr;
    const auto across = static_cast<Eigen::Index>(size[0]), down = static_cast<Eigen::Index>(size[1]);
    Layers nodes;
    const std::array<std::string, 5> names = {"x_mm", "y_mm", "xx_mm2", "xy_mm2", "yy_mm2"};
    for (std::size_t layer = 0; layer < 5; ++layer) {
        const std::vector<double> values = parameters.numbers(names[layer], static_cast<std::size_t>(across * down));
        if (parameters.failed()) return nullptr;
        nodes[layer] = Eigen::Map<const Eigen::MatrixXd>(values.data(), across, down).transpose();
    }
    if (!(nodes[2].minCoeff() >= 0 && nodes[4].minCoeff() >= 0)) {
        parameters.fail("xx_mm2", "a negative variance", "none below 0");
        return nullptr;
    }
    return std::make_shared<TableModel>(corner, step[0], std::move(nodes));
}

}  // namespace fluorocut
