#include "core/cutting/layer_plan.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "core/base/parallel.h"

namespace fluorocut {
namespace {

constexpr double kLeastStep = 0.05;     // mm: thinner layers are not worth while
constexpr double kSliver = 0.05;        // mm: half the width of what does not count as a region
constexpr std::size_t kMostPasses = 6;  // of one layer
constexpr double kBetter = 0.05;        // share of a layer for which the direction is changed
constexpr double kWorthwhile = 0.01;    // share of a layer for which another direction is tried

// +z first, then a square grid of tilts within the limit: an eighth of the limit apart.
std::vector<Vector3> spindleDirections(double most_tilt_rad) {
    std::vector<Vector3> directions{Vector3::UnitZ()};
    constexpr int kSteps = 8;
    for (int j = -kSteps; j <= kSteps; ++j) {
        for (int i = -kSteps; i <= kSteps; ++i) {
            const double tilt = most_tilt_rad * std::hypot(i, j) / kSteps, around = std::atan2(j, i);
            if (!(tilt > 0 && tilt <= most_tilt_rad)) continue;
            directions.emplace_back(std::sin(tilt) * std::cos(around), std::sin(tilt) * std::sin(around),
                                    std::cos(tilt));
        }
    }
    return directions;
}

class Planner {
  public:
    Planner(const BallReach& reach, const ToolPathOptions& options)
        : reach_(reach), options_(options), directions_(spindleDirections(options.most_tilt_rad)) {
        const double r = options.cutter.radius_mm, rest = r - std::min(options.most_cusp_mm, r);
        finish_mm_ = 2 * std::sqrt(r * r - rest * rest);
    }

    double finishStep() const { return finish_mm_; }

    PlaneRegion grown(const PlaneRegion& region, double distance) const {
        return offset(region, distance, options_.tolerance_mm);
    }

    // What of a layer lies farther than a finishing step from the next one, `down` below it.
    PlaneRegion uncovered(const PlaneRegion& layer, const PlaneRegion& next, double down) const {
        if (next.empty()) return layer;
        const double across = std::sqrt(std::max(finish_mm_ * finish_mm_ - down * down, 0.0));
        return difference(layer, grown(next, across));
    }
    bool isSliver(const PlaneRegion& region) const { return region.empty() || grown(region, -kSliver).empty(); }

    // Way down from a layer to the next one.
    double stepDown(const PlaneRegion& layer, const PlaneRegion& floor, double z, double lowest) const {
        const double left = z - lowest;
        if (left <= kLeastStep) return left;
        const PlaneRegion kept = floor.empty() ? PlaneRegion{} : grown(floor, finish_mm_);
        for (double down = left / std::ceil(left / options_.step_down_mm - 1e-9); down > kLeastStep; down *= 0.75) {
            const PlaneRegion next = reach_.ballRegion(z - down);
            PlaneRegion missed = uncovered(layer, next, down);
            if (!kept.empty()) missed = difference(missed, kept);
            if (isSliver(missed)) return down;
        }
        return kLeastStep;
    }

    // The directions with which the ball gets to the places of a layer, the best first.
    std::vector<LayerPass> passes(const PlaneRegion& balls, double z) {
        std::vector<LayerPass> result;
        if (directions_.size() == 1) {
            PlaneRegion region = reach_.region(z, directions_[0]);
            if (!region.empty()) result.push_back({directions_[0], std::move(region)});
            return result;
        }
        int stride = 1;
        std::vector<Vector3> places = reach_.places(z, stride);
        while (places.size() > 300)
            places = reach_.places(z, ++stride);
        // [direction][place]
        std::vector<std::vector<char>> clear(directions_.size());
        const auto look = [&](std::size_t d) {
            if (!clear[d].empty()) return;
            clear[d].resize(places.size());
            for (std::size_t p = 0; p < places.size(); ++p)
                clear[d][p] = reach_.shankClear(places[p], directions_[d]) ? 1 : 0;
        };
        std::vector<char> done(places.size(), 0);
        const auto gain = [&](std::size_t d) {
            std::size_t count = 0;
            for (std::size_t p = 0; p < places.size(); ++p)
                count += clear[d][p] && !done[p] ? 1 : 0;
            return count;
        };
        const double worthwhile = kWorthwhile * static_cast<double>(places.size());
        PlaneRegion united_region;
        std::size_t left = places.size();
        std::vector<std::size_t> used;
        while (result.size() < kMostPasses && static_cast<double>(left) > (result.empty() ? 0 : worthwhile)) {
            // A direction of the layer before stays while it does nearly as much as any.
            std::size_t best = result.size() < last_.size() ? last_[result.size()] : 0;
            look(best);
            if (static_cast<double>(left - gain(best)) > worthwhile) {
                parallelFor(directions_.size(), 4, [&](std::size_t begin, std::size_t end) {
                    for (std::size_t d = begin; d < end; ++d)
                        look(d);
                });
                const double enough = static_cast<double>(gain(best)) + kBetter * static_cast<double>(places.size());
                std::size_t most = best;
                for (std::size_t d = 0; d < directions_.size(); ++d)
                    if (gain(d) > gain(most)) most = d;
                if (static_cast<double>(gain(most)) > enough) best = most;
            }
            const std::size_t gained = gain(best);
            if (gained == 0 || (!result.empty() && static_cast<double>(gained) < worthwhile)) break;
            PlaneRegion region = reach_.region(z, directions_[best]);
            if (!result.empty()) {
                // Only what is left, and so much round it that nothing stays between.
                region = intersection(region, grown(difference(balls, united_region), options_.cutter.radius_mm));
            }
            if (region.empty()) break;
            united_region = united(united_region, region);
            result.push_back({directions_[best], std::move(region)});
            for (std::size_t p = 0; p < places.size(); ++p)
                done[p] |= clear[best][p];
            left -= gained;
            used.push_back(best);
        }
        if (!used.empty()) last_ = used;
        if (places.empty()) {
            // Smaller than the grid's cells.
            PlaneRegion region = reach_.region(z, directions_[last_[0]]);
            if (!region.empty()) result.push_back({directions_[last_[0]], std::move(region)});
        }
        return result;
    }

  private:
    const BallReach& reach_;
    const ToolPathOptions& options_;
    std::vector<Vector3> directions_;
    double finish_mm_ = 0;
    std::vector<std::size_t> last_{0};  // directions of the layer before
};

}  // namespace

Result<LayerPlan> planLayers(const BallReach& reach, double top_mm, const ToolPathOptions& options,
                             Progress& progress) {
    const double lowest = reach.lowest();
    if (!(lowest <= top_mm)) {
        return noSolution(
            "tool path", fmt::format("no place in the cavity for a ball of radius {:.2f} mm", options.cutter.radius_mm),
            "a cavity wider than the cutter", "Take a smaller cutter.");
    }
    const double depth = (options.openPlane(top_mm) - lowest) / std::cos(options.most_tilt_rad);
    if (depth > options.cutter.length_mm) {
        return invalidOption("cutter.length_mm", fmt::format("{}", options.cutter.length_mm),
                             fmt::format("at least {:.1f} mm: from the deepest cut to the end of the way in", depth));
    }

    Planner planner(reach, options);
    LayerPlan plan;
    plan.finish_step_mm = planner.finishStep();
    double all = 0, reached = 0;
    // The first layer's ball reaches a step below the top.
    double z = std::max(top_mm + options.cutter.radius_mm - options.step_down_mm, lowest);
    double height = top_mm + options.cutter.radius_mm - z;
    PlaneRegion balls = reach.ballRegion(z);
    while (true) {
        if (progress.isCancelled()) return cancelled("tool path");
        const double first = top_mm + options.cutter.radius_mm;
        progress.report((first - z) / std::max(first - lowest, 1e-9), "planning layers");
        Layer layer{z, height, false, planner.passes(balls, z)};
        PlaneRegion floor =
            z - lowest > kLeastStep ? planner.uncovered(balls, reach.ballRegion(z - kLeastStep), kLeastStep) : balls;
        if (z > lowest && planner.isSliver(floor)) floor.clear();
        layer.floor = !floor.empty();
        const double down = planner.stepDown(balls, floor, z, lowest);

        const double slice = area(balls) * std::max(height, 1e-9);
        double got = 0;
        PlaneRegion sum;
        for (const LayerPass& pass : layer.passes)
            sum = sum.empty() ? pass.region : united(sum, pass.region);
        got = area(sum) * std::max(height, 1e-9);
        all += slice;
        reached += std::min(got, slice);
        if (!layer.passes.empty()) plan.layers.push_back(std::move(layer));
        if (z <= lowest) break;
        height = down;
        z = z - down < lowest + 1e-6 ? lowest : z - down;
        balls = reach.ballRegion(z);
    }
    if (plan.layers.empty()) {
        return noSolution("tool path", "no place that ball and shank reach from the top",
                          "a cavity that is open toward its top",
                          "Allow more tilt, or sweep the cavity along its axis.");
    }
    plan.unreached = all > 0 ? 1 - reached / all : 0;
    return plan;
}

}  // namespace fluorocut
