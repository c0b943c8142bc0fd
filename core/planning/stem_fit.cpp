#include "core/planning/stem_fit.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Cholesky>

namespace fluorocut {
namespace {

using Vector5 = Eigen::Matrix<double, 5, 1>;
using Matrix5 = Eigen::Matrix<double, 5, 5>;

struct Problem {
    const std::vector<Vector3>& points;
    const Filling& filling;
    Rigid3 start;
    Vector3 e1, e2, normal;
    double version_weight;

    // (two shifts in the seat, rotation vector) from a pose.
    Rigid3 moved(const Rigid3& pose, const Vector5& step) const {
        Vector6 delta;
        delta << step[0] * e1 + step[1] * e2, step.tail<3>();
        return pose.perturbed(delta);
    }
    // How far the stem's x axis has turned about the seat's normal since the start.
    double turn(const Rigid3& pose) const {
        const Vector3 a = start.rotate(Vector3::UnitX()), b = pose.rotate(Vector3::UnitX());
        const Vector3 a_flat = a - a.dot(normal) * normal, b_flat = b - b.dot(normal) * normal;
        return std::atan2(normal.dot(a_flat.cross(b_flat)), a_flat.dot(b_flat));
    }

    double value(const Rigid3& pose, double sharpness) const { return soft(pose, sharpness, nullptr, nullptr); }

    double soft(const Rigid3& pose, double sharpness, Vector5* gradient, Matrix5* hessian) const {
        std::vector<double> e(points.size());
        std::vector<Vector5> rows(gradient ? points.size() : 0);
        double most = -std::numeric_limits<double>::infinity();
        for (std::size_t i = 0; i < points.size(); ++i) {
            const Vector3 arm = pose.rotate(points[i]);
            Vector3 slope;
            e[i] = filling.excess(pose.translation() + arm, slope);
            most = std::max(most, e[i]);
            if (!gradient) continue;
            rows[i] << slope.dot(e1), slope.dot(e2), arm.cross(slope);
        }
        double sum = 0;
        Vector5 mean = Vector5::Zero();
        Matrix5 square = Matrix5::Zero();
        for (std::size_t i = 0; i < points.size(); ++i) {
            const double exponent = sharpness * (e[i] - most);
            if (exponent < -30) continue;
            const double weight = std::exp(exponent);
            sum += weight;
            if (!gradient) continue;
            mean += weight * rows[i];
            square += weight * rows[i] * rows[i].transpose();
        }
        const double turned = turn(pose);
        if (gradient) {
            mean /= sum;
            square /= sum;
            Vector5 about = Vector5::Zero();
            about.tail<3>() = normal;
            *gradient = mean + version_weight * turned * about;
            *hessian = sharpness * (square - mean * mean.transpose()) + version_weight * about * about.transpose();
        }
        return most + std::log(sum) / sharpness + 0.5 * version_weight * turned * turned;
    }
};

}  // namespace

StemFit evaluateStem(const std::vector<Vector3>& points, const Filling& filling, const Rigid3& pose) {
    StemFit fit{pose, -std::numeric_limits<double>::infinity(), 0};
    Vector3 ignored;
    for (std::size_t i = 0; i < points.size(); ++i)
        if (const double e = filling.excess(pose * points[i], ignored); e > fit.excess_mm) {
            fit.excess_mm = e;
            fit.worst = i;
        }
    return fit;
}

StemFit fitStem(const std::vector<Vector3>& points, const Filling& filling, const Rigid3& start,
                const Vector3& seat_normal, const StemFitOptions& options) {
    if (points.empty()) throw std::logic_error("fitStem: no points");
    Problem problem{points, filling, start, {}, {}, seat_normal.normalized(), options.version_weight};
    problem.e1 = problem.normal.unitOrthogonal();
    problem.e2 = problem.normal.cross(problem.e1);

    // A step of 1 mm, and of an angle that moves a point at 100 mm by 1 mm, count alike.
    Vector5 scale;
    scale << 1, 1, 1e4, 1e4, 1e4;
    Rigid3 pose = start;
    for (const double sharpness : {2.0, 6.0, 20.0, 60.0}) {
        double damping = 0.05;
        Vector5 gradient;
        Matrix5 hessian;
        double value = problem.soft(pose, sharpness, &gradient, &hessian);
        for (int step = 0; step < 25; ++step) {
            Matrix5 damped = hessian;
            damped.diagonal() += damping * scale;
            const Vector5 move = -damped.ldlt().solve(gradient);
            const Rigid3 next = problem.moved(pose, move);
            const double there = std::abs(problem.turn(next)) <= options.most_turn_rad
                                     ? problem.value(next, sharpness)
                                     : std::numeric_limits<double>::infinity();
            if (there < value) {
                const double gained = value - there;
                pose = next;
                value = problem.soft(pose, sharpness, &gradient, &hessian);
                damping = std::max(1e-4, 0.25 * damping);
                if (gained < 1e-4) break;
            } else {
                damping *= 5;
                if (damping > 1e4) break;
            }
        }
    }
    return evaluateStem(points, filling, pose);
}

}  // namespace fluorocut
