#include "core/distortion/models/polynomial_model.h"

#include <algorithm>
#include <cmath>
#include <optional>

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
        fields.push_back({axis + "_covariance_root", packedUpper(coordinate.covariance_root)});
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
        coordinates[axis].covariance_root = readUpper(parameters, name + "_covariance_root", root_size);
        if (parameters.failed()) return nullptr;
        coordinates[axis].coefficients = Eigen::Map<const Eigen::VectorXd>(values.data(), size);
    }
    return std::make_shared<PolynomialModel>(BernsteinTriangle({a, b, c}), order, covariance_order,
                                             std::move(coordinates));
}

namespace {

// The root of the covariance described in the header.
Eigen::MatrixXd covarianceRoot(const BernsteinTriangle& triangle, int order, int covariance_order,
                               const GrooveData& data, const RobustFit& fit) {
    // The used points alone, in their noise's unit, with an orthonormal basis of degree N.
    const GrooveData used = data.only(fit.used);
    const Eigen::VectorXd weights = used.sigmas_mm.cwiseInverse();
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(weights.asDiagonal() *
                                                   triangle.design(covariance_order, used.pixels));
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

constexpr double kWorstDeviation = 1.5;  // of the map at any groove point, in the points' own deviations

// What choosing the order from the same points adds to the variance, measured: without it 95 % regions hold 93 %.
constexpr double kChoiceOfOrder = 1.1;

// Both coordinates' robust fits of one order; nothing when the points do not carry it.
struct Attempt {
    int order = 0;
    std::array<RobustFit, 2> fits;

    static std::optional<Attempt> of(const BernsteinTriangle& triangle, int order,
                                     const std::array<GrooveData, 2>& data) {
        Attempt attempt;
        attempt.order = order;
        for (std::size_t c = 0; c < 2; ++c) {
            // A polynomial takes more grooves than its degree, and several points for each coefficient.
            if (data[c].grooves <= order || highestDegree(data[c].size()) < order) return {};
            attempt.fits[c] = fitRobustly(triangle.design(order, data[c].pixels), data[c].values_mm, data[c].sigmas_mm);
            if (!attempt.fits[c].coefficients.allFinite() || !attempt.isFirm(triangle, c, data)) return {};
        }
        return attempt;
    }

    // Whether noise alone leaves the map at every groove point (of both directions: both need both coordinates) about
    // as well known as a point. It does not where points of one direction are missing over a part of the field.
    bool isFirm(const BernsteinTriangle& triangle, std::size_t c, const std::array<GrooveData, 2>& data) const {
        const GrooveData used = data[c].only(fits[c].used);
        const Eigen::Index size = BernsteinTriangle::size(order);
        if (used.size() < size) return false;
        const Eigen::MatrixXd upper =
            Eigen::HouseholderQR<Eigen::MatrixXd>(triangle.design(order, used.pixels)).matrixQR().topRows(size);
        for (const GrooveData& all : data) {
            const Eigen::MatrixXd basis = triangle.design(order, all.pixels).transpose();
            const Eigen::MatrixXd spread = upper.transpose().triangularView<Eigen::Lower>().solve(basis);
            if (!(spread.colwise().norm().maxCoeff() <= kWorstDeviation)) return false;
        }
        return true;
    }
};

// The order with the least Bayesian information criterion (Schwarz 1978), over the points that the highest order keeps.
const Attempt& bestOf(const std::vector<Attempt>& attempts, const std::array<GrooveData, 2>& data) {
    const Attempt* best = nullptr;
    double least = std::numeric_limits<double>::infinity();
    for (const Attempt& attempt : attempts) {
        double criterion = 0;
        for (std::size_t c = 0; c < 2; ++c) {
            const std::vector<char>& used = attempts.back().fits[c].used;
            double sum = 0, count = 0;
            for (std::size_t i = 0; i < used.size(); ++i) {
                const auto at = static_cast<Eigen::Index>(i);
                const double residual = attempt.fits[c].residuals[at] / data[c].sigmas_mm[at];
                sum += used[i] ? residual * residual : 0;
                count += used[i];
            }
            criterion += count * std::log(sum / count) + BernsteinTriangle::size(attempt.order) * std::log(count);
        }
        if (!best || criterion < least) {
            best = &attempt;
            least = criterion;
        }
    }
    return *best;
}

}  // namespace

Result<FittedModel> fitPolynomialModel(const GroovePoints& points, const DistortionFitOptions& options,
                                       Progress& progress) {
    const Result<std::array<GrooveData, 2>> data = grooveData(points);
    if (!data) return data.error();
    const BernsteinTriangle triangle = BernsteinTriangle::around(points.columns, points.rows);
    const bool automatic = options.order == 0;

    std::vector<Attempt> attempts;  // by order, rising
    for (int order = automatic ? PolynomialModel::kMaxOrder : options.order; order >= 1; --order) {
        if (progress.isCancelled()) return cancelled("distortion fit");
        std::optional<Attempt> attempt = Attempt::of(triangle, order, *data);
        if (attempt) attempts.insert(attempts.begin(), std::move(*attempt));
        if (attempt && !automatic) break;
    }
    if (attempts.empty()) {
        return noSolution("distortion fit", "groove points that do not even carry a straight map",
                          "points of both directions, spread over the image",
                          "move the plate or what hides it so that more of it is seen");
    }
    const Attempt& chosen = bestOf(attempts, *data);

    FittedModel result;
    const int extra = chosen.order + PolynomialModel::kExtraDegrees;
    const bool carried = (*data)[0].grooves > extra && (*data)[1].grooves > extra &&
                         highestDegree(chosen.fits[0].used_count) >= extra &&
                         highestDegree(chosen.fits[1].used_count) >= extra;
    const int covariance_order = carried ? extra : chosen.order;
    std::array<PolynomialModel::Coordinate, 2> coordinates;
    for (std::size_t c = 0; c < 2; ++c) {
        const RobustFit& fit = chosen.fits[c];
        coordinates[c].coefficients = fit.coefficients;
        coordinates[c].covariance_root = covarianceRoot(triangle, chosen.order, covariance_order, (*data)[c], fit);
        if (automatic) coordinates[c].covariance_root *= std::sqrt(kChoiceOfOrder);
        (c == 0 ? result.used_along_y : result.used_along_x) = fit.used;
    }
    result.model = std::make_shared<PolynomialModel>(triangle, chosen.order, covariance_order, std::move(coordinates));
    if (!automatic && chosen.order < options.order) {
        result.warnings.push_back(fmt::format(
            "the polynomial's order was lowered from {} to {}: the groove points are too few or too unevenly spread",
            options.order, chosen.order));
    }
    return result;
}

}  // namespace fluorocut
