#include "core/cavity/plane_contours.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "core/cavity/plane_images.h"

namespace fluorocut::cavity {
namespace {

constexpr int kMostFits = 100;
constexpr double kSettledPx = 1e-3;

struct Moments {
    Vector2 mean;
    Matrix2 inertia;
};

// Over the contour's length, so that closely spaced points do not count more.
Moments momentsOf(const Contour& contour) {
    Vector2 sum = Vector2::Zero();
    Matrix2 square = Matrix2::Zero();
    double whole = 0;
    for (std::size_t i = 0; i < contour.size(); ++i) {
        const Vector2& a = contour[i];
        const Vector2& b = contour[(i + 1) % contour.size()];
        const Vector2 middle = (a + b) / 2, half = (b - a) / 2;
        const double weight = (b - a).norm();
        sum += weight * middle;
        square += weight * (middle * middle.transpose() + half * half.transpose() / 3);
        whole += weight;
    }
    const Vector2 mean = sum / whole;
    return {mean, square / whole - mean * mean.transpose()};
}

}  // namespace

double signedArea(const Contour& contour) {
    double twice = 0;
    for (std::size_t i = 0; i < contour.size(); ++i) {
        const Vector2& a = contour[i];
        const Vector2& b = contour[(i + 1) % contour.size()];
        twice += a.x() * b.y() - b.x() * a.y();
    }
    return twice / 2;
}

double length(const Contour& contour) {
    double sum = 0;
    for (std::size_t i = 0; i < contour.size(); ++i)
        sum += (contour[(i + 1) % contour.size()] - contour[i]).norm();
    return sum;
}

Contour resampled(const Contour& contour, double step_px) {
    const double whole = length(contour);
    if (contour.size() < 2 || !(whole > 0)) return contour;
    const auto count = static_cast<std::size_t>(std::max(8.0, std::round(whole / step_px)));
    Contour result;
    result.reserve(count);
    double passed = 0;
    std::size_t i = 0;
    for (std::size_t n = 0; n < count; ++n) {
        const double at = whole * static_cast<double>(n) / static_cast<double>(count);
        double part = (contour[(i + 1) % contour.size()] - contour[i]).norm();
        while (passed + part < at && i + 1 < contour.size()) {
            passed += part;
            ++i;
            part = (contour[(i + 1) % contour.size()] - contour[i]).norm();
        }
        const double t = part > 0 ? std::min(1.0, (at - passed) / part) : 0;
        result.push_back(contour[i] + t * (contour[(i + 1) % contour.size()] - contour[i]));
    }
    return result;
}

std::vector<Contour> isoContours(const Image& image, float level) {
    const int width = image.width(), height = image.height();
    // With one pixel around it that lies below.
    const auto value = [&](int x, int y) {
        return x < 0 || y < 0 || x >= width || y >= height ? -std::numeric_limits<float>::max() : image(x, y);
    };
    const auto above = [&](int x, int y) { return value(x, y) >= level; };
    // Squares (x, y) to (x + 1, y + 1), x and y from -1. Sides: 0 top, 1 right, 2 bottom, 3 left.
    const int columns = width + 1, rows = height + 1;
    const auto crossing = [&](int x, int y, int side) -> Vector2 {
        const std::array<std::array<int, 4>, 4> ends{{{0, 0, 1, 0}, {1, 0, 1, 1}, {0, 1, 1, 1}, {0, 0, 0, 1}}};
        const auto& [ax, ay, bx, by] = ends[static_cast<std::size_t>(side)];
        const double a = value(x + ax, y + ay), b = value(x + bx, y + by);
        // Beyond the border: at the border.
        const double t = a < -1e37 ? 1 : b < -1e37 ? 0 : std::clamp((level - a) / (b - a), 0.0, 1.0);
        return {x + ax + t * (bx - ax), y + ay + t * (by - ay)};
    };
    // Where a line that comes in by a side goes out: with what is above on its left hand, as rows run down.
    const auto exits = [&](int x, int y) {
        std::array<int, 4> out{-1, -1, -1, -1};
        const int key = above(x, y) | above(x + 1, y) << 1 | above(x + 1, y + 1) << 2 | above(x, y + 1) << 3;
        const auto line = [&](int in, int to) { out[static_cast<std::size_t>(in)] = to; };
        switch (key) {
            case 1:
                line(3, 0);
                break;
            case 2:
                line(0, 1);
                break;
            case 3:
                line(3, 1);
                break;
            case 4:
                line(1, 2);
                break;
            case 6:
                line(0, 2);
                break;
            case 7:
                line(3, 2);
                break;
            case 8:
                line(2, 3);
                break;
            case 9:
                line(2, 0);
                break;
            case 11:
                line(2, 1);
                break;
            case 12:
                line(1, 3);
                break;
            case 13:
                line(1, 0);
                break;
            case 14:
                line(0, 3);
                break;
            case 5:
            case 10: {
                const double mean = (double{value(x, y)} + value(x + 1, y) + value(x, y + 1) + value(x + 1, y + 1)) / 4;
                const bool joined = mean >= level;
                if (key == 5) {
                    line(joined ? 1 : 3, 0);
                    line(joined ? 3 : 1, 2);
                } else {
                    line(0, joined ? 3 : 1);
                    line(2, joined ? 1 : 3);
                }
                break;
            }
            default:
                break;
        }
        return out;
    };
    std::vector<std::array<bool, 4>> done(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
    const auto at = [&](int x, int y) {
        return static_cast<std::size_t>(y + 1) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(x + 1);
    };
    std::vector<Contour> contours;
    for (int y = -1; y < height; ++y) {
        for (int x = -1; x < width; ++x) {
            const std::array<int, 4> out = exits(x, y);
            for (int in = 0; in < 4; ++in) {
                const auto side = static_cast<std::size_t>(in);
                if (out[side] < 0 || done[at(x, y)][side]) continue;
                Contour contour;
                int cx = x, cy = y, from = in;
                while (!done[at(cx, cy)][static_cast<std::size_t>(from)]) {
                    done[at(cx, cy)][static_cast<std::size_t>(from)] = true;
                    const int to = exits(cx, cy)[static_cast<std::size_t>(from)];
                    contour.push_back(crossing(cx, cy, to));
                    cx += to == 1 ? 1 : to == 3 ? -1 : 0;
                    cy += to == 2 ? 1 : to == 0 ? -1 : 0;
                    from = (to + 2) % 4;
                }
                contours.push_back(std::move(contour));
            }
        }
    }
    return contours;
}

Contour snake(const Contour& start, const Image& edge, const SnakeOptions& options) {
    const auto n = static_cast<Eigen::Index>(start.size());
    if (n < 8) return start;
    // (I + step (stretch D2' D2 + bend D4)) x_new = x + step force: cyclic, and the same in every step.
    Eigen::MatrixXd inner = Eigen::MatrixXd::Identity(n, n);
    const double a = options.step * options.stretch, b = options.step * options.bend;
    for (Eigen::Index i = 0; i < n; ++i) {
        const auto add = [&](Eigen::Index to, double value) { inner(i, (i + to + n) % n) += value; };
        add(0, 2 * a + 6 * b);
        add(1, -a - 4 * b);
        add(-1, -a - 4 * b);
        add(2, b);
        add(-2, b);
    }
    const Eigen::MatrixXd solve = inner.inverse();
    const auto pull = [&](const Vector2& p) {
        const auto sample = [&](double x, double y) { return linearAt(edge, {x, y}); };
        return Vector2((sample(p.x() + 1, p.y()) - sample(p.x() - 1, p.y())) / 2,
                       (sample(p.x(), p.y() + 1) - sample(p.x(), p.y() - 1)) / 2);
    };
    Eigen::MatrixX2d place(n, 2);
    for (Eigen::Index i = 0; i < n; ++i)
        place.row(i) = start[static_cast<std::size_t>(i)].transpose();
    for (int iteration = 0; iteration < options.iterations; ++iteration) {
        Eigen::MatrixX2d force(n, 2);
        for (Eigen::Index i = 0; i < n; ++i)
            force.row(i) = pull(place.row(i).transpose()).transpose();
        const double most = force.rowwise().norm().maxCoeff();
        if (!(most > 0)) break;
        place = (solve * (place + options.step / most * force)).eval();
    }
    Contour result;
    for (Eigen::Index i = 0; i < n; ++i)
        result.emplace_back(place.row(i).transpose());
    return result;
}

PlaneRigid bestRigid(const Contour& from, const Contour& to) {
    Vector2 from_mean = Vector2::Zero(), to_mean = Vector2::Zero();
    const auto count = static_cast<double>(from.size());
    for (std::size_t i = 0; i < from.size(); ++i) {
        from_mean += from[i] / count;
        to_mean += to[i] / count;
    }
    double sine = 0, cosine = 0;
    for (std::size_t i = 0; i < from.size(); ++i) {
        const Vector2 a = from[i] - from_mean, b = to[i] - to_mean;
        cosine += a.dot(b);
        sine += a.x() * b.y() - a.y() * b.x();
    }
    PlaneRigid fit;
    fit.angle_rad = std::atan2(sine, cosine);
    fit.shift_px = to_mean - Eigen::Rotation2Dd(fit.angle_rad) * from_mean;
    return fit;
}

Vector2 nearestOn(const Contour& contour, const Vector2& point) {
    Vector2 best = contour.front();
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < contour.size(); ++i) {
        const Vector2& a = contour[i];
        const Vector2 along = contour[i + 1 < contour.size() ? i + 1 : 0] - a;
        const double square = along.squaredNorm();
        const double t = square > 0 ? std::clamp((point - a).dot(along) / square, 0.0, 1.0) : 0;
        const Vector2 place = a + t * along;
        if (const double distance = (point - place).squaredNorm(); distance < least) {
            least = distance;
            best = place;
        }
    }
    return best;
}

double distanceTo(const Contour& from, const Contour& to) {
    double sum = 0;
    for (const Vector2& point : from)
        sum += (point - nearestOn(to, point)).squaredNorm();
    return std::sqrt(sum / static_cast<double>(from.size()));
}

PlaneRigid momentFit(const Contour& from, const Contour& to) {
    const Moments a = momentsOf(from), b = momentsOf(to);
    const auto direction = [](const Moments& m) {
        return 0.5 * std::atan2(2 * m.inertia(0, 1), m.inertia(0, 0) - m.inertia(1, 1));
    };
    PlaneRigid fit;
    fit.angle_rad = std::remainder(direction(b) - direction(a), std::numbers::pi);
    fit.shift_px = b.mean - Eigen::Rotation2Dd(fit.angle_rad) * a.mean;
    return fit;
}

std::optional<ContourFit> rigidFit(const Contour& from, const Contour& to) {
    if (from.size() < 3 || to.size() < 3 || !(length(from) > 0) || !(length(to) > 0)) return std::nullopt;
    ContourFit fit;
    fit.to_from = momentFit(from, to);
    Contour nearest(from.size());
    while (fit.iterations < kMostFits) {
        ++fit.iterations;
        for (std::size_t i = 0; i < from.size(); ++i)
            nearest[i] = nearestOn(to, fit.to_from * from[i]);
        const PlaneRigid next = bestRigid(from, nearest);
        double moved = 0;
        for (const Vector2& point : from)
            moved = std::max(moved, (next * point - fit.to_from * point).norm());
        fit.to_from = next;
        if (moved < kSettledPx) break;
    }
    Contour laid;
    for (const Vector2& point : from)
        laid.push_back(fit.to_from * point);
    fit.rms_px = distanceTo(laid, to);
    return fit;
}

}  // namespace fluorocut::cavity
