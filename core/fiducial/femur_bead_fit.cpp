#include "core/fiducial/femur_bead_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "core/geometry/pose.h"

namespace fluorocut::femur_beads {
namespace {

constexpr double kRobustScale = 4;     // standard deviations, of a shadow's place in two dimensions
constexpr double kPriorDegrees = 12;   // what the usual size of unexplained errors counts for
constexpr double kLeastWeight = 0.25;  // of a shadow that is kept: four standard deviations
constexpr double kLeastUnexplainedPx = 1e-3;
constexpr int kIterations = 60;

// d predicted pixel / d (pose, relative focal length, centre u v, the bead's place): 2 x 12.
Eigen::Matrix<double, 2, 12> jacobianOf(const FitView& view, const Bead& bead) {
    const Vector3 place = view.imager_from_femur * bead.center_mm;
    const double z = place.z(), radius = 0.5 * bead.diameter_mm;
    const double denominator = z * z - radius * radius;
    const double f = view.intrinsics.focal_px, scale = f * z / denominator;
    const double by_z = f * (denominator - 2 * z * z) / (denominator * denominator);
    Eigen::Matrix<double, 2, 3> by_place;
    by_place << scale, 0, by_z * place.x(), 0, scale, by_z * place.y();
    by_place.row(1) *= view.intrinsics.aspect;
    Eigen::Matrix<double, 2, 12> jacobian;
    jacobian.leftCols<6>() = by_place * pointByPose(view.imager_from_femur, bead.center_mm);
    jacobian.col(6) << scale * place.x(), view.intrinsics.aspect * scale * place.y();
    jacobian.middleCols<2>(7) = Matrix2::Identity();
    jacobian.rightCols<3>() = by_place * view.imager_from_femur.rotationMatrix();
    return jacobian;
}

double weightOf(double squared) {
    const double ratio = 1 + squared / (kRobustScale * kRobustScale);
    return 1 / (ratio * ratio);
}

double squaredDistance(const Vector2& residual, const Seen& seen, double unexplained) {
    const Matrix2 covariance = seen.covariance_px2 + unexplained * unexplained * Matrix2::Identity();
    return residual.dot(covariance.inverse() * residual);
}

// A known geometry between the first view and another that is among those solved.
struct Link {
    std::size_t first, other;
};
std::vector<Link> linksOf(const std::vector<FitView>& views) {
    std::vector<Link> links;
    for (std::size_t i = 0; i < views.size(); ++i) {
        if (!views[i].is_first) continue;
        for (std::size_t k = 0; k < views.size(); ++k)
            if (k != i && views[k].geometry_known) links.push_back({i, k});
    }
    return links;
}

Vector6 gapOf(const FitView& first, const FitView& other) {
    return (other.imager_from_femur * first.imager_from_femur.inverse()).deltaFrom(other.imager_from_first);
}

Eigen::LDLT<Matrix6> weightOf(const Link& link, const std::vector<FitView>& views) {
    Matrix6 covariance = views[link.other].covariance_from_first;
    covariance.diagonal().array() += 1e-14;  // what is exact stays solvable
    return Eigen::LDLT<Matrix6>(covariance);
}

// Robust: Geman and McClure's. Otherwise with the weights as they stand.
double cost(const std::vector<FitView>& views, const BeadLayout& layout, double unexplained, bool robust) {
    double sum = 0;
    for (const FitView& view : views) {
        for (const Seen& seen : view.seen) {
            if (!((view.imager_from_femur * layout.beads[seen.bead].center_mm).z() >
                  layout.beads[seen.bead].diameter_mm))
                return std::numeric_limits<double>::infinity();
            const double squared = squaredDistance(residual(view, layout, seen), seen, unexplained);
            sum += robust ? squared / (1 + squared / (kRobustScale * kRobustScale)) : seen.weight * squared;
        }
    }
    for (const Link& link : linksOf(views)) {
        const Vector6 gap = gapOf(views[link.first], views[link.other]);
        sum += gap.dot(weightOf(link, views).solve(gap));
    }
    return sum;
}

struct Normal {
    Eigen::MatrixXd poses;      // H
    Eigen::MatrixXd to_shared;  // poses x parameters
    Eigen::VectorXd gradient;
};

Normal normalEquations(std::vector<FitView>& views, const BeadLayout& layout, double unexplained, bool robust) {
    const auto rows = static_cast<Eigen::Index>(6 * views.size());
    const auto shared = 3 + 3 * static_cast<Eigen::Index>(layout.beads.size());
    Normal normal{Eigen::MatrixXd::Zero(rows, rows), Eigen::MatrixXd::Zero(rows, shared), Eigen::VectorXd::Zero(rows)};
    for (std::size_t k = 0; k < views.size(); ++k) {
        const auto at = static_cast<Eigen::Index>(6 * k);
        for (Seen& seen : views[k].seen) {
            const Vector2 r = residual(views[k], layout, seen);
            if (robust) seen.weight = weightOf(squaredDistance(r, seen, unexplained));
            const Matrix2 information =
                seen.weight * (seen.covariance_px2 + unexplained * unexplained * Matrix2::Identity()).inverse();
            const auto j = jacobianOf(views[k], layout.beads[seen.bead]);
            const Eigen::Matrix<double, 6, 2> left = j.leftCols<6>().transpose() * information;
            normal.poses.block<6, 6>(at, at) += left * j.leftCols<6>();
            normal.to_shared.block<6, 3>(at, 0) += left * j.middleCols<3>(6);
            normal.to_shared.block<6, 3>(at, 3 + 3 * static_cast<Eigen::Index>(seen.bead)) += left * j.rightCols<3>();
            normal.gradient.segment<6>(at) -= left * r;
        }
    }
    for (const Link& link : linksOf(views)) {
        const FitView &first = views[link.first], &other = views[link.other];
        const Vector6 gap = gapOf(first, other);
        const Rigid3 back = first.imager_from_femur.inverse();
        const Matrix6 by_other = productByLeft(other.imager_from_femur, back);
        const Matrix6 by_first = productByRight(other.imager_from_femur) * inverseByPose(first.imager_from_femur);
        const auto weight = weightOf(link, views);
        const auto a = static_cast<Eigen::Index>(6 * link.first), b = static_cast<Eigen::Index>(6 * link.other);
        normal.poses.block<6, 6>(a, a) += by_first.transpose() * weight.solve(by_first);
        normal.poses.block<6, 6>(b, b) += by_other.transpose() * weight.solve(by_other);
        const Matrix6 across = by_first.transpose() * weight.solve(by_other);
        normal.poses.block<6, 6>(a, b) += across;
        normal.poses.block<6, 6>(b, a) += across.transpose();
        normal.gradient.segment<6>(a) += by_first.transpose() * weight.solve(gap);
        normal.gradient.segment<6>(b) += by_other.transpose() * weight.solve(gap);
    }
    return normal;
}

bool minimise(std::vector<FitView>& views, const BeadLayout& layout, double unexplained, bool robust) {
    double damping = 1e-6, now = cost(views, layout, unexplained, robust);
    for (int iteration = 0; iteration < kIterations; ++iteration) {
        const Normal normal = normalEquations(views, layout, unexplained, robust);
        Eigen::MatrixXd damped = normal.poses;
        damped.diagonal() *= 1 + damping;
        const Eigen::VectorXd step = -damped.ldlt().solve(normal.gradient);
        if (!step.allFinite()) return false;
        std::vector<FitView> next = views;
        for (std::size_t k = 0; k < next.size(); ++k) {
            next[k].imager_from_femur =
                next[k].imager_from_femur.perturbed(step.segment<6>(static_cast<Eigen::Index>(6 * k)));
        }
        const double then = cost(next, layout, unexplained, robust);
        const double expected = -step.dot(normal.gradient);
        if (then <= now) {
            views = std::move(next);
            damping = std::max(damping * 0.1, 1e-12);
            const bool settled = now - then < 1e-10 * (1 + now);
            now = then;
            if (settled) return true;
        } else {
            if (expected < 1e-9 * (1 + now)) return true;
            damping *= 10;
            if (damping > 1e8) return false;
        }
    }
    return true;
}

double unexplainedOf(const std::vector<FitView>& views, const BeadLayout& layout, double usual_px) {
    double degrees = -6 * static_cast<double>(views.size() - linksOf(views).size()), spread = 0, count = 0;
    for (const FitView& view : views) {
        for (const Seen& seen : view.seen) {
            degrees += 2 * seen.weight;
            spread += 0.5 * seen.covariance_px2.trace();
            count += 1;
        }
    }
    spread /= std::max(count, 1.0);
    const double usual = spread + usual_px * usual_px;
    // Squares over S + s^2 minus what is expected: falls with s.
    const auto excess = [&](double s) {
        double squares = 0;
        for (const FitView& view : views)
            for (const Seen& seen : view.seen)
                squares += seen.weight * squaredDistance(residual(view, layout, seen), seen, s);
        return squares - std::max(degrees, 0.0) + kPriorDegrees * (usual / (spread + s * s) - 1);
    };
    double low = kLeastUnexplainedPx, high = 100;
    if (!(excess(low) > 0)) return low;
    while (high > 1.0001 * low) {
        const double middle = std::sqrt(low * high);
        (excess(middle) > 0 ? low : high) = middle;
    }
    return high;
}

}  // namespace

Vector2 residual(const FitView& view, const BeadLayout& layout, const Seen& seen) {
    const Bead& bead = layout.beads[seen.bead];
    return seen.ideal_px -
           predictedPixel(view.intrinsics, view.imager_from_femur * bead.center_mm, 0.5 * bead.diameter_mm);
}

Fit fit(std::vector<FitView>& views, const BeadLayout& layout, double usual_unexplained_px) {
    Fit result;
    result.unexplained_px = usual_unexplained_px;
    // Robust until the size of the errors has settled; then what is left out is left out, and the rest is plain least
    // squares: its covariance is then the estimate's.
    for (const bool robust : {true, false}) {
        for (int round = 0; round < 6; ++round) {
            result.converged = minimise(views, layout, result.unexplained_px, robust);
            const double next = unexplainedOf(views, layout, usual_unexplained_px);
            const bool settled = std::abs(next - result.unexplained_px) < 0.005 * next;
            result.unexplained_px = next;
            if (settled && round > 0) break;
        }
        if (robust) {
            for (FitView& view : views)
                for (Seen& seen : view.seen)
                    seen.weight = seen.weight < kLeastWeight ? 0 : 1;
        }
    }
    const Normal normal = normalEquations(views, layout, result.unexplained_px, false);
    const Eigen::LDLT<Eigen::MatrixXd> solver(normal.poses);
    const Eigen::MatrixXd inverse = solver.solve(Eigen::MatrixXd::Identity(normal.poses.rows(), normal.poses.cols()));
    result.covariance = 0.5 * (inverse + inverse.transpose());
    result.sensitivity = -solver.solve(normal.to_shared);
    result.converged = result.converged && result.covariance.allFinite();
    return result;
}

PoseEvidence evidenceOf(const FitView& view, const BeadLayout& layout, double unexplained_px) {
    const auto shared = 3 + 3 * static_cast<Eigen::Index>(layout.beads.size());
    PoseEvidence evidence;
    evidence.target_from_source = view.imager_from_femur;
    evidence.shared = Eigen::VectorXd::Zero(shared);
    for (std::size_t i = 0; i < layout.beads.size(); ++i)
        evidence.shared.segment<3>(3 + 3 * static_cast<Eigen::Index>(i)) = layout.beads[i].center_mm;
    evidence.information = Eigen::MatrixXd::Zero(6 + shared, 6 + shared);
    evidence.gradient = Eigen::VectorXd::Zero(6 + shared);
    for (const Seen& seen : view.seen) {
        Eigen::MatrixXd j = Eigen::MatrixXd::Zero(2, 6 + shared);
        const auto by = jacobianOf(view, layout.beads[seen.bead]);
        j.leftCols<9>() = by.leftCols<9>();
        j.middleCols<3>(9 + 3 * static_cast<Eigen::Index>(seen.bead)) = by.rightCols<3>();
        const Matrix2 information =
            seen.weight * (seen.covariance_px2 + unexplained_px * unexplained_px * Matrix2::Identity()).inverse();
        evidence.information += j.transpose() * information * j;
        evidence.gradient -= j.transpose() * (information * residual(view, layout, seen));
    }
    return evidence;
}

}  // namespace fluorocut::femur_beads
