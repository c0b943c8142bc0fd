#include "core/fiducial/detection/three_points.h"

#include <cmath>
#include <complex>
#include <numbers>

namespace fluorocut::detection {
namespace {

using Complex = std::complex<double>;

// An orthonormal frame in a triangle.
Matrix3 frameOf(const std::array<Vector3, 3>& corners) {
    Matrix3 frame;
    frame.col(0) = (corners[1] - corners[0]).normalized();
    frame.col(2) = frame.col(0).cross(corners[2] - corners[0]).normalized();
    frame.col(1) = frame.col(2).cross(frame.col(0));
    return frame;
}

}  // namespace

std::vector<double> realRootsOfQuartic(const std::array<double, 5>& a) {
    std::vector<double> roots;
    const double largest = std::max({std::abs(a[0]), std::abs(a[1]), std::abs(a[2]), std::abs(a[3]), std::abs(a[4])});
    if (!(std::abs(a[4]) > 1e-14 * largest)) return roots;
    // Ferrari: x = y - b/4 makes it y^4 + p y^2 + q y + r.
    const double b = a[3] / a[4], c = a[2] / a[4], d = a[1] / a[4], e = a[0] / a[4];
    const double p = c - 3 * b * b / 8, q = d - b * c / 2 + b * b * b / 8,
                 r = e - b * d / 4 + b * b * c / 16 - 3 * b * b * b * b / 256;
    // A root z of the resolvent z^3 + 2 p z^2 + (p^2 - 4 r) z - q^2, by Cardano.
    const double k2 = 2 * p, k1 = p * p - 4 * r, k0 = -q * q;
    const Complex s = k1 - k2 * k2 / 3, t = 2 * k2 * k2 * k2 / 27 - k2 * k1 / 3 + k0;
    const Complex root = std::sqrt(t * t / 4.0 + s * s * s / 27.0);
    const Complex cube = std::abs(-t / 2.0 + root) > std::abs(-t / 2.0 - root) ? -t / 2.0 + root : -t / 2.0 - root;
    const Complex w = std::pow(cube, 1.0 / 3);
    Complex best = 0;
    for (int i = 0; i < 3; ++i) {
        const Complex turned = w * std::polar(1.0, 2 * std::numbers::pi * i / 3);
        const Complex z = (std::abs(turned) > 0 ? turned - s / (3.0 * turned) : Complex(0)) - k2 / 3;
        if (std::abs(z) > std::abs(best)) best = z;
    }
    std::array<Complex, 4> found;
    if (std::abs(best) < 1e-12) {  // biquadratic
        const Complex inner = std::sqrt(Complex(p * p - 4 * r));
        const Complex y0 = std::sqrt((-p + inner) / 2.0), y1 = std::sqrt((-p - inner) / 2.0);
        found = {y0, -y0, y1, -y1};
    } else {
        const Complex m = std::sqrt(best);
        const Complex u = -2 * p - best - 2 * q / m, v = -2 * p - best + 2 * q / m;
        found = {(m + std::sqrt(u)) / 2.0, (m - std::sqrt(u)) / 2.0, (-m + std::sqrt(v)) / 2.0,
                 (-m - std::sqrt(v)) / 2.0};
    }
    for (const Complex& y : found) {
        // A double root, blurred by rounding, has a small imaginary part: its real part is as good a start.
        if (std::abs(y.imag()) > 1e-3 * (1 + std::abs(y.real()))) continue;
        double x = y.real() - b / 4;
        for (int i = 0; i < 3; ++i) {
            const double value = (((a[4] * x + a[3]) * x + a[2]) * x + a[1]) * x + a[0];
            const double slope = ((4 * a[4] * x + 3 * a[3]) * x + 2 * a[2]) * x + a[1];
            if (!(std::abs(slope) > 1e-300)) break;
            const double step = value / slope;
            if (!(std::abs(step) < 0.1 * (1 + std::abs(x)))) break;
            x -= step;
        }
        if (std::isfinite(x)) roots.push_back(x);
    }
    return roots;
}

std::vector<std::array<double, 3>> distancesToThreePoints(const std::array<Vector3, 3>& points,
                                                          const std::array<Vector3, 3>& directions) {
    const double a2 = (points[1] - points[2]).squaredNorm(), b2 = (points[0] - points[2]).squaredNorm(),
                 c2 = (points[0] - points[1]).squaredNorm();
    const double alpha = directions[1].dot(directions[2]), beta = directions[0].dot(directions[2]),
                 gamma = directions[0].dot(directions[1]);
    if (!(b2 > 0)) return {};
    const double ac = (a2 - c2) / b2, pc = (a2 + c2) / b2, bc = (b2 - c2) / b2, ba = (b2 - a2) / b2, cb = c2 / b2,
                 ab = a2 / b2;
    const std::array<double, 5> quartic{
        (1 + ac) * (1 + ac) - 4 * ab * gamma * gamma,
        4 * (-ac * (1 + ac) * beta + 2 * ab * gamma * gamma * beta - (1 - pc) * alpha * gamma),
        2 * (ac * ac - 1 + 2 * ac * ac * beta * beta + 2 * bc * alpha * alpha - 4 * pc * alpha * beta * gamma +
             2 * ba * gamma * gamma),
        4 * (ac * (1 - ac) * beta - (1 - pc) * alpha * gamma + 2 * cb * alpha * alpha * beta),
        (ac - 1) * (ac - 1) - 4 * cb * alpha * alpha};
    std::vector<std::array<double, 3>> found;
    for (const double v : realRootsOfQuartic(quartic)) {
        const double below = 2 * (gamma - v * alpha);
        if (!(v > 0) || std::abs(below) < 1e-12) continue;
        const double u = ((ac - 1) * v * v - 2 * ac * beta * v + 1 + ac) / below;
        const double square = b2 / (1 + v * v - 2 * v * beta);
        if (!(u > 0 && square > 0)) continue;
        const double first = std::sqrt(square);
        found.push_back({first, u * first, v * first});
    }
    return found;
}

Rigid3 motionOfTriangle(const std::array<Vector3, 3>& from, const std::array<Vector3, 3>& to) {
    const Matrix3 rotation = frameOf(to) * frameOf(from).transpose();
    const Vector3 middle_from = (from[0] + from[1] + from[2]) / 3, middle_to = (to[0] + to[1] + to[2]) / 3;
    const Eigen::Quaterniond turn(rotation);
    return {turn, middle_to - turn * middle_from};
}

std::vector<Rigid3> posesFromThreePoints(const std::array<Vector3, 3>& points,
                                         const std::array<Vector3, 3>& directions) {
    if (!((points[1] - points[0]).cross(points[2] - points[0]).norm() > 1e-9)) return {};
    std::vector<Rigid3> poses;
    for (const auto& distances : distancesToThreePoints(points, directions)) {
        const std::array<Vector3, 3> seen{distances[0] * directions[0], distances[1] * directions[1],
                                          distances[2] * directions[2]};
        if ((seen[1] - seen[0]).cross(seen[2] - seen[0]).norm() > 1e-9) poses.push_back(motionOfTriangle(points, seen));
    }
    return poses;
}

}  // namespace fluorocut::detection
