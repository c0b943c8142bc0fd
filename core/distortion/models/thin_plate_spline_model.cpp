#include "core/distortion/models/thin_plate_spline_model.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <fmt/format.h>

#include "core/distortion/models/groove_data.h"
#include "core/distortion/models/robust_fit.h"

namespace fluorocut {
namespace {

constexpr int kKnotsAcross = 10;  // of a square grid round the points
constexpr int kMostKnots = 400;

// r^2 log r^2, twice the usual r^2 log r.
double radial(double r2) {
    return r2 > 0 ? r2 * std::log(r2) : 0;
}

constexpr int kFree = 10;  // terms of the cubic

void fillCubic(const Vector2& at, double* terms) {
    const double u = at.x(), v = at.y();
    const double all[kFree] = {1, u, v, u * u, u * v, v * v, u * u * u, u * u * v, u * v * v, v * v * v};
    std::copy(all, all + kFree, terms);
}

Eigen::VectorXd basisAt(const std::vector<Vector2>& knots, const Vector2& at) {
    Eigen::VectorXd basis(static_cast<Eigen::Index>(knots.size()) + kFree);
    fillCubic(at, basis.data());
    for (std::size_t k = 0; k < knots.size(); ++k)
        basis[static_cast<Eigen::Index>(k) + kFree] = radial((at - knots[k]).squaredNorm());
    return basis;
}

}  // namespace

ThinPlateSplineModel::ThinPlateSplineModel(const Vector2& centre_px, double unit_px, std::vector<Vector2> knots,
                                           std::array<Coordinate, 2> coordinates)
    : centre_(centre_px), unit_(unit_px), knots_(std::move(knots)), coordinates_(std::move(coordinates)) {}

Vector2 ThinPlateSplineModel::plateFromPixel(const Vector2& pixel) const {
    const Vector2 at = (pixel - centre_) / unit_;
    const double *x = coordinates_[0].coefficients.data(), *y = coordinates_[1].coefficients.data();
    double cubic[kFree];
    fillCubic(at, cubic);
    Vector2 sum = Vector2::Zero();
    for (std::size_t i = 0; i < kFree; ++i)
        sum += cubic[i] * Vector2(x[i], y[i]);
    for (std::size_t k = 0; k < knots_.size(); ++k) {
        const double value = radial((at - knots_[k]).squaredNorm());
        sum += value * Vector2(x[k + kFree], y[k + kFree]);
    }
    return sum;
}

Matrix2 ThinPlateSplineModel::jacobian(const Vector2& pixel) const {
    const Vector2 at = (pixel - centre_) / unit_;
    Matrix2 result;
    for (Eigen::Index c = 0; c < 2; ++c) {
        const double* f = coordinates_[static_cast<std::size_t>(c)].coefficients.data();
        const double u = at.x(), v = at.y();
        Vector2 slope(f[1] + 2 * f[3] * u + f[4] * v + 3 * f[6] * u * u + 2 * f[7] * u * v + f[8] * v * v,
                      f[2] + f[4] * u + 2 * f[5] * v + f[7] * u * u + 2 * f[8] * u * v + 3 * f[9] * v * v);
        for (std::size_t k = 0; k < knots_.size(); ++k) {
            const Vector2 from = at - knots_[k];
            const double r2 = from.squaredNorm();
            if (r2 > 0) slope += f[k + kFree] * 2 * (std::log(r2) + 1) * from;
        }
        result.row(c) = slope.transpose();
    }
    return result / unit_;
}

Matrix2 ThinPlateSplineModel::covariance(const Vector2& pixel) const {
    const Eigen::VectorXd basis = basisAt(knots_, (pixel - centre_) / unit_);
    Matrix2 result = Matrix2::Zero();
    for (int c = 0; c < 2; ++c) {
        const Eigen::MatrixXd& root = coordinates_[static_cast<std::size_t>(c)].covariance_root;
        result(c, c) = (root.triangularView<Eigen::Upper>() * basis).squaredNorm();
    }
    return result;
}

DistortionModel::Fields ThinPlateSplineModel::parameters() const {
    Fields fields = {{"centre_px", {centre_.x(), centre_.y()}}, {"unit_px", {unit_}}, {"knots", {}}};
    for (const Vector2& knot : knots_)
        fields.back().second.insert(fields.back().second.end(), {knot.x(), knot.y()});
    for (std::size_t c = 0; c < 2; ++c) {
        const std::string axis = c == 0 ? "x" : "y";
        const Coordinate& one = coordinates_[c];
        fields.push_back({axis + "_mm", {one.coefficients.begin(), one.coefficients.end()}});
        fields.push_back({axis + "_covariance_root", packedUpper(one.covariance_root)});
    }
    return fields;
}

std::shared_ptr<const DistortionModel> ThinPlateSplineModel::read(JsonObject& parameters) {
    const Vector2 centre = parameters.vector<2>("centre_px");
    const std::vector<double> unit = parameters.numbers("unit_px", 1), flat = parameters.numbers("knots");
    if (parameters.failed()) return nullptr;
    if (!(centre.cwiseAbs().maxCoeff() <= 1e6)) parameters.fail("centre_px", "a place far away", "one in the image");
    if (!(unit[0] >= 1 && unit[0] <= 1e6)) parameters.fail("unit_px", fmt::format("{}", unit[0]), "1 to 1000000 px");
    if (flat.size() % 2 != 0 || flat.size() < 6 || flat.size() > 2 * kMostKnots) {
        parameters.fail("knots", fmt::format("{} numbers", flat.size()), fmt::format("3 to {} pairs", kMostKnots));
    }
    if (parameters.failed()) return nullptr;
    std::vector<Vector2> knots;
    for (std::size_t k = 0; k < flat.size(); k += 2)
        knots.emplace_back(flat[k], flat[k + 1]);
    std::array<Coordinate, 2> coordinates;
    const std::size_t size = knots.size() + kFree;
    for (std::size_t c = 0; c < 2; ++c) {
        const std::string axis = c == 0 ? "x" : "y";
        const std::vector<double> values = parameters.numbers(axis + "_mm", size);
        coordinates[c].covariance_root = readUpper(parameters, axis + "_covariance_root", static_cast<int>(size));
        if (parameters.failed()) return nullptr;
        coordinates[c].coefficients = Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(size));
    }
    return std::make_shared<ThinPlateSplineModel>(centre, unit[0], std::move(knots), std::move(coordinates));
}

namespace {

// Knots of a square grid that have points within one spacing, so that none is left to itself.
std::vector<Vector2> chooseKnots(const std::array<std::vector<Vector2>, 2>& places) {
    Vector2 low = places[0][0], high = low;
    for (const auto& all : places) {
        for (const Vector2& at : all) {
            low = low.cwiseMin(at);
            high = high.cwiseMax(at);
        }
    }
    const double spacing = (high - low).maxCoeff() / (kKnotsAcross - 1);
    std::vector<Vector2> knots;
    for (int j = 0; j < kKnotsAcross; ++j) {
        for (int i = 0; i < kKnotsAcross; ++i) {
            const Vector2 knot =
                0.5 * (low + high) + spacing * Vector2(i - 0.5 * (kKnotsAcross - 1), j - 0.5 * (kKnotsAcross - 1));
            const auto near = [&](const Vector2& at) { return (at - knot).norm() < spacing; };
            if (std::any_of(places[0].begin(), places[0].end(), near) &&
                std::any_of(places[1].begin(), places[1].end(), near)) {
                knots.push_back(knot);
            }
        }
    }
    return knots;
}

// The unknowns without constraint: affine part and bending part, the latter with the identity for its energy.
struct SplineSpace {
    Eigen::MatrixXd coefficients_from;  // (knots + 3) x unknowns
    Eigen::Index bending = 0;           // unknowns after the first three
};

SplineSpace splineSpace(const std::vector<Vector2>& knots) {
    const auto count = static_cast<Eigen::Index>(knots.size());
    Eigen::MatrixXd affine(count, 3), energy(count, count);
    for (Eigen::Index k = 0; k < count; ++k) {
        const Eigen::VectorXd basis = basisAt(knots, knots[static_cast<std::size_t>(k)]);
        affine.row(k) = basis.head<3>().transpose();  // 1, u, v
        energy.row(k) = basis.tail(count).transpose();
    }
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(affine);
    const Eigen::MatrixXd free = Eigen::MatrixXd(qr.householderQ()).rightCols(count - 3);
    // r^2 log r^2 is conditionally positive definite: Z^T E Z > 0.
    const Eigen::LLT<Eigen::MatrixXd> root(free.transpose() * energy * free);
    SplineSpace space;
    space.bending = count - 3;
    space.coefficients_from = Eigen::MatrixXd::Zero(count + kFree, count - 3 + kFree);
    space.coefficients_from.topLeftCorner(kFree, kFree).setIdentity();
    space.coefficients_from.bottomRightCorner(count, count - 3) =
        root.matrixL().transpose().solve<Eigen::OnTheRight>(free);
    return space;
}

struct SplineFit {
    ThinPlateSplineModel::Coordinate coordinate;
    std::vector<char> used;
};

// Penalised least squares with lambda by restricted maximum likelihood: returns unknowns, their covariance's root R
// with C = R R^T, and the noise's scale in sigmas.
struct Penalised {
    Eigen::VectorXd unknowns;
    Eigen::MatrixXd covariance_root;
    double scale = 0;
};

Penalised fitPenalised(const Eigen::MatrixXd& design, const Eigen::VectorXd& values, const Eigen::VectorXd& weights,
                       Eigen::Index bending) {
    const Eigen::Index size = design.cols();
    const Eigen::MatrixXd weighted = weights.asDiagonal() * design;
    // A little of the penalty keeps the normal matrix positive definite where points are few; it changes nothing else.
    Eigen::MatrixXd normal = design.transpose() * weighted;
    const double ridge = 1e-10 * normal.trace() / static_cast<double>(size);
    normal.diagonal().tail(bending).array() += ridge;
    const Eigen::LLT<Eigen::MatrixXd> llt(normal);
    // The basis in which data and penalty are both diagonal (Demmler and Reinsch).
    Eigen::MatrixXd penalty = Eigen::MatrixXd::Zero(size, size);
    penalty.diagonal().tail(bending).setOnes();
    const Eigen::MatrixXd left = llt.matrixL().solve(penalty);
    const Eigen::MatrixXd both = llt.matrixL().solve(left.transpose());
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(0.5 * (both + both.transpose()));
    const Eigen::VectorXd stiffness = eigen.eigenvalues().cwiseMax(0);
    const Eigen::VectorXd z = eigen.eigenvectors().transpose() * llt.matrixL().solve(weighted.transpose() * values);
    const double total = values.dot(weights.cwiseProduct(values));
    const double unexplained = std::max(total - z.squaredNorm(), 1e-12 * total);
    const double freedom = weights.sum() - static_cast<double>(size - bending);

    // z_i of the bending part has the variance s^2 (1 + 1 / (lambda stiffness_i)).
    const auto variance = [&](double lambda) {
        double sum = unexplained;
        for (Eigen::Index i = size - bending; i < size; ++i)
            sum += z[i] * z[i] / (1 + 1 / (lambda * stiffness[i]));
        return sum / freedom;
    };
    const auto deviance = [&](double log_lambda) {
        const double lambda = std::exp(log_lambda);
        double sum = freedom * std::log(variance(lambda));
        for (Eigen::Index i = size - bending; i < size; ++i)
            sum += std::log1p(1 / (lambda * stiffness[i]));
        return sum;
    };
    // From "no smoothing" to "a plane" in units of the middle stiffness; the minimum by scan and golden section.
    const double middle = -std::log(stiffness[size - bending / 2 - 1]);
    double best = middle, best_deviance = deviance(middle);
    for (double at = middle - 24; at <= middle + 24; at += 1) {
        const double value = deviance(at);
        if (value < best_deviance) {
            best = at;
            best_deviance = value;
        }
    }
    double low = best - 1, high = best + 1;
    constexpr double kGolden = 0.6180339887498949;
    for (int i = 0; i < 20; ++i) {
        const double a = high - kGolden * (high - low), b = low + kGolden * (high - low);
        (deviance(a) < deviance(b) ? high : low) = deviance(a) < deviance(b) ? b : a;
    }
    const double lambda = std::exp(0.5 * (low + high));
    const Eigen::VectorXd shrink = (1 + lambda * stiffness.array()).inverse();

    Penalised fit;
    fit.scale = std::sqrt(variance(lambda));
    const Eigen::MatrixXd turned = llt.matrixL().transpose().solve(eigen.eigenvectors());
    fit.unknowns = turned * shrink.cwiseProduct(z);
    fit.covariance_root = fit.scale * turned * shrink.cwiseSqrt().asDiagonal();
    return fit;
}

SplineFit fitSpline(const GrooveData& data, const std::vector<Vector2>& places, const std::vector<Vector2>& knots,
                    const SplineSpace& space, const RobustFit& start) {
    const Eigen::Index count = data.size();
    Eigen::MatrixXd design(count, static_cast<Eigen::Index>(knots.size()) + kFree);
    for (Eigen::Index i = 0; i < count; ++i)
        design.row(i) = basisAt(knots, places[static_cast<std::size_t>(i)]).transpose();
    const Eigen::VectorXd inverse = data.sigmas_mm.cwiseInverse();
    design = (inverse.asDiagonal() * design * space.coefficients_from).eval();
    const Eigen::VectorXd values = data.values_mm.cwiseProduct(inverse);

    SplineFit result;
    Eigen::VectorXd residuals = start.residuals.cwiseProduct(inverse);
    double scale = start.scale;
    Penalised fit;
    result.used.assign(static_cast<std::size_t>(count), 1);
    for (int iteration = 0; iteration < 3; ++iteration) {
        // Hard rejection where Tukey's weight is 0: plain likelihood, and with it REML, holds for the rest.
        Eigen::VectorXd weights(count);
        for (Eigen::Index i = 0; i < count; ++i) {
            const bool use = std::abs(residuals[i]) < (iteration == 0 ? kTukeyLimit : 4.0) * scale;
            result.used[static_cast<std::size_t>(i)] = use;
            weights[i] = use;
        }
        fit = fitPenalised(design, values, weights, space.bending);
        residuals = values - design * fit.unknowns;
        scale = fit.scale;
    }
    result.coordinate.coefficients = space.coefficients_from * fit.unknowns;
    // C = (K R)(K R)^T: its upper triangular root from the QR decomposition of (K R)^T.
    const Eigen::MatrixXd half = (space.coefficients_from * fit.covariance_root).transpose();
    Eigen::MatrixXd square = Eigen::MatrixXd::Zero(half.cols(), half.cols());
    square.topRows(half.rows()) = half;
    result.coordinate.covariance_root =
        Eigen::HouseholderQR<Eigen::MatrixXd>(square).matrixQR().triangularView<Eigen::Upper>();
    return result;
}

}  // namespace

Result<FittedModel> fitThinPlateSplineModel(const GroovePoints& points, const DistortionFitOptions&,
                                            Progress& progress) {
    const Result<std::array<GrooveData, 2>> data = grooveData(points);
    if (!data) return data.error();
    const Vector2 centre = 0.5 * Vector2(points.columns - 1, points.rows - 1);
    const double unit = 0.5 * std::max(points.columns, points.rows);

    std::array<RobustFit, 2> starts;
    std::array<std::vector<Vector2>, 2> places, kept;
    for (std::size_t c = 0; c < 2; ++c) {
        const GrooveData& one = (*data)[c];
        starts[c] = agreeingPoints(points, one);
        for (std::size_t i = 0; i < one.pixels.size(); ++i) {
            places[c].push_back((one.pixels[i] - centre) / unit);
            if (starts[c].used[i]) kept[c].push_back(places[c].back());
        }
        if (kept[c].size() < 20) {
            return noSolution("thin-plate spline", fmt::format("{} points that agree", kept[c].size()),
                              "at least 20 along each direction");
        }
    }
    const std::vector<Vector2> knots = chooseKnots(kept);
    if (knots.size() < 6) {
        return noSolution("thin-plate spline", "points of the two directions that lie apart",
                          "points of both directions side by side");
    }
    const SplineSpace space = splineSpace(knots);
    FittedModel result;
    std::array<ThinPlateSplineModel::Coordinate, 2> coordinates;
    for (std::size_t c = 0; c < 2; ++c) {
        if (progress.isCancelled()) return cancelled("distortion fit");
        SplineFit fit = fitSpline((*data)[c], places[c], knots, space, starts[c]);
        coordinates[c] = std::move(fit.coordinate);
        (c == 0 ? result.used_along_y : result.used_along_x) = std::move(fit.used);
    }
    result.model = std::make_shared<ThinPlateSplineModel>(centre, unit, knots, std::move(coordinates));
    return result;
}

}  // namespace fluorocut
