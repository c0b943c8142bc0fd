// Polynomials of total degree n in the plane in the Bernstein basis on a triangle (Farin 1986):
//
//     B_ijk(p) = n! / (i! j! k!) l1^i l2^j l3^k,   i + j + k = n,   l: barycentric coordinates of p
//
// (n + 1)(n + 2) / 2 functions, not negative on the triangle, with sum one: coefficients are of the size of the values
// and a fit to points spread over the triangle is well conditioned, unlike one in powers.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "core/geometry/rigid3.h"

namespace fluorocut {

class BernsteinTriangle {
  public:
    // Throws std::logic_error for corners on one line.
    explicit BernsteinTriangle(const std::array<Vector2, 3>& corners);
    // An equilateral triangle round the circle round an image.
    static BernsteinTriangle around(int columns, int rows);

    static int size(int degree) { return (degree + 1) * (degree + 2) / 2; }

    const std::array<Vector2, 3>& corners() const { return corners_; }
    Vector3 barycentric(const Vector2& point) const;
    Eigen::VectorXd basis(int degree, const Vector2& point) const;
    // One row of the basis for each point.
    Eigen::MatrixXd design(int degree, const std::vector<Vector2>& points) const;
    // The coefficients of degree `to` of what has coefficients c of degree `from`: elevation(from, to) * c.
    static Eigen::MatrixXd elevation(int from, int to);

    // The same polynomial in powers of local(point): value = sum m(i, j) x^i y^j, for quick evaluation.
    Eigen::MatrixXd powers(int degree, const Eigen::VectorXd& coefficients) const;
    Vector2 local(const Vector2& point) const { return (point - centroid_) / scale_; }
    double scale() const { return scale_; }

  private:
    std::array<Vector2, 3> corners_;
    Vector2 centroid_;
    double scale_;          // a triangle of the kind `around` has its inscribed circle at 1
    Eigen::Matrix3d from_;  // barycentric from (1, local x, local y)
};

}  // namespace fluorocut
