#include "core/planning/measures.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "core/base/units.h"

namespace fluorocut {
namespace {

constexpr double kNormal95 = 1.6449;   // one-sided
constexpr double kWallSigmaMm = 0.07;  // of a wall's thickness: half of what holds for 95 % of generated walls
constexpr double kStepMm = 1e-4, kStepUnit = 1e-6;

Vector2 inDetector(const CArm& carm, const Vector2& pixel) {
    return carm.detectorPoint(pixel).head<2>();
}

// Clicks as places in the detector: the errors of a pixel, in mm.
Eigen::VectorXd stacked(const CArm& carm, const std::vector<Vector2>& pixels) {
    Eigen::VectorXd x(2 * static_cast<Eigen::Index>(pixels.size()));
    for (std::size_t i = 0; i < pixels.size(); ++i)
        x.segment<2>(2 * static_cast<Eigen::Index>(i)) = inDetector(carm, pixels[i]);
    return x;
}

Eigen::MatrixXd clickCovariance(const CArm& carm, std::size_t points, double sigma_px) {
    Eigen::VectorXd variance(2 * static_cast<Eigen::Index>(points));
    for (std::size_t i = 0; i < points; ++i)
        variance.segment<2>(2 * static_cast<Eigen::Index>(i)) = (sigma_px * carm.pixel_mm).cwiseAbs2();
    return variance.asDiagonal();
}

Eigen::VectorXd even(Eigen::Index count, double step) {
    return Eigen::VectorXd::Constant(count, step);
}

double between(const Vector3& a, const Vector3& b) {
    return std::atan2(a.cross(b).norm(), a.dot(b));
}

// Errors of a direction that are the same about every axis across it.
Matrix3 acrossCovariance(const Vector3& direction, double sigma) {
    return sigma * sigma * (Matrix3::Identity() - direction * direction.transpose());
}

Measure inSpace(Measure measure, const char* unit) {
    measure.unit = unit;
    measure.plane = "in space";
    return measure;
}

// Projection's derivative by the point and by the pose, by central differences (distortion included).
struct Projection {
    Eigen::Matrix<double, 2, 3> by_point;
    Eigen::Matrix<double, 2, 6> by_pose;

    Projection(const View& view, const Vector3& point) {
        constexpr double kMm = 1e-3, kRad = 1e-6;
        for (int i = 0; i < 3; ++i) {
            const Vector3 step = kMm * Vector3::Unit(i);
            by_point.col(i) = (view.carm.project(view.imager_from_world * (point + step)) -
                               view.carm.project(view.imager_from_world * (point - step))) /
                              (2 * kMm);
        }
        for (int i = 0; i < 6; ++i) {
            const double h = i < 3 ? kMm : kRad;
            const Vector6 step = h * Vector6::Unit(i);
            by_pose.col(i) = (view.carm.project(view.imager_from_world.perturbed(step) * point) -
                              view.carm.project(view.imager_from_world.perturbed(-step) * point)) /
                             (2 * h);
        }
    }
};

}  // namespace

Measure propagated(const std::function<double(const Eigen::VectorXd&)>& f, const Eigen::VectorXd& at,
                   const Eigen::MatrixXd& covariance, const Eigen::VectorXd& steps) {
    Eigen::VectorXd gradient(at.size());
    for (Eigen::Index i = 0; i < at.size(); ++i) {
        Eigen::VectorXd forward = at, backward = at;
        forward[i] += steps[i];
        backward[i] -= steps[i];
        gradient[i] = (f(forward) - f(backward)) / (2 * steps[i]);
    }
    Measure measure;
    measure.value = f(at);
    measure.sigma = std::sqrt(std::max(0.0, gradient.dot(covariance * gradient)));
    return measure;
}

Measure distanceInDetector(const CArm& carm, const Vector2& a, const Vector2& b, double sigma_px) {
    Measure measure = propagated([](const Eigen::VectorXd& x) { return (x.head<2>() - x.tail<2>()).norm(); },
                                 stacked(carm, {a, b}), clickCovariance(carm, 2, sigma_px), even(4, kStepMm));
    measure.unit = "mm";
    measure.plane = "in the detector plane";
    return measure;
}

Measure distanceAtDepth(const CArm& carm, const Vector2& a, const Vector2& b, double sigma_px, double depth_mm,
                        double depth_sigma_mm) {
    Measure measure = distanceInDetector(carm, a, b, sigma_px);
    if (!(depth_mm > 0 && depth_mm <= carm.focal_length_mm && depth_sigma_mm >= 0)) {
        measure.value = measure.sigma = std::numeric_limits<double>::quiet_NaN();
        measure.warnings.push_back("the depth does not lie between source and detector");
        return measure;
    }
    const double scale = depth_mm / carm.focal_length_mm;
    measure.sigma = std::hypot(scale * measure.sigma, measure.value / carm.focal_length_mm * depth_sigma_mm);
    measure.value *= scale;
    measure.plane = fmt::format(
        "in the plane {:.0f} mm from the source, parallel to the detector (magnification {:.3f})", depth_mm, 1 / scale);
    if (depth_sigma_mm > 0.05 * depth_mm)
        measure.warnings.push_back(
            fmt::format("the depth alone makes {:.0f} % of error", 100 * depth_sigma_mm / depth_mm));
    return measure;
}

Measure angleInDetector(const CArm& carm, const Vector2& vertex, const Vector2& a, const Vector2& b, double sigma_px) {
    Measure measure = propagated(
        [](const Eigen::VectorXd& x) {
            const Vector2 p = x.segment<2>(2) - x.head<2>(), q = x.tail<2>() - x.head<2>();
            return std::abs(std::atan2(p.x() * q.y() - p.y() * q.x(), p.dot(q)));
        },
        stacked(carm, {vertex, a, b}), clickCovariance(carm, 3, sigma_px), even(6, kStepMm));
    measure.unit = "rad";
    measure.plane = "in the detector plane";
    return measure;
}

Measure angleBetweenLines(const CArm& carm, const Vector2& a0, const Vector2& a1, const Vector2& b0, const Vector2& b1,
                          double sigma_px) {
    Measure measure = propagated(
        [](const Eigen::VectorXd& x) {
            const Vector2 p = x.segment<2>(2) - x.head<2>(), q = x.tail<2>() - x.segment<2>(4);
            return std::abs(std::atan2(p.x() * q.y() - p.y() * q.x(), p.dot(q)));
        },
        stacked(carm, {a0, a1, b0, b1}), clickCovariance(carm, 4, sigma_px), even(8, kStepMm));
    measure.unit = "rad";
    measure.plane = "in the detector plane";
    return measure;
}

Result<PointsInSpace> pointsInSpace(const std::vector<View>& views, const std::vector<std::vector<Vector2>>& pixels,
                                    double sigma_px) {
    PointsInSpace result;
    const auto size = static_cast<Eigen::Index>(3 * pixels.size());
    // How each point moves with its clicks and with the views' poses.
    result.covariance = Eigen::MatrixXd::Zero(size, size);
    std::vector<Eigen::MatrixXd> by_pose(views.size(), Eigen::MatrixXd::Zero(size, 6));
    for (std::size_t n = 0; n < pixels.size(); ++n) {
        if (pixels[n].size() != views.size()) throw std::logic_error("pointsInSpace: a pixel for each view");
        std::vector<Observation> observations;
        for (std::size_t v = 0; v < views.size(); ++v)
            observations.push_back({views[v], pixels[n][v], sigma_px});
        const Result<TriangulatedPoint> found = triangulate(observations);
        if (!found) {
            Error error = found.error();
            error.where = fmt::format("point {}: {}", n + 1, error.where);
            return error;
        }
        for (const std::string& warning : found->warnings)
            result.warnings.push_back(fmt::format("point {}: {}", n + 1, warning));
        result.points.push_back(found->point);
        result.rms_px.push_back(found->rms_px);
        const auto row = static_cast<Eigen::Index>(3 * n);
        for (std::size_t v = 0; v < views.size(); ++v) {
            const Projection projection(views[v], found->point);
            const Matrix2 noise = sigma_px * sigma_px * Matrix2::Identity() +
                                  projection.by_pose * views[v].covariance * projection.by_pose.transpose();
            const Eigen::Matrix<double, 3, 2> gain =
                found->covariance * projection.by_point.transpose() * noise.inverse();
            result.covariance.block<3, 3>(row, row) += sigma_px * sigma_px * gain * gain.transpose();
            by_pose[v].middleRows<3>(row) = -gain * projection.by_pose;
        }
    }
    for (std::size_t v = 0; v < views.size(); ++v)
        result.covariance += by_pose[v] * views[v].covariance * by_pose[v].transpose();
    return result;
}

namespace {

// The chosen points' places and their joint covariance.
std::pair<Eigen::VectorXd, Eigen::MatrixXd> chosen(const PointsInSpace& points, const std::vector<std::size_t>& which) {
    const auto n = static_cast<Eigen::Index>(3 * which.size());
    Eigen::VectorXd x(n);
    Eigen::MatrixXd covariance(n, n);
    for (std::size_t i = 0; i < which.size(); ++i) {
        x.segment<3>(static_cast<Eigen::Index>(3 * i)) = points.points.at(which[i]);
        for (std::size_t j = 0; j < which.size(); ++j)
            covariance.block<3, 3>(static_cast<Eigen::Index>(3 * i), static_cast<Eigen::Index>(3 * j)) =
                points.covariance.block<3, 3>(static_cast<Eigen::Index>(3 * which[i]),
                                              static_cast<Eigen::Index>(3 * which[j]));
    }
    return {x, covariance};
}

}  // namespace

Measure distanceInSpace(const PointsInSpace& points, std::size_t a, std::size_t b) {
    const auto [x, covariance] = chosen(points, {a, b});
    return inSpace(propagated([](const Eigen::VectorXd& y) { return (y.head<3>() - y.tail<3>()).norm(); }, x,
                              covariance, even(6, kStepMm)),
                   "mm");
}

Measure angleInSpace(const PointsInSpace& points, std::size_t vertex, std::size_t a, std::size_t b) {
    const auto [x, covariance] = chosen(points, {vertex, a, b});
    return inSpace(
        propagated(
            [](const Eigen::VectorXd& y) { return between(y.segment<3>(3) - y.head<3>(), y.tail<3>() - y.head<3>()); },
            x, covariance, even(9, kStepMm)),
        "rad");
}

LineFit canalAxis(const BoneWalls& walls, double from_mm, double to_mm) {
    std::vector<Vector3> centers;
    for (const WallLevel& level : walls.levels)
        if (level.along_mm >= from_mm && level.along_mm <= to_mm) centers.push_back(walls.canalCenter(level));
    LineFit line = fitLine(centers);
    if (line.direction.dot(walls.axis.direction()) < 0) line.direction = -line.direction;
    return line;
}

Measure legLengthChange(const HipCenters& hip) {
    // Linear but for the axis: in closed form.
    const Vector3& a = hip.axis.direction;
    Vector3 way = hip.head_planned.point - hip.head_reference.point;
    Matrix3 covariance = hip.head_planned.covariance + hip.head_reference.covariance;
    if (hip.socket_reference && hip.socket_planned) {
        way -= hip.socket_planned->point - hip.socket_reference->point;
        covariance += hip.socket_planned->covariance + hip.socket_reference->covariance;
    }
    Measure measure;
    measure.value = way.dot(a);
    measure.sigma = std::sqrt(a.dot(covariance * a) + way.dot(acrossCovariance(a, hip.axis.direction_sigma_rad) * way));
    measure.unit = "mm";
    measure.plane = "along the canal's axis, positive: longer";
    return measure;
}

Measure offsetChange(const HipCenters& hip) {
    Eigen::VectorXd x(12);
    x << hip.head_planned.point, hip.head_reference.point, hip.axis.point, hip.axis.direction;
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(12, 12);
    covariance.block<3, 3>(0, 0) = hip.head_planned.covariance;
    covariance.block<3, 3>(3, 3) = hip.head_reference.covariance;
    covariance.block<3, 3>(6, 6) = acrossCovariance(hip.axis.direction, hip.axis.point_sigma_mm);
    covariance.block<3, 3>(9, 9) = acrossCovariance(hip.axis.direction, hip.axis.direction_sigma_rad);
    Eigen::VectorXd steps = even(12, kStepMm);
    steps.tail<3>().setConstant(kStepUnit);
    Measure measure = propagated(
        [](const Eigen::VectorXd& y) {
            const Vector3 axis = Vector3(y.tail<3>()).normalized(), point = y.segment<3>(6);
            const auto away = [&](const Vector3& p) { return (p - point).cross(axis).norm(); };
            return away(y.head<3>()) - away(y.segment<3>(3));
        },
        x, covariance, steps);
    measure.unit = "mm";
    measure.plane = "across the canal's axis, positive: farther from it";
    return measure;
}

Measure version(const VersionInput& input) {
    Eigen::VectorXd x(9);
    x << input.neck.normalized(), input.reference.normalized(), input.axis.normalized();
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(9, 9);
    covariance.block<3, 3>(0, 0) = input.neck_covariance / input.neck.squaredNorm();
    covariance.block<3, 3>(3, 3) = input.reference_covariance / input.reference.squaredNorm();
    covariance.block<3, 3>(6, 6) = input.axis_covariance / input.axis.squaredNorm();
    const double forward = input.side == Side::left ? 1 : -1;
    Measure measure = propagated(
        [&](const Eigen::VectorXd& y) {
            const Vector3 axis = Vector3(y.tail<3>()).normalized();
            const Vector3 neck = y.head<3>(), reference = y.segment<3>(3);
            const Vector3 from = reference - reference.dot(axis) * axis, to = neck - neck.dot(axis) * axis;
            return forward * std::atan2(axis.dot(from.cross(to)), from.dot(to));
        },
        x, covariance, even(9, kStepUnit));
    measure.unit = "rad";
    measure.plane = "across the femur's axis, from the reference direction, positive: forward";
    if (input.neck.cross(input.axis).norm() < 0.2 * input.neck.norm() * input.axis.norm())
        measure.warnings.push_back("the neck runs nearly along the axis: its version is not observable");
    return measure;
}

std::vector<LevelThickness> cortexThickness(const BoneWalls& walls) {
    std::vector<LevelThickness> levels;
    for (const WallLevel& level : walls.levels) {
        LevelThickness out;
        out.along_mm = level.along_mm;
        std::size_t thinnest = 0;
        double sum = 0;
        const std::size_t n = level.outer_mm.size();
        for (std::size_t ray = 0; ray < n; ++ray) {
            sum += level.thickness(ray);
            if (level.thickness(ray) < level.thickness(thinnest)) thinnest = ray;
        }
        const std::string plane = "along rays across the shaft's axis";
        out.least = {level.thickness(thinnest), kWallSigmaMm, "mm", plane, {}};
        // Errors of neighbouring rays go together: as if a quarter turn had one error.
        out.mean = {sum / static_cast<double>(n), kWallSigmaMm / 2, "mm", plane, {}};
        out.least_place = walls.outerPoint(level, thinnest);
        levels.push_back(std::move(out));
    }
    return levels;
}

std::optional<std::string> perforationWarning(const Measure& least_wall, const std::string& where, double limit_mm) {
    if (least_wall.value - kNormal95 * least_wall.sigma >= limit_mm) return std::nullopt;
    if (!std::isfinite(least_wall.value)) return fmt::format("the wall left {} is not known", where);
    if (least_wall.value <= 0)
        return fmt::format("PERFORATION: the plan breaks through the wall by {:.1f} mm, {}", -least_wall.value, where);
    return fmt::format("the wall left {} is {:.1f} mm (+- {:.1f}), the limit {:.1f} mm: danger of perforation", where,
                       least_wall.value, kNormal95 * least_wall.sigma, limit_mm);
}

}  // namespace fluorocut
