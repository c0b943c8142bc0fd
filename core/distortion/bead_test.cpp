#include "core/distortion/bead_test.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>

#include <fmt/format.h>

#include "core/base/option_checks.h"

namespace fluorocut {
namespace {

constexpr double kTolerance = 0.2;  // of the spacing: how far a neighbour may be off
constexpr int kLeastBeads = 6;

using Place = std::array<int, 2>;
using Lattice = std::map<Place, std::size_t>;  // from place to point

// The direction, within 45 degrees of +x, that most pairs one spacing apart lie along or across.
std::optional<double> latticeDirection(const std::vector<Vector2>& points, double spacing_mm) {
    std::vector<double> angles;  // modulo 90 degrees
    for (std::size_t i = 0; i < points.size(); ++i) {
        for (std::size_t j = 0; j < i; ++j) {
            const Vector2 apart = points[i] - points[j];
            if (std::abs(apart.norm() - spacing_mm) <= kTolerance * spacing_mm)
                angles.push_back(std::atan2(apart.y(), apart.x()));
        }
    }
    // The angle with most others near it, modulo 90 degrees; then their mean.
    const auto nearTo = [](double a, double b) { return std::cos(4 * (a - b)) > std::cos(4 * 0.1); };
    double best = 0;
    std::ptrdiff_t most = 0;
    for (const double angle : angles) {
        const auto count =
            std::count_if(angles.begin(), angles.end(), [&](double other) { return nearTo(angle, other); });
        if (count > most) {
            most = count;
            best = angle;
        }
    }
    if (most < 4) return std::nullopt;
    double sine = 0, cosine = 0;
    for (const double angle : angles) {
        if (!nearTo(angle, best)) continue;
        sine += std::sin(4 * angle);
        cosine += std::cos(4 * angle);
    }
    return 0.25 * std::atan2(sine, cosine);
}

// Walks from `start` from neighbour to neighbour. A place is taken by the point nearest to where it should be.
Lattice latticeFrom(std::size_t start, const std::vector<Vector2>& points, const Vector2& step_x) {
    const Vector2 step_y(-step_x.y(), step_x.x());
    Lattice lattice{{{0, 0}, start}};
    std::vector<char> taken(points.size(), 0);
    taken[start] = 1;
    std::vector<Place> open{{0, 0}};
    while (!open.empty()) {
        const Place at = open.back();
        open.pop_back();
        for (const Place& move : {Place{1, 0}, Place{-1, 0}, Place{0, 1}, Place{0, -1}}) {
            const Place next{at[0] + move[0], at[1] + move[1]};
            if (lattice.contains(next)) continue;
            const Vector2 expected = points[lattice.at(at)] + move[0] * step_x + move[1] * step_y;
            double nearest = kTolerance * step_x.norm();
            std::optional<std::size_t> found;
            for (std::size_t i = 0; i < points.size(); ++i) {
                const double distance = (points[i] - expected).norm();
                if (!taken[i] && distance < nearest) {
                    nearest = distance;
                    found = i;
                }
            }
            if (!found) continue;
            lattice[next] = *found;
            taken[*found] = 1;
            open.push_back(next);
        }
    }
    return lattice;
}

bool spansBothDirections(const Lattice& lattice) {
    const Place first = lattice.begin()->first;
    const auto differs = [&](int axis) {
        return std::any_of(lattice.begin(), lattice.end(),
                           [&](const auto& entry) { return entry.first[axis] != first[axis]; });
    };
    return differs(0) && differs(1);
}

DistanceErrors errorsOf(const std::vector<double>& errors) {
    DistanceErrors result;
    result.pairs = static_cast<int>(errors.size());
    if (errors.empty()) return result;
    double sum = 0, squares = 0, largest = 0;
    for (const double error : errors) {
        sum += std::abs(error);
        squares += error * error;
        largest = std::max(largest, std::abs(error));
    }
    const double count = static_cast<double>(errors.size());
    result.mean_mm = sum / count;
    result.rms_mm = std::sqrt(squares / count);
    result.largest_mm = largest;
    return result;
}

// Of the similarity that takes the true lattice to the points best (Umeyama 1991, in the plane).
double scaleOf(const std::vector<std::pair<Vector2, Vector2>>& true_and_seen) {
    Vector2 true_mean = Vector2::Zero(), seen_mean = Vector2::Zero();
    for (const auto& [at, seen] : true_and_seen) {
        true_mean += at / static_cast<double>(true_and_seen.size());
        seen_mean += seen / static_cast<double>(true_and_seen.size());
    }
    double dot = 0, cross = 0, spread = 0;
    for (const auto& [at, seen] : true_and_seen) {
        const Vector2 a = at - true_mean, b = seen - seen_mean;
        dot += a.dot(b);
        cross += a.x() * b.y() - a.y() * b.x();
        spread += a.squaredNorm();
    }
    return std::hypot(dot, cross) / spread;
}

}  // namespace

Result<void> BeadTestOptions::validate() const {
    return requireRanges({{"spacing_mm", spacing_mm, 1, 200, "mm"},
                          {"centre_half_mm", centre_half_mm, 1, 1000, "mm"},
                          {"source_mm", source_mm, 10, 10000, "mm"},
                          {"bead_height_mm", bead_height_mm, -100, 0.5 * source_mm, "mm"}});
}

Result<BeadTest> beadTest(const std::vector<Vector2>& points_mm, const BeadTestOptions& options) {
    if (const auto good = options.validate(); !good) return good.error();
    const double shrink = (options.source_mm - options.bead_height_mm) / options.source_mm;
    std::vector<Vector2> points;
    for (const Vector2& point : points_mm)
        if (point.allFinite()) points.push_back(shrink * point);
    const auto refused = [&](std::size_t beads) {
        return noSolution("bead test", fmt::format("{} of {} beads in a square lattice", beads, points_mm.size()),
                          fmt::format("at least {} beads, {:g} mm apart, in two rows and two columns", kLeastBeads,
                                      options.spacing_mm),
                          "check the spacing, and that the map is of this C-arm position");
    };
    const std::optional<double> direction = latticeDirection(points, options.spacing_mm);
    if (!direction) return refused(0);
    const Vector2 step = options.spacing_mm * Vector2(std::cos(*direction), std::sin(*direction));
    Lattice lattice;
    std::vector<char> seen(points.size(), 0);
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (seen[i]) continue;
        Lattice candidate = latticeFrom(i, points, step);
        for (const auto& [place, point] : candidate)
            seen[point] = 1;
        if (candidate.size() > lattice.size()) lattice = std::move(candidate);
    }
    if (lattice.size() < kLeastBeads || !spansBothDirections(lattice)) return refused(lattice.size());

    BeadTest test;
    test.beads = static_cast<int>(lattice.size());
    test.stray = static_cast<int>(points_mm.size() - lattice.size());
    test.rotation_rad = *direction;
    std::vector<double> neighbours, pairs;
    std::vector<std::pair<Vector2, Vector2>> true_and_seen;
    // What counts as the centre is where things are seen, before the beads' height is taken out.
    const auto central = [&](const Vector2& point) {
        return point.cwiseAbs().maxCoeff() <= shrink * options.centre_half_mm;
    };
    for (auto a = lattice.begin(); a != lattice.end(); ++a) {
        true_and_seen.emplace_back(options.spacing_mm * Vector2(a->first[0], a->first[1]), points[a->second]);
        for (auto b = lattice.begin(); b != a; ++b) {
            const Vector2 steps(a->first[0] - b->first[0], a->first[1] - b->first[1]);
            const double error = (points[a->second] - points[b->second]).norm() - options.spacing_mm * steps.norm();
            pairs.push_back(error);
            if (steps.squaredNorm() != 1) continue;
            neighbours.push_back(error);
            const bool both_central = central(points[a->second]) && central(points[b->second]);
            (both_central ? test.centre_errors_mm : test.margin_errors_mm).push_back(error);
        }
    }
    test.scale = scaleOf(true_and_seen);
    test.centre = errorsOf(test.centre_errors_mm);
    test.margin = errorsOf(test.margin_errors_mm);
    test.all_neighbours = errorsOf(neighbours);
    test.all_pairs = errorsOf(pairs);
    return test;
}

Acceptance judge(const BeadTest& test, const BeadTestLimits& limits) {
    Acceptance acceptance{atMost("mean error in the centre", test.centre.mean_mm, limits.max_centre_mm, "mm")};
    if (test.margin.pairs > 0)
        acceptance.push_back(atMost("mean error in the margin", test.margin.mean_mm, limits.max_margin_mm, "mm"));
    return acceptance;
}

}  // namespace fluorocut
