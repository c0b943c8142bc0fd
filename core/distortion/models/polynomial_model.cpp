#include "core/distortion/models/polynomial_model.h"

#include <algorithm>
#include <set>

#include <Eigen/QR>
#include <fmt/format.h>

#include "core/distortion/models/groove_data.h"
#include "core/distortion/models/robust_fit.h"

namespace fluorocut {

PolynomialModel::PolynomialModel(const BernsteinTriangle& triangle, int order, int covariance_order,
                                 std::array<Coordinate, 2> coordinates)
    : triangle_(triangle), order_(order), covariance_order_(covariance_order), coordinates_(std::move(coordinates)) {
    for (std::size_t c = 0; c < 2; ++c) {
        const Eigen::MatrixXd powers = triangle_.powers(order, coordinates_[c].coefficients);
        powers_[c].fill(0);
        for (int i = 0; i <= order; ++i) {
            for (int j = 0; j <= order; ++j)
                powers_[c][static_cast<std::size_t>(i * (order + 1) + j)] = powers(i, j);
        }
    }
}

Vector2 PolynomialModel::plateFromPixel(const Vector2& pixel) const {
    Vector2 plate;
    plateFromRow(pixel, 0, {&plate, 1});
    return plate;
}

void PolynomialModel::plateFromRow(const Vector2& first, double step, std::span<Vector2> plate) const {
    const Vector2 at = triangle_.local(first);
    const double step_x = step / triangle_.scale();
    const std::size_t n = static_cast<std::size_t>(order_);
    // On a row each coordinate is a polynomial in x alone.
    double row[2][kMaxOrder + 1];
    for (std::size_t c = 0; c < 2; ++c) {
        for (std::size_t i = 0; i <= n; ++i) {
            const double* powers = &powers_[c][i * (n + 1)];
            double sum = powers[n - i];
            for (std::size_t j = n - i; j-- > 0;)
                sum = sum * at.y() + powers[j];
            row[c][i] = sum;
        }
    }
    for (std::size_t p = 0; p < plate.size(); ++p) {
        const double x = at.x() + step_x * static_cast<double>(p);
        double sum_x = row[0][n], sum_y = row[1][n];
        for (std::size_t i = n; i-- > 0;) {
            sum_x = sum_x * x + row[0][i];
            sum_y = sum_y * x + row[1][i];
        }
        plate[p] = {sum_x, sum_y};
    }
}

Matrix2 PolynomialModel::jacobian(const Vector2& pixel) const {
    const Vector2 at = triangle_.local(pixel);
    const std::size_t n = static_cast<std::size_t>(order_);
    Matrix2 result;
    for (std::size_t c = 0; c < 2; ++c) {
        double along_x = 0, along_y = 0, value = 0;  // Horner's rule in x, of the rows' values and derivatives in y
        for (std::size_t i = n + 1; i-- > 0;) {
            const double* powers = &powers_[c][i * (n + 1)];
            double row = powers[n - i], slope = 0;
            for (std::size_t j = n - i; j-- > 0;) {
                slope = slope * at.y() + row;
                row = row * at.y() + powers[j];
            }
            along_x = along_x * at.x() + value;
            value = value * at.x() + row;
            along_y = along_y * at.x() + slope;
        }
        result.row(static_cast<Eigen::Index>(c)) << along_x, along_y;
    }
    return result / triangle_.scale();
}

Matrix2 PolynomialModel::covariance(const Vector2& pixel) const {
    const Eigen::VectorXd basis = triangle_.basis(covariance_order_, pixel);
    Matrix2 result = Matrix2::Zero();
    for (int c = 0; c < 2; ++c) {
        const auto& root = coordinates_[static_cast<std::size_t>(c)].covariance_root;
        result(c, c) = (root.triangularView<Eigen::Upper>() * basis).squaredNorm();
    }
    return result;
}

DistortionModel::Fields PolynomialModel::parameters() const {
    Fields fields = {{"order", {static_cast<double>(order_)}},
                     {"covariance_order", {static_cast<double>(covariance_order_)}},
                     {"triangle_px", {}}};
    for (const Vector2& corner : triangle_.corners())
        fields.back().second.insert(fields.back().second.end(), {corner.x(), corner.y()});
    for (std::size_t c = 0; c < 2; ++c) {
        const Coordinate& coordinate = coordinates_[c];
        const std::string axis = c == 0 ? "x" : "y";
        fields.push_back({axis + "_mm", {coordinate.coefficients.begin(), coordinate.coefficients.end()}});
        std::vector<double> root;
        for (Eigen::Index i = 0; i < coordinate.covariance_root.rows(); ++i) {
            for (Eigen::Index j = i; j < coordinate.covariance_root.cols(); ++j)
                root.push_back(coordinate.covariance_root(i, j));
        }
        fields.push_back({axis + "_covariance_root", std::move(root)});
    }
    return fields;
}

std::shared_ptr<const DistortionModel> PolynomialModel::read(JsonObject& parameters) {
    const int order = wholeNumber(parameters, "order", 1, kMaxOrder);
    const int covariance_order = wholeNumber(parameters, "covariance_order", order, kMaxOrder + kExtraDegrees);
    const std::vector<double> corners = parameters.numbers("triangle_px", 6);
    if (parameters.failed()) return nullptr;
    const Vector2 a(corners[0], corners[1]), b(corners[2], corners[3]), c(corners[4], corners[5]);
    const Vector2 ab = b - a, ac = c - a;
    const double largest = std::max({a.cwiseAbs().maxCoeff(), b.cwiseAbs().maxCoeff(), c.cwiseAbs().maxCoeff()});
    if (!(largest <= 1e6 && std::abs(ab.x() * ac.y() - ab.y() * ac.x()) >= 0.01 * (ab.squaredNorm() + 1))) {
        parameters.fail("triangle_px", "corners too far away or nearly on one line", "a triangle round the image");
        return nullptr;
    }
    std::array<Coordinate, 2> coordinates;
    const int size = BernsteinTriangle::size(order), root_size = BernsteinTriangle::size(covariance_order);
    for (std::size_t axis = 0; axis < 2; ++axis) {
        const std::string name = axis == 0 ? "x" : "y";
        const std::vector<double> values = parameters.numbers(name + "_mm", static_cast<std::size_t>(size));
        const std::vector<double> root =
            parameters.numbers(name + "_covariance_root", static_cast<std::size_t>(root_size * (root_size + 1) / 2));
        if (parameters.failed()) return nullptr;
        coordinates[axis].coefficients = Eigen::Map<const Eigen::VectorXd>(values.data(), size);
        coordinates[axis].covariance_root = Eigen::MatrixXd::Zero(root_size, root_size);
        std::size_t next = 0;
        for (int i = 0; i < root_size; ++i) {
            for (int j = i; j < root_size; ++j)
                coordinates[axis].covariance_root(i, j) = root[next++];
        }
    }
    return std::make_shared<PolynomialModel>(BernsteinTriangle({a, b, c}), order, covariance_order,
                                             std::move(coordinates));
}

namespace {

Eigen::MatrixXd designOf(const BernsteinTriangle& triangle, int degree, const GrooveData& data) {
    Eigen::MatrixXd design(data.size(), BernsteinTriangle::size(degree));
    for (Eigen::Index i = 0; i < data.size(); ++i)
        design.row(i) = triangle.basis(degree, data.pixels[static_cast<std::size_t>(i)]).transpose();
    return design;
}

// The root of the covariance described in the header.
Eigen::MatrixXd covarianceRoot(const BernsteinTriangle& triangle, int order, int covariance_order,
                               const GrooveData& data, const RobustFit& fit) {
    // The used points alone, in their noise's unit, with an orthonormal basis of degree N.
    const GrooveData used = data.only(fit.used);
    const Eigen::VectorXd weights = used.sigmas_mm.cwiseInverse();
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(weights.asDiagonal() * designOf(triangle, covariance_order, used));
    const Eigen::Index size = BernsteinTriangle::size(covariance_order);
    const Eigen::MatrixXd upper = qr.matrixQR().topRows(size).triangularView<Eigen::Upper>();
    // ... in which what degree n can do is the span of the columns of R E.
    const Eigen::Index fitted = BernsteinTriangle::size(order);
    const Eigen::HouseholderQR<Eigen::MatrixXd> inside(upper * BernsteinTriangle::elevation(order, covariance_order));
    const Eigen::MatrixXd turn = inside.householderQ();

    double gain = 0;
    if (size > fitted) {
        const Eigen::VectorXd y = weights.cwiseProduct(used.values_mm);
        const Eigen::VectorXd explained = turn.transpose() * (qr.householderQ().transpose() * y).head(size);
        const double extra = explained.tail(size - fitted).squaredNorm() / static_cast<double>(size - fitted);
        gain = std::max(0.0, extra / (fit.scale * fit.scale) - 1);
    }
    Eigen::VectorXd deviations = Eigen::VectorXd::Constant(size, std::sqrt(fit.variance_factor * gain));
    deviations.head(fitted).setConstant(std::sqrt(fit.variance_factor));
    // Covariance = R^-1 T D^2 T^T R^-T; its root: the triangle of the QR decomposition of D T^T R^-T.
    const Eigen::MatrixXd lower = upper.transpose();
    const Eigen::MatrixXd half = lower.triangularView<Eigen::Lower>().solve<Eigen::OnTheRight>(
        Eigen::MatrixXd(deviations.asDiagonal() * turn.transpose()));
    return Eigen::HouseholderQR<Eigen::MatrixXd>(half).matrixQR().triangularView<Eigen::Upper>();
}

struct CoordinateFit {
    PolynomialModel::Coordinate coordinate;
    RobustFit fit;
};

}  // namespace

Result<FittedModel> fitPolynomialModel(const GroovePoints& points, const DistortionFitOptions& options,
                                       Progress& progress) {
    const Result<std::array<GrooveData, 2>> data = grooveData(points);
    if (!data) return data.error();
    const BernsteinTriangle triangle = BernsteinTriangle::around(points.columns, points.rows);

    FittedModel result;
    // A polynomial needs more grooves than its degree, and several points for each coefficient.
    const auto carries = [&](int order) {
        for (const GrooveData& one : *data) {
            if (one.grooves <= order || one.size() < 3 * BernsteinTriangle::size(order)) return false;
        }
        return true;
    };
    const int wanted = options.order == 0 ? 5 : options.order;
    int order = wanted;
    while (order > 1 && !carries(order))
        --order;
    for (;; --order) {
        if (progress.isCancelled()) return cancelled("distortion fit");
        std::array<PolynomialModel::Coordinate, 2> coordinates;
        const int covariance_order =
            carries(order + PolynomialModel::kExtraDegrees) ? order + PolynomialModel::kExtraDegrees : order;
        for (std::size_t c = 0; c < 2; ++c) {
            const GrooveData& one = (*data)[c];
            RobustFit fit = fitRobustly(designOf(triangle, order, one), one.values_mm, one.sigmas_mm);
            coordinates[c].coefficients = fit.coefficients;
            coordinates[c].covariance_root = covarianceRoot(triangle, order, covariance_order, one, fit);
            (c == 0 ? result.used_along_y : result.used_along_x) = fit.used;
        }
        result.model = std::make_shared<PolynomialModel>(triangle, order, covariance_order, std::move(coordinates));
        break;
    }
    if (order < wanted) {
        result.warnings.push_back(fmt::format(
            "the polynomial's order was lowered from {} to {}: the points do not carry more", wanted, order));
    }
    return result;
}

}  // namespace fluorocut
