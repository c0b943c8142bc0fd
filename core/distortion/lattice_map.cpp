#include "core/distortion/lattice_map.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>

#include "core/base/median.h"

namespace fluorocut::grooves {
namespace {

// Prior standard deviation of a coefficient, by degree, over the radius: the linear terms against the given Jacobian,
// then bends of up to about twice those of a 9-inch intensifier of the 1980s (8 px of 256).
constexpr std::array<double, LatticeMap::kOrder + 1> kPriorShare = {1e3, 0.15, 0.05, 0.06, 0.03, 0.03};

constexpr int kIterations = 4;

}  // namespace

LatticeMap::LatticeMap(const Vector2& center, double radius, const Eigen::Matrix2d& jacobian)
    : center_(center), radius_(radius) {
    const double radius_pitches = radius * std::sqrt(std::abs(jacobian.determinant()));
    for (int degree = 0, n = 0; degree <= kOrder; ++degree) {
        const double sigma = kPriorShare[static_cast<std::size_t>(degree)] * radius_pitches;
        for (int k = 0; k <= degree; ++k)
            prior_precision_[n++] = 1 / (sigma * sigma);
    }
    for (std::size_t c = 0; c < 2; ++c) {
        prior_mean_[c].setZero();
        prior_mean_[c].segment<2>(1) = radius * jacobian.row(static_cast<Eigen::Index>(c)).transpose();
        coefficients_[c] = prior_mean_[c];
        covariance_[c] = prior_precision_.cwiseInverse().asDiagonal();
    }
}

// 1, x, y, x^2, x y, y^2, ...
LatticeMap::Terms LatticeMap::basis(const Vector2& pixel) const {
    const double x = (pixel.x() - center_.x()) / radius_, y = (pixel.y() - center_.y()) / radius_;
    Terms terms;
    terms[0] = 1;
    for (int degree = 1, n = 1; degree <= kOrder; ++degree) {
        const int before = n - degree;  // first term of the degree below
        for (int k = 0; k < degree; ++k)
            terms[n++] = terms[before + k] * x;
        terms[n] = terms[n - 1 - degree] * y;
        ++n;
    }
    return terms;
}

bool LatticeMap::fit(int coordinate, std::span<const LatticeSample> samples, double least_cut) {
    if (samples.size() < 6) return false;
    const auto c = static_cast<std::size_t>(coordinate);
    std::vector<Terms> rows(samples.size());
    std::transform(samples.begin(), samples.end(), rows.begin(),
                   [&](const auto& sample) { return basis(sample.pixel); });
    std::vector<double> weights(samples.size()), residuals(samples.size()), magnitudes(samples.size());
    for (std::size_t n = 0; n < samples.size(); ++n)
        weights[n] = samples[n].weight;
    for (int iteration = 0; iteration < kIterations; ++iteration) {
        Square normal = Square::Zero();
        Terms right = prior_precision_.cwiseProduct(prior_mean_[c]);
        for (std::size_t n = 0; n < samples.size(); ++n) {
            if (weights[n] <= 0) continue;
            const Terms weighted = weights[n] * rows[n];
            for (int k = 0; k < kTerms; ++k)
                normal.col(k).tail(kTerms - k) += weighted[k] * rows[n].tail(kTerms - k);
            right += samples[n].value * weighted;
        }
        normal.diagonal() += prior_precision_;
        const Eigen::LLT<Square, Eigen::Lower> solver(normal);
        if (solver.info() != Eigen::Success) return false;
        coefficients_[c] = solver.solve(right);
        if (!coefficients_[c].allFinite()) return false;
        if (iteration + 1 == kIterations) {
            covariance_[c] = solver.solve(Square::Identity());
            break;
        }
        for (std::size_t n = 0; n < samples.size(); ++n) {
            residuals[n] = samples[n].value - rows[n].dot(coefficients_[c]);
            magnitudes[n] = std::abs(residuals[n]);
        }
        const double cut = std::max(4 * 1.4826 * median(magnitudes), least_cut);
        for (std::size_t n = 0; n < samples.size(); ++n) {
            const double ratio = residuals[n] / cut, inside = 1 - ratio * ratio;
            weights[n] = inside > 0 ? samples[n].weight * inside * inside : 0;
        }
    }
    return true;
}

double LatticeMap::sigma(int coordinate, const Vector2& pixel) const {
    const Terms terms = basis(pixel);
    return std::sqrt(std::max(0.0, terms.dot(covariance_[static_cast<std::size_t>(coordinate)] * terms)));
}

LatticeMap LatticeMap::transformed(double scale, const Vector2& shift) const {
    LatticeMap result = *this;
    for (std::size_t c = 0; c < 2; ++c) {
        result.coefficients_[c] *= scale;
        result.coefficients_[c][0] += shift[static_cast<Eigen::Index>(c)];
        result.covariance_[c] *= scale * scale;
    }
    return result;
}

LatticeMap LatticeMap::magnified(int factor) const {
    LatticeMap result = *this;
    result.center_ = factor * center_ + Vector2::Constant(0.5 * (factor - 1));
    result.radius_ = factor * radius_;
    return result;
}

Vector2 LatticeMap::at(const Vector2& pixel) const {
    const Terms terms = basis(pixel);
    return {terms.dot(coefficients_[0]), terms.dot(coefficients_[1])};
}

LatticePlace LatticeMap::place(const Vector2& pixel) const {
    const double x = (pixel.x() - center_.x()) / radius_, y = (pixel.y() - center_.y()) / radius_;
    std::array<double, kOrder + 1> px, py;
    px[0] = py[0] = 1;
    for (std::size_t n = 1; n <= kOrder; ++n) {
        px[n] = px[n - 1] * x;
        py[n] = py[n - 1] * y;
    }
    LatticePlace place;
    int n = 0;
    for (int degree = 0; degree <= kOrder; ++degree) {
        for (int b = 0; b <= degree; ++b, ++n) {  // x^a y^b
            const int a = degree - b;
            const auto ua = static_cast<std::size_t>(a), ub = static_cast<std::size_t>(b);
            const double dx = a > 0 ? a * px[ua - 1] * py[ub] : 0, dy = b > 0 ? b * px[ua] * py[ub - 1] : 0;
            const double dxx = a > 1 ? a * (a - 1) * px[ua - 2] * py[ub] : 0;
            const double dyy = b > 1 ? b * (b - 1) * px[ua] * py[ub - 2] : 0;
            const double dxy = a > 0 && b > 0 ? a * b * px[ua - 1] * py[ub - 1] : 0;
            for (int c = 0; c < 2; ++c) {
                const double k = coefficients_[static_cast<std::size_t>(c)][n];
                place.lattice[c] += k * px[ua] * py[ub];
                place.jacobian(c, 0) += k * dx / radius_;
                place.jacobian(c, 1) += k * dy / radius_;
                auto& hessian = place.hessian[static_cast<std::size_t>(c)];
                const double scale = k / (radius_ * radius_);
                hessian(0, 0) += scale * dxx;
                hessian(0, 1) += scale * dxy;
                hessian(1, 0) += scale * dxy;
                hessian(1, 1) += scale * dyy;
            }
        }
    }
    return place;
}

std::optional<Vector2> LatticeMap::pixelOf(const Vector2& lattice, const Vector2& start) const {
    Vector2 pixel = start;
    for (int iteration = 0; iteration < 8; ++iteration) {
        const LatticePlace here = place(pixel);
        const Vector2 missing = lattice - here.lattice;
        if (iteration == 0 && !(missing.norm() < 3)) return std::nullopt;
        const double determinant = here.jacobian.determinant();
        if (!(determinant > 0)) return std::nullopt;
        const Vector2 step = here.jacobian.inverse() * missing;
        pixel += step;
        if (!((pixel - start).norm() * std::sqrt(determinant) < 4)) return std::nullopt;
        if (step.norm() < 1e-6) return pixel;
    }
    return std::nullopt;
}

}  // namespace fluorocut::grooves
