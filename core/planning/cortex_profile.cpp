#include "core/planning/cortex_profile.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace fluorocut {
namespace {

constexpr double kThinMm = 4;      // thicker walls show their own density
constexpr double kMarginMm = 2.5;  // of the profile on both sides of a wall that its fit looks at
constexpr double kAwayMm = 2;      // a fit that moves a wall farther has failed

// A stretch of a profile above a threshold.
struct Run {
    double begin, end;
};

double integral(double x) {
    return 0.5 * std::erfc(-x * std::numbers::sqrt2 / 2);
}
double density(double x) {
    return std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi);
}

double crossing(const CortexProfile& profile, double from, double to, double level) {
    const double step = from < to ? 0.05 : -0.05;
    for (double r = from; (to - r) * step > 0; r += step) {
        const double a = profile.at(r), b = profile.at(r + step);
        if ((a < level) != (b < level)) return r + step * (level - a) / (b - a);
    }
    return std::numeric_limits<double>::quiet_NaN();
}

double meanOf(const CortexProfile& profile, double from, double to) {
    double sum = 0;
    int n = 0;
    for (double r = from; r <= to + 1e-9; r += profile.step_mm, ++n)
        sum += profile.at(r);
    return sum / std::max(n, 1);
}

// Stretches of cortex up to the exit.
std::vector<Run> runsAbove(const CortexProfile& profile, double threshold) {
    std::vector<Run> runs;
    bool above = false;
    for (double r = 0; r < profile.exit_mm + 1; r += profile.step_mm) {
        const bool now = profile.at(r) > threshold;
        if (now && !above) runs.push_back({r, r});
        if (now) runs.back().end = r;
        above = now;
    }
    return runs;
}

// Half way up from the marrow beside it, half way down to the surroundings.
CortexWalls halfMaximum(const CortexProfile& profile, const Run& run) {
    double peak = -1e9;
    for (double r = run.begin; r <= run.end; r += profile.step_mm)
        peak = std::max(peak, profile.at(r));
    const double middle = 0.5 * (run.begin + run.end);
    const double inside = meanOf(profile, std::max(0.0, run.begin - 3), std::max(0.0, run.begin - 1));
    const double outside = meanOf(profile, run.end + 1, run.end + 3);
    return {crossing(profile, middle, std::max(0.0, run.begin - 3), 0.5 * (peak + inside)),
            crossing(profile, middle, run.end + 3, 0.5 * (peak + outside))};
}

// Levenberg-Marquardt over x0, x1, y0, y2.
CortexWalls fit(const CortexProfile& profile, const CortexWalls& start, double y1, double blur) {
    const double first = std::max(0.0, start.inner_mm - kMarginMm), last = start.outer_mm + kMarginMm;
    Eigen::Vector4d p(start.inner_mm, start.outer_mm, meanOf(profile, first, std::max(first, start.inner_mm - 1.2)),
                      meanOf(profile, start.outer_mm + 1.2, last));
    const auto system = [&](const Eigen::Vector4d& q, Eigen::Matrix4d* normal, Eigen::Vector4d* gradient) {
        double cost = 0;
        for (double r = first; r <= last; r += profile.step_mm) {
            const double a = (r - q[0]) / blur, b = (r - q[1]) / blur;
            const double up = integral(a), down = integral(b);
            const double residual = q[2] + (y1 - q[2]) * up + (q[3] - y1) * down - profile.at(r);
            cost += residual * residual;
            if (!normal) continue;
            const Eigen::Vector4d j(-(y1 - q[2]) * density(a) / blur, -(q[3] - y1) * density(b) / blur, 1 - up, down);
            *normal += j * j.transpose();
            *gradient += residual * j;
        }
        return cost;
    };
    double lambda = 1e-3, cost = system(p, nullptr, nullptr);
    for (int step = 0; step < 25; ++step) {
        Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
        Eigen::Vector4d gradient = Eigen::Vector4d::Zero();
        system(p, &normal, &gradient);
        normal.diagonal() *= 1 + lambda;
        normal.diagonal().array() += 1e-9;
        Eigen::Vector4d next = p - normal.ldlt().solve(gradient);
        next[1] = std::max(next[1], next[0] + 0.1);
        const double there = system(next, nullptr, nullptr);
        if (there < cost) {
            const double moved = (next - p).head<2>().norm();
            p = next;
            cost = there;
            lambda *= 0.3;
            if (moved < 1e-3) break;
        } else if ((lambda *= 10) > 1e6) {
            break;
        }
    }
    return {p[0], p[1]};
}

}  // namespace

double CortexProfile::at(double r_mm) const {
    if (hounsfield.empty()) return std::numeric_limits<double>::quiet_NaN();
    const double place = std::clamp(r_mm / step_mm, 0.0, static_cast<double>(hounsfield.size() - 1));
    const auto i = std::min(static_cast<std::size_t>(place), hounsfield.size() - 1);
    const auto next = std::min(i + 1, hounsfield.size() - 1);
    return hounsfield[i] + (place - static_cast<double>(i)) * (hounsfield[next] - hounsfield[i]);
}

double CortexProfile::peak() const {
    double most = -1e9;
    for (double r = 0; r <= exit_mm; r += step_mm)
        most = std::max(most, at(r));
    return most;
}

std::optional<CortexProfile::Thick> CortexProfile::plateau(double threshold_hu, double thick_mm) const {
    const std::vector<Run> runs = runsAbove(*this, threshold_hu);
    if (runs.empty() || runs.back().end - runs.back().begin < thick_mm || runs.back().end < exit_mm - 2)
        return std::nullopt;
    const Run& run = runs.back();
    const double third = (run.end - run.begin) / 3;
    const double middle = meanOf(*this, run.begin + third, run.end - third);
    // A blurred edge is steepest with height / (sqrt(2 pi) blur).
    double steepest = 0;
    for (double r = run.end - 1.5; r < run.end + 1.5; r += 0.5 * step_mm)
        steepest = std::max(steepest, (at(r) - at(r + step_mm)) / step_mm);
    const double height = middle - meanOf(*this, run.end + 1.5, run.end + 3);
    if (!(steepest > 0 && height > 0)) return std::nullopt;
    return Thick{middle, height / (std::sqrt(2 * std::numbers::pi) * steepest)};
}

CortexWalls cortexWalls(const CortexProfile& profile, double cortical_hu, double blur_mm, bool model) {
    std::vector<Run> runs = runsAbove(profile, 0.5 * cortical_hu);
    if (runs.empty() || runs.back().end < profile.exit_mm - 2.5) {
        // A shell too thin to come half way up: what there is of it lies just before the exit.
        runs.push_back({std::max(0.2, profile.exit_mm - 1), profile.exit_mm});
    }
    const auto wallsOf = [&](const Run& run) {
        const CortexWalls start = halfMaximum(profile, run);
        if (!model || !std::isfinite(start.inner_mm) || !std::isfinite(start.outer_mm)) return start;
        const double thickness = run.end - run.begin;
        const double y1 =
            thickness > kThinMm ? meanOf(profile, run.begin + thickness / 3, run.end - thickness / 3) : cortical_hu;
        const CortexWalls fitted = fit(profile, start, y1, blur_mm);
        const bool near = std::abs(fitted.inner_mm - start.inner_mm) < kAwayMm &&
                          std::abs(fitted.outer_mm - start.outer_mm) < kAwayMm;
        return near ? fitted : CortexWalls{};
    };
    const CortexWalls first = wallsOf(runs.front());
    const CortexWalls last = runs.size() > 1 ? wallsOf(runs.back()) : first;
    return {first.inner_mm, last.outer_mm};
}

}  // namespace fluorocut
