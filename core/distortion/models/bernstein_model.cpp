#include "core/distortion/models/bernstein_model.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <Eigen/QR>
#include <fmt/format.h>

#include "core/distortion/models/cubic_spline.h"
#include "core/distortion/models/groove_data.h"
#include "core/distortion/models/robust_fit.h"

namespace fluorocut {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr int kOrder = 5, kLowOrder = 3;             // of a curve
constexpr std::size_t kPoints = 12, kFewPoints = 8;  // that they take
constexpr std::size_t kLeastCurves = 4;              // for a cubic across them
constexpr double kBeyondEnds = 4;                    // px a curve may be followed beyond its points
constexpr double kLeastGap = 2;                      // px between curves; nearer, they cross

// B_k of equation 5 for t in [0, 1] along begin ... end.
GrooveCurve::Basis bernstein(int order, double t) {
    GrooveCurve::Basis basis = GrooveCurve::Basis::Zero(order + 1);
    basis[0] = 1;
    for (int n = 1; n <= order; ++n) {
        for (int k = n; k > 0; --k)
            basis[k] = (1 - t) * basis[k] + t * basis[k - 1];
        basis[0] *= 1 - t;
    }
    return basis;
}

}  // namespace

GrooveCurve::Basis GrooveCurve::basis(double along_px) const {
    return bernstein(static_cast<int>(coefficients.size()) - 1, (along_px - begin_px) / (end_px - begin_px));
}

BernsteinModel::BernsteinModel(const Vector2& centre_px, double turn_rad,
                               std::array<std::vector<GrooveCurve>, 2> curves)
    : centre_(centre_px),
      turn_rad_(turn_rad),
      plate_axes_(Eigen::Rotation2Dd(turn_rad).toRotationMatrix().transpose()),
      curves_(std::move(curves)) {}

Vector2 BernsteinModel::local(int axis, const Vector2& pixel) const {
    const Vector2 turned = plate_axes_ * (pixel - centre_);
    return axis == 0 ? turned : turned.reverse().eval();
}

std::vector<Vector2> BernsteinModel::curvePixels(const GrooveCurve& curve, bool along_y, int count) const {
    std::vector<Vector2> pixels;
    for (int i = 0; i < count; ++i) {
        const double along = curve.begin_px + (curve.end_px - curve.begin_px) * i / std::max(count - 1, 1);
        const Vector2 at(curve.across(along), along);
        pixels.push_back(centre_ + plate_axes_.transpose() * (along_y ? at : at.reverse().eval()));
    }
    return pixels;
}

namespace {

// What a scan line crosses.
struct Crossings {
    std::vector<double> across, value, weights;
    std::vector<const GrooveCurve*> curves;

    // False where there is no answer.
    bool find(const std::vector<GrooveCurve>& all, double along, double reach_along) {
        across.clear();
        value.clear();
        curves.clear();
        for (const GrooveCurve& curve : all) {
            if (!(reach_along >= curve.begin_px - kBeyondEnds && reach_along <= curve.end_px + kBeyondEnds)) continue;
            across.push_back(curve.across(along));
            value.push_back(curve.value_mm);
            curves.push_back(&curve);
            if (across.size() > 1 && !(across.back() - across[across.size() - 2] >= kLeastGap)) return false;
        }
        weights.resize(across.size());
        return across.size() >= kLeastCurves;
    }
    bool between(double at) const { return at >= across.front() && at <= across.back(); }
    double at(double place, int derivative) {
        cubicSplineWeights(across, place, derivative, weights);
        double sum = 0;
        for (std::size_t i = 0; i < value.size(); ++i)
            sum += weights[i] * value[i];
        return sum;
    }
};

}  // namespace

double BernsteinModel::value(int axis, const Vector2& at, double reach_along) const {
    thread_local Crossings crossings;
    if (!crossings.find(curves_[static_cast<std::size_t>(axis)], at.y(), reach_along)) return kNaN;
    return crossings.between(at.x()) ? crossings.at(at.x(), 0) : kNaN;
}

Vector2 BernsteinModel::plateFromPixel(const Vector2& pixel) const {
    const Vector2 x = local(0, pixel), y = local(1, pixel);
    return {value(0, x, x.y()), value(1, y, y.y())};
}

Matrix2 BernsteinModel::jacobian(const Vector2& pixel) const {
    // Differences over a hundredth of a pixel, between the same curves and inside the outermost two.
    constexpr double kStep = 0.01;
    Matrix2 result;
    for (int axis = 0; axis < 2; ++axis) {
        const Vector2 at = local(axis, pixel);
        Vector2 slope;
        for (int direction = 0; direction < 2; ++direction) {
            const Vector2 step = kStep * Vector2::Unit(direction);
            const double middle = value(axis, at, at.y());
            double ahead = value(axis, at + step, at.y()), behind = value(axis, at - step, at.y()), span = 2 * kStep;
            if (std::isnan(ahead) || std::isnan(behind)) {
                span = kStep;
                (std::isnan(ahead) ? ahead : behind) = middle;
            }
            slope[direction] = (ahead - behind) / span;
        }
        if (axis == 1) slope.reverseInPlace();
        result.row(axis) = slope.transpose() * plate_axes_;
    }
    return result;
}

double BernsteinModel::variance(int axis, const Vector2& at) const {
    thread_local Crossings crossings;
    if (!crossings.find(curves_[static_cast<std::size_t>(axis)], at.y(), at.y())) return kNaN;
    if (!crossings.between(at.x())) return kNaN;
    const double slope = crossings.at(at.x(), 1);
    crossings.at(at.x(), 0);
    double sum = 0;
    for (std::size_t i = 0; i < crossings.curves.size(); ++i) {
        // A crossing that moves by ds changes the spline as a value that is wrong by its slope times ds.
        const GrooveCurve& curve = *crossings.curves[i];
        const double spread =
            (curve.covariance_root.triangularView<Eigen::Upper>() * curve.basis(at.y())).squaredNorm();
        sum += crossings.weights[i] * crossings.weights[i] * spread;
    }
    return slope * slope * sum;
}

Matrix2 BernsteinModel::covariance(const Vector2& pixel) const {
    Matrix2 result = Matrix2::Zero();
    for (int axis = 0; axis < 2; ++axis)
        result(axis, axis) = variance(axis, local(axis, pixel));
    return result;
}

DistortionModel::Fields BernsteinModel::parameters() const {
    Fields fields = {{"centre_px", {centre_.x(), centre_.y()}}, {"turn_rad", {turn_rad_}}};
    for (std::size_t axis = 0; axis < 2; ++axis) {
        std::vector<double> flat;
        for (const GrooveCurve& curve : curves_[axis]) {
            flat.insert(flat.end(), {curve.value_mm, curve.begin_px, curve.end_px,
                                     static_cast<double>(curve.coefficients.size() - 1)});
            flat.insert(flat.end(), curve.coefficients.begin(), curve.coefficients.end());
            const std::vector<double> root = packedUpper(curve.covariance_root);
            flat.insert(flat.end(), root.begin(), root.end());
        }
        fields.push_back({axis == 0 ? "x_curves" : "y_curves", std::move(flat)});
    }
    return fields;
}

std::shared_ptr<const DistortionModel> BernsteinModel::read(JsonObject& parameters) {
    const Vector2 centre = parameters.vector<2>("centre_px");
    const std::vector<double> turn = parameters.numbers("turn_rad", 1);
    std::array<std::vector<GrooveCurve>, 2> curves;
    for (std::size_t axis = 0; axis < 2; ++axis) {
        const std::string field = axis == 0 ? "x_curves" : "y_curves";
        const std::vector<double> flat = parameters.numbers(field);
        if (parameters.failed()) return nullptr;
        std::size_t next = 0;
        while (next < flat.size()) {
            const std::size_t order =
                flat.size() - next < 4 ? 0 : static_cast<std::size_t>(std::clamp(flat[next + 3], 0.0, 100.0));
            const std::size_t size = order + 1, root_size = size * (size + 1) / 2;
            const bool complete = flat.size() - next >= 4 + size + root_size;
            if (!complete || order < 1 || order > kOrder || static_cast<double>(order) != flat[next + 3]) {
                parameters.fail(field, fmt::format("curve {} that ends early or with a bad order", curves[axis].size()),
                                fmt::format("an order from 1 to {} and what belongs to it", kOrder));
                return nullptr;
            }
            GrooveCurve curve{flat[next], flat[next + 1], flat[next + 2], {}, {}};
            if (!(curve.end_px - curve.begin_px >= 1) ||
                (!curves[axis].empty() && !(curve.value_mm > curves[axis].back().value_mm))) {
                parameters.fail(field, fmt::format("curve {} without length or out of order", curves[axis].size()),
                                "begin before end, and values that rise from curve to curve");
                return nullptr;
            }
            const double* from = flat.data() + next + 4;
            const auto count = static_cast<Eigen::Index>(size);
            curve.coefficients = Eigen::Map<const Eigen::VectorXd>(from, count);
            curve.covariance_root = unpackedUpper({from + size, root_size}, count);
            curves[axis].push_back(std::move(curve));
            next += 4 + size + root_size;
        }
    }
    return std::make_shared<BernsteinModel>(centre, turn[0], std::move(curves));
}

namespace {

struct CurveFit {
    GrooveCurve curve;
    double chi2 = 0;
    int freedom = 0;
};

// One groove's curve by least squares; (across, along) of its points.
CurveFit fitCurve(const std::vector<Vector2>& at, const std::vector<double>& sigmas) {
    CurveFit result;
    const auto count = static_cast<Eigen::Index>(at.size());
    const auto [first, last] =
        std::minmax_element(at.begin(), at.end(), [](const Vector2& a, const Vector2& b) { return a.y() < b.y(); });
    result.curve.begin_px = first->y();
    result.curve.end_px = last->y();
    const int order = at.size() >= kPoints ? kOrder : kLowOrder;
    result.curve.coefficients = GrooveCurve::Basis::Zero(order + 1);
    Eigen::MatrixXd design(count, order + 1);
    Eigen::VectorXd across(count);
    for (Eigen::Index i = 0; i < count; ++i) {
        const auto p = static_cast<std::size_t>(i);
        design.row(i) = result.curve.basis(at[p].y()).transpose() / sigmas[p];
        across[i] = at[p].x() / sigmas[p];
    }
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(design);
    result.curve.coefficients = qr.solve(across);
    result.chi2 = (across - design * result.curve.coefficients).squaredNorm();
    result.freedom = static_cast<int>(count) - order - 1;
    // Covariance R^-1 R^-T = U^T U: U is the triangle of R^-T.
    const Eigen::MatrixXd inverse = qr.matrixQR().topRows(order + 1).triangularView<Eigen::Upper>().solve(
        Eigen::MatrixXd::Identity(order + 1, order + 1));
    result.curve.covariance_root =
        Eigen::HouseholderQR<Eigen::MatrixXd>(inverse.transpose()).matrixQR().triangularView<Eigen::Upper>();
    return result;
}

// The angle of the plate's x axis in the image: what the mean of the points' gradients says.
double plateTurn(const GroovePoints& points) {
    Vector2 sum = Vector2::Zero();
    for (const GroovePoint& point : points.along_y)
        sum += point.across;
    for (const GroovePoint& point : points.along_x)
        sum += Vector2(point.across.y(), -point.across.x());
    return std::atan2(sum.y(), sum.x());
}

}  // namespace

Result<FittedModel> fitBernsteinModel(const GroovePoints& points, const DistortionFitOptions&, Progress& progress) {
    const Result<std::array<GrooveData, 2>> data = grooveData(points);
    if (!data) return data.error();
    const Vector2 centre = 0.5 * Vector2(points.columns - 1, points.rows - 1);
    const double turn = plateTurn(points);
    const Matrix2 axes = Eigen::Rotation2Dd(-turn).toRotationMatrix();

    FittedModel result;
    std::array<std::vector<GrooveCurve>, 2> curves;
    for (std::size_t axis = 0; axis < 2; ++axis) {
        if (progress.isCancelled()) return cancelled("distortion fit");
        const std::vector<GroovePoint>& all = axis == 0 ? points.along_y : points.along_x;
        std::vector<char>& used = axis == 0 ? result.used_along_y : result.used_along_x;
        used = agreeingPoints(points, (*data)[axis]).used;
        std::map<int, std::vector<std::size_t>> grooves;
        for (std::size_t i = 0; i < all.size(); ++i) {
            if (used[i]) grooves[all[i].index].push_back(i);
        }
        int left_out = 0, freedom = 0;
        double chi2 = 0;
        for (const auto& [index, members] : grooves) {
            std::vector<Vector2> at;
            std::vector<double> sigmas;
            for (const std::size_t i : members) {
                const Vector2 turned = axes * (all[i].pixel - centre);
                at.push_back(axis == 0 ? turned : turned.reverse().eval());
                sigmas.push_back(all[i].sigma_px);
            }
            CurveFit fit;
            if (members.size() >= kFewPoints) fit = fitCurve(at, sigmas);
            if (!(fit.freedom > 0 && fit.curve.end_px > fit.curve.begin_px + 1 && fit.curve.coefficients.allFinite() &&
                  fit.curve.covariance_root.allFinite())) {
                ++left_out;
                for (const std::size_t i : members)
                    used[i] = 0;
                continue;
            }
            chi2 += fit.chi2;
            freedom += fit.freedom;
            fit.curve.value_mm = index * points.pitch_mm;
            curves[axis].push_back(std::move(fit.curve));
        }
        if (curves[axis].size() < kLeastCurves) {
            return noSolution(axis == 0 ? "grooves along y" : "grooves along x",
                              fmt::format("{} with at least {} points", curves[axis].size(), kFewPoints),
                              fmt::format("at least {}", kLeastCurves), "take the model \"polynomial\"");
        }
        if (left_out > 0) {
            result.warnings.push_back(fmt::format("{} of {} grooves along {} had too few points for a curve", left_out,
                                                  grooves.size(), axis == 0 ? "y" : "x"));
        }
        // The noise of all grooves together: a single one's scale from 20 points is off by a sixth.
        for (GrooveCurve& curve : curves[axis])
            curve.covariance_root *= std::sqrt(chi2 / freedom);
    }
    result.model = std::make_shared<BernsteinModel>(centre, turn, std::move(curves));
    return result;
}

}  // namespace fluorocut
