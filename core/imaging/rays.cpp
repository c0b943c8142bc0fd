#include "core/imaging/rays.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "core/base/units.h"
#include "core/imaging/projected_error.h"

namespace fluorocut {
namespace {

using Matrix23 = Eigen::Matrix<double, 2, 3>;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// The ray of a's pixel in b's imager frame: points start + s * step, s in [0, 1] from a's source to a's detector.
struct Segment {
    Vector3 start, step;
};

Segment rayInOtherView(const View& a, const Vector2& pixel, const View& b) {
    const Rigid3 b_from_a = b.imager_from_world * a.imager_from_world.inverse();
    return {b_from_a.translation(), b_from_a.rotate(a.carm.detectorPoint(pixel))};
}

// The ideal pixels that the image can show: the box about its border, straightened.
struct Box {
    Vector2 low = Vector2::Constant(std::numeric_limits<double>::infinity());
    Vector2 high = -low;
};

Box idealImage(const CArm& carm) {
    Box box;
    const auto include = [&](double u, double v) {
        const Vector2 ideal = carm.idealPixel({u, v});
        if (!ideal.allFinite()) return;  // outside the distortion's field
        box.low = box.low.cwiseMin(ideal);
        box.high = box.high.cwiseMax(ideal);
    };
    constexpr int kSteps = 32;
    for (int i = 0; i <= kSteps; ++i) {
        const double u = -0.5 + carm.columns * (i / double(kSteps)), v = -0.5 + carm.rows * (i / double(kSteps));
        include(u, -0.5);
        include(u, carm.rows - 0.5);
        include(-0.5, v);
        include(carm.columns - 0.5, v);
    }
    if (!(box.low.x() <= box.high.x())) return {Vector2(-0.5, -0.5), Vector2(carm.columns - 0.5, carm.rows - 0.5)};
    return box;
}

// What one observation says about a point.
struct Linearized {
    Vector2 residual;
    Matrix23 by_point;  // d(predicted pixel) / d(point in the world)
    Matrix2 covariance;
};

Linearized linearize(const Observation& seen, const Vector3& point) {
    const ProjectionJacobian by = projectionJacobian(seen.view.carm, seen.view.imager_from_world, point);
    Linearized result;
    result.residual = seen.pixel - seen.view.carm.project(seen.view.imager_from_world * point);
    result.by_point = by.point;
    result.covariance =
        seen.sigma_px * seen.sigma_px * Matrix2::Identity() + by.pose * seen.view.covariance * by.pose.transpose();
    return result;
}

// The point nearest to all rays.
Vector3 midpoint(const std::vector<Ray>& rays) {
    Matrix3 sum = Matrix3::Zero();
    Vector3 right = Vector3::Zero();
    for (const Ray& ray : rays) {
        const Matrix3 across = Matrix3::Identity() - ray.direction * ray.direction.transpose();
        sum += across;
        right += across * ray.origin;
    }
    return sum.ldlt().solve(right);
}

double largestAngle(const std::vector<Ray>& rays) {
    double largest = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        for (std::size_t j = 0; j < i; ++j) {
            const Vector3 &a = rays[i].direction, &b = rays[j].direction;
            const double angle = std::atan2(a.cross(b).norm(), a.dot(b));
            // Opposite views see depth as badly as equal ones.
            largest = std::max(largest, std::min(angle, std::numbers::pi - angle));
        }
    }
    return largest;
}

std::string spread(const std::vector<Ray>& rays, double angle_rad) {
    const std::string angle = fmt::format("{:.1f} degrees", degreesFromRadians(angle_rad));
    if (rays.size() > 2) return fmt::format("all {} views look along one line within {}", rays.size(), angle);
    const bool opposite = rays[0].direction.dot(rays[1].direction) < 0;
    return fmt::format("the two views are only {} {}", angle, opposite ? "from opposite" : "apart");
}

Result<void> checkObservations(const std::vector<Observation>& observations) {
    if (observations.size() < 2) {
        return invalidInput("triangulation",
                            fmt::format("{} view{}", observations.size(), observations.empty() ? "s" : ""),
                            "two views of the point or more", "a single view does not tell depth");
    }
    for (std::size_t i = 0; i < observations.size(); ++i) {
        const Observation& o = observations[i];
        const std::string where = fmt::format("triangulation, view {}", i + 1);
        if (!(o.sigma_px > 0 && std::isfinite(o.sigma_px))) {
            return invalidInput(where + ", sigma_px", fmt::format("{}", o.sigma_px), "a positive number of pixels");
        }
        if (!(o.pixel.allFinite() && o.view.carm.rayDirection(o.pixel).allFinite())) {
            return invalidInput(where, fmt::format("the pixel ({}, {})", o.pixel.x(), o.pixel.y()),
                                "a pixel inside the field of the C-arm's distortion");
        }
        if (!o.view.covariance.allFinite()) {
            return invalidInput(where, "a pose covariance that is not finite", "zero for an exact pose");
        }
    }
    return {};
}

Error behindSource(std::size_t view) {
    return noSolution("triangulation", fmt::format("a point behind the X-ray source of view {}", view + 1),
                      "a point in front of every source",
                      "check that all pixels show the same point, and the views' poses");
}

}  // namespace

Ray pixelRay(const CArm& carm, const Rigid3& imager_from_world, const Vector2& pixel) {
    const Rigid3 world_from_imager = imager_from_world.inverse();
    return {world_from_imager.translation(), world_from_imager.rotate(carm.rayDirection(pixel))};
}

Result<Vector3> epipolarLine(const View& a, const Vector2& pixel, const View& b) {
    const Segment ray = rayInOtherView(a, pixel, b);
    const Vector3 normal = ray.start.cross(ray.step);  // of the plane through both sources and the ray
    // b's source within a micron of the ray, seen along metres, leaves no direction.
    if (!(normal.norm() > 1e-3 * ray.step.norm())) {
        return noSolution("epipolar line", "the X-ray source of the other view on the ray",
                          "views taken from different places");
    }
    const CArm& carm = b.carm;
    const Vector2 slope = normal.head<2>().cwiseProduct(carm.pixel_mm) / carm.focal_length_mm;
    const Vector3 line(slope.x(), slope.y(), normal.z() - slope.dot(carm.principal_point_px));
    if (!(slope.norm() > 1e-12 * std::abs(line.z()))) {  // the plane is parallel to b's detector
        return noSolution("epipolar line", "a ray parallel to the other view's detector, at its source's height",
                          "views that can see each other's rays");
    }
    return Vector3(line / slope.norm());
}

Result<std::vector<Vector2>> epipolarCurve(const View& a, const Vector2& pixel, const View& b, double step_px) {
    if (!(step_px > 0)) return invalidOption("step_px", fmt::format("{}", step_px), "more than 0 pixels");
    if (const Result<Vector3> line = epipolarLine(a, pixel, b); !line) return line.error();
    const Segment ray = rayInOtherView(a, pixel, b);

    // Between a's source and detector, in front of b's source, and in the box of b's ideal image. The last is three
    // linear inequalities in s as well: (u, v) - bound times depth.
    double from = 0, to = 1;
    const auto keepPositive = [&](double at_start, double slope) {  // at_start + s * slope >= 0
        const double crossing = -at_start / slope;
        if (slope > 0) from = std::max(from, crossing);
        if (slope < 0) to = std::min(to, crossing);
        if (slope == 0 && at_start < 0) to = -1;
    };
    constexpr double kNearest_mm = 1e-3;
    keepPositive(ray.start.z() - kNearest_mm, ray.step.z());
    const Box box = idealImage(b.carm);
    for (int axis = 0; axis < 2; ++axis) {
        const double scale = b.carm.focal_length_mm / b.carm.pixel_mm[axis];
        const double low = box.low[axis] - b.carm.principal_point_px[axis];
        const double high = box.high[axis] - b.carm.principal_point_px[axis];
        keepPositive(scale * ray.start[axis] - low * ray.start.z(), scale * ray.step[axis] - low * ray.step.z());
        keepPositive(high * ray.start.z() - scale * ray.start[axis], high * ray.step.z() - scale * ray.step[axis]);
    }
    if (!(from <= to)) return std::vector<Vector2>();

    const Vector2 begin = b.carm.projectIdeal(ray.start + from * ray.step);
    const Vector2 end = b.carm.projectIdeal(ray.start + to * ray.step);
    const int pieces = std::max(1, static_cast<int>(std::ceil((end - begin).norm() / step_px)));
    std::vector<Vector2> curve;
    for (int i = 0; i <= pieces; ++i) {
        const Vector2 vertex = b.carm.distortedPixel(begin + (end - begin) * i / pieces);
        if (vertex.allFinite()) curve.push_back(vertex);
    }
    return curve;
}

Result<void> TriangulationOptions::validate() const {
    if (!(parallel_rad > 0 && parallel_rad < 1)) {
        return invalidOption("parallel_rad", fmt::format("{}", parallel_rad), "more than 0, less than 1");
    }
    if (!(narrow_rad >= parallel_rad && narrow_rad < 2)) {
        return invalidOption("narrow_rad", fmt::format("{}", narrow_rad), "parallel_rad to 2");
    }
    if (!(iterations >= 1)) return invalidOption("iterations", fmt::format("{}", iterations), "1 or more");
    return {};
}

TriangulatedPoint::TriangulatedPoint()
    : point(Vector3::Constant(kNaN)),
      covariance(Matrix3::Constant(kNaN)),
      rms_px(kNaN),
      chi_squared(kNaN),
      angle_rad(kNaN),
      weakest_direction(Vector3::Constant(kNaN)),
      weakest_sigma_mm(kNaN) {}

Result<TriangulatedPoint> triangulate(const std::vector<Observation>& observations,
                                      const TriangulationOptions& options) {
    if (const Result<void> valid = options.validate(); !valid) return valid.error();
    if (const Result<void> valid = checkObservations(observations); !valid) return valid.error();

    TriangulatedPoint result;
    std::vector<Ray> rays;
    for (const Observation& o : observations)
        rays.push_back(pixelRay(o.view.carm, o.view.imager_from_world, o.pixel));
    result.angle_rad = largestAngle(rays);
    if (!(result.angle_rad >= options.parallel_rad)) {
        return noSolution("triangulation", spread(rays, result.angle_rad) + ": depth is not observable",
                          "views from different directions", "turn the C-arm by 30 degrees or more between the images");
    }

    result.point = midpoint(rays);
    Matrix3 information;
    const auto accumulate = [&](auto&& use) -> std::optional<std::size_t> {  // the view that has the point behind it
        for (std::size_t i = 0; i < observations.size(); ++i) {
            if (!((observations[i].view.imager_from_world * result.point).z() > 0)) return i;
            use(linearize(observations[i], result.point));
        }
        return std::nullopt;
    };
    bool converged = false;
    while (!converged && result.iterations < options.iterations) {
        ++result.iterations;
        information.setZero();
        Vector3 right = Vector3::Zero();
        const auto behind = accumulate([&](const Linearized& o) {
            const Matrix23 weighted = o.covariance.ldlt().solve(o.by_point);
            information += o.by_point.transpose() * weighted;
            right += weighted.transpose() * o.residual;
        });
        if (behind) return behindSource(*behind);
        const Vector3 step = information.ldlt().solve(right);
        if (!step.allFinite()) break;
        result.point += step;
        converged = step.norm() < 1e-7;  // mm: far below any use, above rounding at a metre
    }
    if (!converged) {
        return noSolution("triangulation", fmt::format("no convergence in {} steps", result.iterations),
                          "pixels that show one point", "check the pixels and the views' poses");
    }

    result.covariance = information.inverse();
    result.chi_squared = 0;
    double squares = 0;
    const auto behind = accumulate([&](const Linearized& o) {
        result.residuals_px.push_back(o.residual);
        squares += o.residual.squaredNorm();
        result.chi_squared += o.residual.dot(o.covariance.ldlt().solve(o.residual));
    });
    if (behind) return behindSource(*behind);
    result.rms_px = std::sqrt(squares / static_cast<double>(2 * observations.size()));
    result.degrees_of_freedom = static_cast<int>(2 * observations.size()) - 3;
    const Eigen::SelfAdjointEigenSolver<Matrix3> axes(result.covariance);
    result.weakest_direction = axes.eigenvectors().col(2);
    result.weakest_sigma_mm = std::sqrt(axes.eigenvalues()[2]);

    if (result.angle_rad < options.narrow_rad) {
        result.warnings.push_back(
            fmt::format("{}: depth is hardly observable (standard deviation {:.2g} mm along the viewing direction, "
                        "{:.2g} mm across it).",
                        spread(rays, result.angle_rad), result.weakest_sigma_mm, std::sqrt(axes.eigenvalues()[1])));
    }
    // Chance leaves a chi-squared mean of one per degree of freedom; nine is three standard deviations in every
    // residual.
    if (result.chi_squared > 9 * result.degrees_of_freedom) {
        result.warnings.push_back(
            fmt::format("the residuals ({:.2g} px rms) are far above the stated noise of pixels and poses: "
                        "the pixels may show different points, or the poses are worse than stated.",
                        result.rms_px));
    }
    return result;
}

}  // namespace fluorocut
