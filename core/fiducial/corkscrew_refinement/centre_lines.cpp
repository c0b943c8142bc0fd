#include "core/fiducial/corkscrew_refinement/centre_lines.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

namespace fluorocut::corkscrew {
namespace {

constexpr double kStepMm = 1, kShaftStepMm = 1.5;
constexpr double kLeastForeshortening = 0.45;  // of a line's length, as seen
constexpr double kLeastContrast = 0.05;        // of a ridge, in the logarithm
constexpr double kProfileStepPx = 0.5;

struct InView {
    Vector2 pixel = Vector2::Constant(std::numeric_limits<double>::quiet_NaN()), ideal, tangent;
    double px_per_mm = 0;  // along the line
    bool inside = false;
};

// Offsets -reach ... reach.
std::vector<double> profile(const LogImage& seen, const Vector2& at, const Vector2& across, int half) {
    std::vector<double> values;
    values.reserve(static_cast<std::size_t>(2 * half + 1));
    for (int k = -half; k <= half; ++k) {
        const Vector2 place = at + k * kProfileStepPx * across;
        values.push_back(seen.at(place.x(), place.y()));
    }
    return values;
}

bool takeTrend(std::vector<double>& values) {
    const int half = static_cast<int>(values.size() / 2);
    double mean = 0, slope = 0, squares = 0;
    for (int k = -half; k <= half; ++k) {
        const double value = values[static_cast<std::size_t>(k + half)];
        mean += value;
        slope += k * value;
        squares += k * k;
    }
    mean /= static_cast<double>(values.size());
    slope /= squares;
    for (int k = -half; k <= half; ++k)
        values[static_cast<std::size_t>(k + half)] -= mean + slope * k;
    return std::isfinite(mean);
}

// The lowest place of a profile, px from its middle; NaN: none that counts.
double ridgeOffset(std::vector<double> values, double reach_px) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    if (!takeTrend(values)) return kNone;
    const int half = static_cast<int>(values.size() / 2);
    double mean_size = 0;
    for (const double value : values)
        mean_size += std::abs(value) / static_cast<double>(values.size());
    int best = 0;
    double lowest = std::numeric_limits<double>::infinity();
    for (int k = -half + 1; k < half; ++k) {
        const double aside = k * kProfileStepPx / reach_px;
        const double value = values[static_cast<std::size_t>(k + half)] + 0.25 * aside * aside * mean_size;
        if (value < lowest) {
            lowest = value;
            best = k;
        }
    }
    if (!(values[static_cast<std::size_t>(best + half)] < -kLeastContrast)) return kNone;
    // The vertex of a parabola through what lies within 2 px.
    const int window = std::min({static_cast<int>(2 / kProfileStepPx), half - best, half + best});
    if (window < 1) return kNone;
    double s0 = 0, s2 = 0, s4 = 0, t0 = 0, t1 = 0, t2 = 0;
    for (int k = -window; k <= window; ++k) {
        const double x = k * kProfileStepPx, value = values[static_cast<std::size_t>(best + k + half)];
        s0 += 1;
        s2 += x * x;
        s4 += x * x * x * x;
        t0 += value;
        t1 += x * value;
        t2 += x * x * value;
    }
    const double curvature = (s0 * t2 - s2 * t0) / (s0 * s4 - s2 * s2);
    if (!(curvature > 0)) return kNone;
    const double shift = std::clamp(-t1 / s2 / (2 * curvature), -1.0, 1.0);
    const double offset = best * kProfileStepPx + shift;
    return std::abs(offset) < reach_px - 0.6 ? offset : kNone;
}

// The middle between a falling and a rising edge that lie 2 half_width apart.
double barOffset(const std::vector<double>& values, double half_width_px, double reach_px) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    const int half = static_cast<int>(values.size() / 2), size = static_cast<int>(values.size());
    const auto slopeAt = [&](double place_px) {
        const double index = place_px / kProfileStepPx + half;
        const int low = static_cast<int>(std::floor(index));
        if (low < 1 || low + 2 >= size) return kNone;
        const double part = index - low;
        const auto slope = [&](int i) {
            return values[static_cast<std::size_t>(i + 1)] - values[static_cast<std::size_t>(i - 1)];
        };
        return (1 - part) * slope(low) + part * slope(low + 1);
    };
    const int steps = static_cast<int>(reach_px / kProfileStepPx);
    std::vector<double> strength;
    for (int k = -steps; k <= steps; ++k)
        strength.push_back(slopeAt(k * kProfileStepPx + half_width_px) - slopeAt(k * kProfileStepPx - half_width_px));
    int best = -1;
    double most = 0.1;
    for (int i = 1; i + 1 < static_cast<int>(strength.size()); ++i) {
        if (strength[static_cast<std::size_t>(i)] > most) {
            most = strength[static_cast<std::size_t>(i)];
            best = i;
        }
    }
    if (best < 0) return kNone;
    const double before = strength[static_cast<std::size_t>(best - 1)];
    const double after = strength[static_cast<std::size_t>(best + 1)];
    const double bend = before - 2 * most + after;
    const double shift = bend < 0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0;
    return (best - steps + shift) * kProfileStepPx;
}

}  // namespace

std::vector<LinePoint> wirePoints(const CorkscrewLayout& layout) {
    std::vector<LinePoint> points;
    int branch = 0;
    for (const CorkscrewRing& ring : layout.rings) {
        const double length = 2 * std::numbers::pi * ring.radius_mm;
        const int count = static_cast<int>(std::ceil(length / kStepMm));
        for (int k = 0; k < count; ++k) {
            const double angle = 2 * std::numbers::pi * k / count;
            points.push_back({ring.point(angle), ring.tangent(angle), branch, length * k / count, length});
        }
        ++branch;
    }
    const double length = layout.helix.length_mm();
    const int count = static_cast<int>(std::ceil(length / kStepMm));
    for (int k = 0; k < count; ++k) {
        const double t = (k + 0.5) / count;
        points.push_back({layout.helix.point(t), layout.helix.tangent(t), branch, length * t, 0});
    }
    return points;
}

std::vector<Vector3> shaftPoints(const CorkscrewLayout& layout) {
    std::vector<Vector3> points;
    const auto [low, high] = layout.shaft_x_mm;
    for (double x = low + 2; x < high - 2; x += kShaftStepMm)
        points.push_back({x, 0, 0});
    return points;
}

float LogImage::at(double x, double y) const {
    x -= region.x;
    y -= region.y;
    const int column = static_cast<int>(std::floor(x)), row = static_cast<int>(std::floor(y));
    if (!(column >= 0 && row >= 0 && column + 1 < region.width && row + 1 < region.height))
        return std::numeric_limits<float>::quiet_NaN();
    const float right = static_cast<float>(x - column), down = static_cast<float>(y - row);
    const float *top = values.row(row) + column, *bottom = values.row(row + 1) + column;
    const float above = top[0] + right * (top[1] - top[0]), below = bottom[0] + right * (bottom[1] - bottom[0]);
    return above + down * (below - above);
}

SeenLines findLines(const LogImage& seen, const CArm& carm, const CorkscrewLayout& layout,
                    const std::vector<LinePoint>& wires, const std::vector<Vector3>& shaft,
                    const Rigid3& imager_from_corkscrew, double reach_px) {
    const Matrix3 rotation = imager_from_corkscrew.rotationMatrix();
    const Vector3 origin = imager_from_corkscrew.translation();
    const auto view = [&](const Vector3& point, const Vector3& tangent) {
        InView out;
        const Vector3 p = rotation * point + origin, t = rotation * tangent;
        if (!(p.z() > 1)) return out;
        out.ideal = carm.projectIdeal(p);
        out.pixel = carm.distortion ? carm.distortedPixel(out.ideal) : out.ideal;
        const Vector2 rate =
            (carm.focal_length_mm / p.z() * (t.head<2>() - p.head<2>() / p.z() * t.z())).cwiseQuotient(carm.pixel_mm);
        out.px_per_mm = rate.norm();
        out.tangent = out.px_per_mm > 0 ? Vector2(rate / out.px_per_mm) : Vector2(Vector2::UnitX());
        out.inside = out.pixel.allFinite() && out.pixel.x() >= 1 && out.pixel.y() >= 1 &&
                     out.pixel.x() <= carm.columns - 2 && out.pixel.y() <= carm.rows - 2;
        return out;
    };
    const double magnification = carm.focal_length_mm / std::max(1.0, origin.z()) / carm.pixel_mm.mean();
    const double shaft_px = layout.shaft_radius_mm * magnification;

    SeenLines lines;
    std::vector<InView> views;
    views.reserve(wires.size());
    int inside = 0;
    for (const LinePoint& wire : wires) {
        views.push_back(view(wire.point, wire.tangent));
        inside += views.back().inside;
    }
    lines.visible = static_cast<double>(inside) / static_cast<double>(std::max<std::size_t>(1, wires.size()));

    const InView shaft_middle = view(Vector3::Zero(), Vector3::UnitX());
    const Vector2 shaft_across(-shaft_middle.tangent.y(), shaft_middle.tangent.x());
    const double apart_px = std::max(0.55 * reach_px, 3.5);
    const int half = static_cast<int>(std::lround(reach_px / kProfileStepPx));
    double squares = 0;
    // From left to right, to find what is near.
    std::vector<std::size_t> order(views.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::erase_if(order, [&](std::size_t i) { return !views[i].pixel.allFinite(); });
    std::sort(order.begin(), order.end(),
              [&](std::size_t a, std::size_t b) { return views[a].pixel.x() < views[b].pixel.x(); });
    for (std::size_t i = 0; i < wires.size(); ++i) {
        const InView& here = views[i];
        if (!here.inside || here.px_per_mm < kLeastForeshortening * magnification) continue;
        if (std::abs((here.pixel - shaft_middle.pixel).dot(shaft_across)) < shaft_px + std::max(0.4 * reach_px, 3.0))
            continue;
        bool crowded = false;
        const auto first = std::lower_bound(order.begin(), order.end(), here.pixel.x() - apart_px,
                                            [&](std::size_t j, double x) { return views[j].pixel.x() < x; });
        for (auto near = first; near != order.end() && !crowded; ++near) {
            const std::size_t j = *near;
            if (views[j].pixel.x() > here.pixel.x() + apart_px) break;
            if (!((views[j].pixel - here.pixel).squaredNorm() < apart_px * apart_px)) continue;
            double between_mm = std::numeric_limits<double>::infinity();
            if (wires[i].branch == wires[j].branch) {
                between_mm = std::abs(wires[i].along_mm - wires[j].along_mm);
                if (wires[i].length_mm > 0) between_mm = std::min(between_mm, wires[i].length_mm - between_mm);
            }
            crowded = between_mm * magnification > 3.2 * apart_px;
        }
        if (crowded) continue;
        ++lines.looked_at;
        const Vector2 across(-here.tangent.y(), here.tangent.x());
        const double offset = ridgeOffset(profile(seen, here.pixel, across, half), reach_px);
        if (!std::isfinite(offset)) continue;
        lines.wire.push_back({wires[i].point, here.ideal, across, offset});
        if (std::abs(offset) <= kOnPlacePx) {
            ++lines.on_place;
            squares += offset * offset;
        }
    }
    lines.rms_px = std::sqrt(squares / std::max(1, lines.on_place));

    for (const Vector3& point : shaft) {
        const InView here = view(point, Vector3::UnitX());
        if (!here.inside) continue;
        const Vector2 across(-here.tangent.y(), here.tangent.x());
        const int wide = half + static_cast<int>(std::ceil(shaft_px / kProfileStepPx)) + 3;
        const double offset = barOffset(profile(seen, here.pixel, across, wide), shaft_px, reach_px);
        if (std::isfinite(offset)) lines.shaft.push_back({point, here.ideal, across, offset});
    }
    return lines;
}

}  // namespace fluorocut::corkscrew
