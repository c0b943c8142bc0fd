#include "core/distortion/models/triangle_polynomial.h"

#include <cmath>
#include <numbers>
#include <stdexcept>

#include <Eigen/LU>

namespace fluorocut {
namespace {

// Where B_ijk stands among those of its degree.
int indexOf(int degree, int i, int j) {
    // i runs slowest: rows of degree + 1, degree, ... entries.
    return i * (degree + 1) - i * (i - 1) / 2 + j;
}

double factorial(int n) {
    return std::tgamma(n + 1.0);
}

}  // namespace

BernsteinTriangle::BernsteinTriangle(const std::array<Vector2, 3>& corners) : corners_(corners) {
    centroid_ = (corners[0] + corners[1] + corners[2]) / 3;
    const Vector2 a = corners[1] - corners[0], b = corners[2] - corners[0];
    const double area = std::abs(a.x() * b.y() - a.y() * b.x());
    scale_ = area / (a.norm() + b.norm() + (b - a).norm());  // of the inscribed circle
    if (!(scale_ > 0)) throw std::logic_error("BernsteinTriangle: the corners lie on one line");
    Eigen::Matrix3d to;
    for (int c = 0; c < 3; ++c)
        to.col(c) << 1, local(corners[static_cast<std::size_t>(c)]);
    from_ = to.inverse();
}

BernsteinTriangle BernsteinTriangle::around(int columns, int rows) {
    const Vector2 middle = 0.5 * Vector2(columns - 1, rows - 1);
    const double radius = 0.5 * std::hypot(columns, rows);
    std::array<Vector2, 3> corners;
    for (int c = 0; c < 3; ++c) {
        const double angle = std::numbers::pi * (0.5 + 2.0 * c / 3);
        corners[static_cast<std::size_t>(c)] = middle + 2 * radius * Vector2(std::cos(angle), std::sin(angle));
    }
    return BernsteinTriangle(corners);
}

Vector3 BernsteinTriangle::barycentric(const Vector2& point) const {
    const Vector2 at = local(point);
    return from_ * Vector3(1, at.x(), at.y());
}

Eigen::VectorXd BernsteinTriangle::basis(int degree, const Vector2& point) const {
    // From degree 0 upward: B^n_ijk = l1 B^(n-1)_(i-1)jk + l2 B^(n-1)_i(j-1)k + l3 B^(n-1)_ij(k-1).
    const Vector3 l = barycentric(point);
    Eigen::VectorXd last = Eigen::VectorXd::Ones(1);
    for (int n = 1; n <= degree; ++n) {
        Eigen::VectorXd next = Eigen::VectorXd::Zero(size(n));
        for (int i = 0; i < n; ++i) {
            for (int j = 0; i + j < n; ++j) {
                const double value = last[indexOf(n - 1, i, j)];
                next[indexOf(n, i + 1, j)] += l[0] * value;
                next[indexOf(n, i, j + 1)] += l[1] * value;
                next[indexOf(n, i, j)] += l[2] * value;
            }
        }
        last = std::move(next);
    }
    return last;
}

Eigen::MatrixXd BernsteinTriangle::design(int degree, const std::vector<Vector2>& points) const {
    Eigen::MatrixXd rows(static_cast<Eigen::Index>(points.size()), size(degree));
    for (Eigen::Index i = 0; i < rows.rows(); ++i)
        rows.row(i) = basis(degree, points[static_cast<std::size_t>(i)]).transpose();
    return rows;
}

Eigen::MatrixXd BernsteinTriangle::elevation(int from, int to) {
    Eigen::MatrixXd result = Eigen::MatrixXd::Identity(size(from), size(from));
    for (int n = from; n < to; ++n) {
        // B^n_ijk (l1 + l2 + l3) = ((i+1) B^(n+1)_(i+1)jk + (j+1) B^(n+1)_i(j+1)k + (k+1) B^(n+1)_ij(k+1)) / (n + 1)
        Eigen::MatrixXd step = Eigen::MatrixXd::Zero(size(n + 1), size(n));
        for (int i = 0; i <= n; ++i) {
            for (int j = 0; i + j <= n; ++j) {
                const int column = indexOf(n, i, j);
                step(indexOf(n + 1, i + 1, j), column) = (i + 1.0) / (n + 1);
                step(indexOf(n + 1, i, j + 1), column) = (j + 1.0) / (n + 1);
                step(indexOf(n + 1, i, j), column) = (n - i - j + 1.0) / (n + 1);
            }
        }
        result = (step * result).eval();
    }
    return result;
}

Eigen::MatrixXd BernsteinTriangle::powers(int degree, const Eigen::VectorXd& coefficients) const {
    if (coefficients.size() != size(degree)) throw std::logic_error("BernsteinTriangle: wrong number of coefficients");
    const auto times = [&](const Eigen::MatrixXd& polynomial, int corner) {  // by that barycentric coordinate
        Eigen::MatrixXd product = from_(corner, 0) * polynomial;
        product.bottomRows(degree) += from_(corner, 1) * polynomial.topRows(degree);
        product.rightCols(degree) += from_(corner, 2) * polynomial.leftCols(degree);
        return product;
    };
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(degree + 1, degree + 1);
    Eigen::MatrixXd first = Eigen::MatrixXd::Zero(degree + 1, degree + 1);
    first(0, 0) = 1;
    for (int i = 0; i <= degree; ++i) {
        Eigen::MatrixXd second = first;
        for (int j = 0; i + j <= degree; ++j) {
            Eigen::MatrixXd third = second;
            for (int k = 0; i + j + k < degree; ++k)
                third = times(third, 2);
            const double multinomial = factorial(degree) / (factorial(i) * factorial(j) * factorial(degree - i - j));
            sum += multinomial * coefficients[indexOf(degree, i, j)] * third;
            if (i + j < degree) second = times(second, 1);
        }
        if (i < degree) first = times(first, 0);
    }
    return sum;
}

}  // namespace fluorocut
