#include "core/fiducial/detection/bead_profile.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace fluorocut::detection {
namespace {

constexpr double kReachSigmas = 5;  // exp(-12.5) is 4e-6

struct Node {
    double radius;
    double weight;          // f(r) r dr / s^2
    double steeper_weight;  // its derivative by ln k
};

// Four-point Gauss-Legendre on [-1, 1].
constexpr std::array<std::array<double, 2>, 4> kGauss{{{-0.8611363115940526, 0.3478548451374538},
                                                       {-0.3399810435848563, 0.6521451548625461},
                                                       {0.3399810435848563, 0.6521451548625461},
                                                       {0.8611363115940526, 0.3478548451374538}}};

std::vector<Node> nodesOf(const BeadShape& shape) {
    const double blur = std::exp(shape.log_blur), steepness = std::exp(shape.log_steepness);
    const double scale = 1 / (blur * blur);
    const double full = -std::expm1(-steepness), full_slope = steepness * std::exp(-steepness);
    const int panels = std::clamp(static_cast<int>(std::ceil(shape.radius_px / blur)), 4, 400);
    const double half = 0.25 * std::numbers::pi / panels;
    std::vector<Node> nodes;
    nodes.reserve(static_cast<std::size_t>(4 * panels));
    for (int i = 0; i < panels; ++i) {
        for (const auto& [place, weight] : kGauss) {
            const double t = half * (2 * i + 1 + place);
            const double path = steepness * std::cos(t);
            const double depth = -std::expm1(-path), slope = path * std::exp(-path);
            const double radius = shape.radius_px * std::sin(t);
            const double measure = half * weight * scale * radius * shape.radius_px * std::cos(t);
            nodes.push_back({radius, measure * depth / full, measure * (slope - depth * full_slope / full) / full});
        }
    }
    return nodes;
}

// The profile and its derivative by ln k. Nodes are in order of their radius.
void blur(const std::vector<Node>& nodes, double sigma, double distance, ProfilePoint& point) {
    const double inverse = 1 / (sigma * sigma), reach = kReachSigmas * sigma;
    auto node = std::lower_bound(nodes.begin(), nodes.end(), distance - reach,
                                 [](const Node& a, double radius) { return a.radius < radius; });
    for (; node != nodes.end() && node->radius <= distance + reach; ++node) {
        const double away = node->radius - distance;
        const double kernel =
            std::exp(-0.5 * away * away * inverse) * scaledBesselI0(node->radius * distance * inverse);
        point.value += node->weight * kernel;
        point.by_log_steepness += node->steeper_weight * kernel;
    }
}

}  // namespace

double scaledBesselI0(double x) {
    if (x < 3.75) {
        const double t = x * x / (3.75 * 3.75);
        return std::exp(-x) *
               (1 + t * (3.5156229 +
                         t * (3.0899424 + t * (1.2067492 + t * (0.2659732 + t * (0.0360768 + t * 0.0045813))))));
    }
    const double t = 3.75 / x;
    const double sum =
        0.39894228 +
        t * (0.01328592 +
             t * (0.00225319 +
                  t * (-0.00157565 +
                       t * (0.00916281 + t * (-0.02057706 + t * (0.02635537 + t * (-0.01647633 + t * 0.00392377)))))));
    return sum / std::sqrt(x);
}

BeadProfile::BeadProfile(const BeadShape& shape) {
    const double sigma = std::exp(shape.log_blur);
    step_ = 0.25 * sigma;
    const std::vector<Node> nodes = nodesOf(shape);
    const auto count = static_cast<std::size_t>((shape.radius_px + kReachSigmas * sigma) / step_) + 4;
    table_.resize(count);
    for (std::size_t i = 1; i + 3 < count; ++i)
        blur(nodes, sigma, static_cast<double>(i - 1) * step_, table_[i]);
    table_[0] = table_[2];  // even in the distance
    // The blur obeys the heat equation, s g_s = s^2 (g'' + g'/d), and the profile depends on ratios of lengths only:
    // d g_d + R g_R + s g_s = 0.
    for (std::size_t i = 1; i + 1 < count; ++i) {
        const double distance = static_cast<double>(i - 1) * step_;
        const double low = table_[i - 1].value, here = table_[i].value, high = table_[i + 1].value;
        const double bend = (low - 2 * here + high) / (step_ * step_), slope = (high - low) / (2 * step_);
        table_[i].by_log_blur = sigma * sigma * (i == 1 ? 2 * bend : bend + slope / distance);
        table_[i].by_radius = -(distance * slope + table_[i].by_log_blur) / shape.radius_px;
    }
    table_[0].by_log_blur = table_[2].by_log_blur;
    table_[0].by_radius = table_[2].by_radius;
}

ProfilePoint BeadProfile::at(double distance_px) const {
    const double place = distance_px / step_;
    const auto cell = static_cast<std::size_t>(place);
    if (!(place >= 0) || cell + 3 >= table_.size()) return {};
    const double t = place - static_cast<double>(cell);
    // Catmull-Rom.
    const double t2 = t * t, t3 = t2 * t;
    const std::array<double, 4> weights{0.5 * (-t3 + 2 * t2 - t), 0.5 * (3 * t3 - 5 * t2 + 2),
                                        0.5 * (-3 * t3 + 4 * t2 + t), 0.5 * (t3 - t2)};
    const std::array<double, 4> slopes{0.5 * (-3 * t2 + 4 * t - 1), 0.5 * (9 * t2 - 10 * t),
                                       0.5 * (-9 * t2 + 8 * t + 1), 0.5 * (3 * t2 - 2 * t)};
    ProfilePoint point;
    for (std::size_t i = 0; i < 4; ++i) {
        const ProfilePoint& node = table_[cell + i];
        point.value += weights[i] * node.value;
        point.by_distance += slopes[i] * node.value / step_;
        point.by_radius += weights[i] * node.by_radius;
        point.by_log_steepness += weights[i] * node.by_log_steepness;
        point.by_log_blur += weights[i] * node.by_log_blur;
    }
    return point;
}

}  // namespace fluorocut::detection
