#include "core/cutting/tool_path.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/cutting/layer_plan.h"
#include "core/geometry/mesh_distance.h"
#include "core/geometry/mesh_properties.h"

namespace fluorocut {
namespace {

// One connected part of a layer's pass, to be cut without leaving it.
struct Pocket {
    std::size_t layer = 0;
    Vector3 spindle = Vector3::UnitZ();
    PlaneRegion region;
    PlaneRegion inside;              // grown a little: what links may use
    PlaneRegion cleared;             // grown more: where the material is gone once this is cut
    std::vector<std::size_t> below;  // pockets of the next layer that lie under it
    std::size_t waiting_for = 0;     // pockets above that are not cut yet
    bool cut = false;
};

class Writer {
  public:
    Writer(const LayerPlan& plan, PlaneRegion opening, double top_mm, const ToolPathOptions& options)
        : plan_(plan),
          options_(options),
          // As far as its exact border, which places reached with a tilted spindle may touch.
          opening_(offset(opening, 0.5 * options.tolerance_mm, 0.1 * options.tolerance_mm)),
          top_mm_(top_mm),
          clearance_z_(options.clearancePlane(top_mm)) {
        makePockets();
    }

    Result<ToolPath> write(Progress& progress) {
        std::vector<std::size_t> ready;
        std::size_t count = 0;
        for (std::size_t i = pockets_.size(); i-- > 0;)
            if (pockets_[i].waiting_for == 0) ready.push_back(i);
        // Down into one part of the cavity as deep as it goes, then the next part.
        while (!ready.empty()) {
            if (progress.isCancelled()) return cancelled("tool path");
            progress.report(static_cast<double>(count++) / static_cast<double>(pockets_.size()), "joining loops");
            Pocket& pocket = pockets_[ready.back()];
            ready.pop_back();
            const Layer& layer = plan_.layers[pocket.layer];
            entered_ = false;
            millPart(pocket, pocket.region,
                     layer.floor ? std::min(options_.step_over_mm, plan_.finish_step_mm) : options_.step_over_mm);
            if (blocked_) {
                return noSolution("tool path",
                                  fmt::format("an opening at the top, {:.2f} mm, that is in pieces", top_mm_),
                                  "one opening for the whole cavity", "Plan the pieces one by one.");
            }
            pocket.cut = true;
            // On with the same direction where there is a choice.
            std::stable_partition(pocket.below.begin(), pocket.below.end(),
                                  [&](std::size_t next) { return pockets_[next].spindle != pocket.spindle; });
            for (const std::size_t next : pocket.below)
                if (--pockets_[next].waiting_for == 0) ready.push_back(next);
        }
        retract();
        return finished();
    }

  private:
    void makePockets() {
        const double grow = 0.25 * options_.step_over_mm;
        std::vector<std::size_t> above;
        for (std::size_t l = 0; l < plan_.layers.size(); ++l) {
            std::vector<std::size_t> here;
            for (const LayerPass& pass : plan_.layers[l].passes) {
                for (PlaneRegion& part : components(pass.region)) {
                    Pocket pocket;
                    pocket.layer = l;
                    pocket.spindle = pass.spindle;
                    pocket.inside = offset(part, 0.25 * options_.tolerance_mm, 0.1 * options_.tolerance_mm);
                    pocket.cleared = offset(part, grow, options_.tolerance_mm);
                    pocket.region = std::move(part);
                    wait(pocket, above);
                    here.push_back(pockets_.size());
                    pockets_.push_back(std::move(pocket));
                }
            }
            if (!here.empty()) above = std::move(here);
        }
    }

    // A pocket is cut after those above it, or after the only one that counts: of its own direction and all over it.
    void wait(Pocket& pocket, const std::vector<std::size_t>& above) {
        std::vector<std::size_t> over;
        for (const std::size_t a : above) {
            const double up = plan_.layers[pockets_[a].layer].z_mm - plan_.layers[pocket.layer].z_mm;
            PlaneRegion shifted = pocket.region;
            for (Polygon& polygon : shifted)
                for (Vector2& p : polygon)
                    p += up / pocket.spindle.z() * pocket.spindle.head<2>();
            if (intersection(pockets_[a].cleared, shifted).empty()) continue;
            if (pockets_[a].spindle == pocket.spindle && difference(shifted, pockets_[a].cleared).empty()) {
                over = {a};
                break;
            }
            over.push_back(a);
        }
        pocket.waiting_for = over.size();
        for (const std::size_t a : over)
            pockets_[a].below.push_back(pockets_.size());
    }

    // From the inside out: what lies a step-over farther in comes first.
    void millPart(Pocket& pocket, const PlaneRegion& part, double step_mm) {
        const auto shrunk = [&](double by_mm) { return offset(part, -by_mm, options_.tolerance_mm); };
        // A loop that would fall together to a line takes away nothing; on a floor it would leave too high a cusp.
        PlaneRegion inner = shrunk(1.1 * step_mm).empty() ? PlaneRegion{} : shrunk(step_mm);
        if (inner.empty() && plan_.layers[pocket.layer].floor) inner = shrunk(0.5 * step_mm);
        for (Polygon& polygon : inner)
            polygon = simplified(polygon, options_.tolerance_mm);
        std::vector<PlaneRegion> parts = components(inner);
        const bool innermost = parts.empty();
        while (!parts.empty()) {
            const auto nearest = std::min_element(parts.begin(), parts.end(), [&](const auto& a, const auto& b) {
                return nearestOnBorder(a, here()).distance_mm < nearestOnBorder(b, here()).distance_mm;
            });
            const PlaneRegion next = std::move(*nearest);
            parts.erase(nearest);
            millPart(pocket, next, step_mm);
        }
        const double bite = innermost ? 2 * options_.cutter.radius_mm : step_mm;
        for (std::size_t k = part.size(); k-- > 0;)  // holes first
            cutLoop(pocket, part[k], bite);
    }

    void cutLoop(Pocket& pocket, const Polygon& polygon, double bite_mm) {
        const double z = plan_.layers[pocket.layer].z_mm;
        const Polygon loop = loopFrom(polygon, nearestOnBorder({polygon}, here()));
        goTo(pocket, loop.front());
        for (std::size_t i = 1; i < loop.size(); ++i) {
            const Vector3 to(loop[i].x(), loop[i].y(), z);
            move(to, ToolMotion::cut, cuttingFeed(pocket, to, bite_mm));
        }
    }

    // To a place in a pocket: along its layer once the cutter is in it.
    void goTo(Pocket& pocket, const Vector2& place) {
        const double z = plan_.layers[pocket.layer].z_mm;
        const Vector3 target(place.x(), place.y(), z);
        if (entered_) {
            const std::vector<Vector2> way = wayInside(pocket.inside, here(), place);
            for (const Vector2& p : way) {
                const Vector3 to(p.x(), p.y(), z);
                move(to, ToolMotion::cut, cuttingFeed(pocket, to, 2 * options_.cutter.radius_mm));
            }
            if (!way.empty()) return;
        }
        enter(pocket, target);
        entered_ = true;
    }

    // Down to a place along the spindle: through what is gone at the largest feed, slowly through what is not.
    void enter(const Pocket& pocket, const Vector3& target) {
        const Vector3 up = pocket.spindle / pocket.spindle.z();
        // From a pocket right above: over in its layer, then down.
        if (last_ && last_->spindle == pocket.spindle && last_->layer < pocket.layer) {
            const double above = plan_.layers[last_->layer].z_mm;
            const Vector3 over = target + (above - target.z()) * up;
            if (std::abs(position_.z() - above) < 1e-9) {
                const std::vector<Vector2> way = wayInside(last_->inside, here(), over.head<2>());
                for (const Vector2& p : way)
                    move(Vector3(p.x(), p.y(), above), ToolMotion::entry, options_.most_feed_mm_s);
                if (!way.empty()) {
                    plunge(pocket, target);
                    return;
                }
            }
        }
        retract();
        const Vector3 over = target + (clearance_z_ - target.z()) * up;
        if (!started_) {
            position_ = over;
            started_ = true;
        } else if ((position_ - over).norm() > 1e-9) {
            const std::vector<Vector2> way = wayInside(opening_, here(), over.head<2>());
            blocked_ = blocked_ || way.empty();
            for (const Vector2& p : way)
                move(Vector3(p.x(), p.y(), clearance_z_), ToolMotion::rapid, options_.rapid_mm_s);
        }
        spindle_ = pocket.spindle;
        plunge(pocket, target);
    }

    void plunge(const Pocket& pocket, const Vector3& target) {
        last_ = &pocket;
        spindle_ = pocket.spindle;
        const Vector3 up = pocket.spindle / pocket.spindle.z();
        const double free = std::min(uncutAbove(pocket, target) + kMargin, position_.z() - target.z());
        move(target + free * up, ToolMotion::entry, options_.most_feed_mm_s);
        move(target, ToolMotion::entry, options_.plunge_feed_mm_s);
    }

    void retract() {
        if (!started_) return;
        const Vector3 up = spindle_ / spindle_.z();
        move(position_ + (clearance_z_ - position_.z()) * up, ToolMotion::retract, options_.most_feed_mm_s);
    }

    // How far above a place, along the spindle, its column of material still stands.
    double uncutAbove(const Pocket& pocket, const Vector3& place) const {
        const Vector3 up = pocket.spindle / pocket.spindle.z();
        for (std::size_t i = static_cast<std::size_t>(&pocket - pockets_.data()); i-- > 0;) {
            const Pocket& other = pockets_[i];
            if (!other.cut || other.layer == pocket.layer) continue;
            const double height = plan_.layers[other.layer].z_mm - place.z();
            const Vector3 there = place + height * up;
            if (contains(other.cleared, there.head<2>())) return height;
        }
        return top_mm_ + options_.cutter.radius_mm - place.z();
    }

    double cuttingFeed(const Pocket& pocket, const Vector3& to, double bite_mm) const {
        const double height = std::max(uncutAbove(pocket, to), 1e-3);
        return std::min(options_.most_feed_mm_s, options_.removal_rate_mm3_s / (height * bite_mm));
    }

    void move(const Vector3& to, ToolMotion motion, double feed_mm_s) {
        if ((to - position_).norm() < 1e-9) return;
        path_.moves.push_back({{position_, to, spindle_}, motion, feed_mm_s});
        position_ = to;
    }

    Vector2 here() const { return position_.head<2>(); }

    ToolPath finished() {
        path_.cutter = options_.cutter;
        path_.most_cusp_mm = options_.most_cusp_mm;
        path_.layers = static_cast<int>(plan_.layers.size());
        path_.cutting_mm = path_.time_s = 0;
        for (const ToolMove& m : path_.moves) {
            const double length = (m.segment.to_mm - m.segment.from_mm).norm();
            if (m.motion == ToolMotion::cut) path_.cutting_mm += length;
            path_.time_s += length / m.feed_mm_s;
        }
        path_.unreached = plan_.unreached;
        // Below a thousandth it is the chords' tolerance.
        if (plan_.unreached > 1e-3) {
            path_.warnings.push_back(fmt::format(
                "{:.1f} % of what the ball could cut stays, because the shank would leave the cavity on the way there",
                100 * plan_.unreached));
        }
        return std::move(path_);
    }

    static constexpr double kMargin = 0.2;  // mm above the material where slow going begins

    const LayerPlan& plan_;
    const ToolPathOptions& options_;
    PlaneRegion opening_;
    double top_mm_, clearance_z_;
    std::vector<Pocket> pockets_;
    ToolPath path_;
    Vector3 position_ = Vector3::Zero();
    Vector3 spindle_ = Vector3::UnitZ();
    const Pocket* last_ = nullptr;
    bool started_ = false, entered_ = false, blocked_ = false;
};

}  // namespace

Result<void> ToolPathOptions::validate() const {
    if (Result<void> ok = cutter.validate(); !ok) return ok;
    return requireRanges({{"step_down_mm", step_down_mm, 0.05, 20, "mm"},
                          // Loops farther apart would leave columns between them.
                          {"step_over_mm", step_over_mm, 0.05, 1.8 * cutter.radius_mm, "mm"},
                          {"most_cusp_mm", most_cusp_mm, 1e-3, 5, "mm"},
                          {"tolerance_mm", tolerance_mm, 1e-3, 1, "mm"},
                          {"clearance_mm", clearance_mm, 0, 200, "mm"},
                          {"most_tilt_rad", most_tilt_rad, 0, 0.6, "rad"},
                          {"most_feed_mm_s", most_feed_mm_s, 0.01, 1000, "mm/s"},
                          {"plunge_feed_mm_s", plunge_feed_mm_s, 0.01, 1000, "mm/s"},
                          {"rapid_mm_s", rapid_mm_s, 0.01, 1000, "mm/s"},
                          {"removal_rate_mm3_s", removal_rate_mm3_s, 0.01, 1e6, "mm3/s"}});
}

namespace {

Result<ToolPath> plan(const Volume& field, const MeshDistance* wall, double top_mm, const ToolPathOptions& options,
                      Progress& progress) {
    if (Result<void> ok = options.validate(); !ok) return ok.error();
    const Result<BallReach> reach =
        BallReach::of(field, wall, options.cutter.radius_mm, top_mm, options.openPlane(top_mm), options.tolerance_mm);
    if (!reach) return reach.error();
    SubProgress first(progress, 0, 0.7), second(progress, 0.7, 1);
    const Result<LayerPlan> layers = planLayers(*reach, top_mm, options, first);
    if (!layers) return layers.error();
    return Writer(*layers, reach->ballRegion(top_mm), top_mm, options).write(second);
}

}  // namespace

Result<ToolPath> planToolPath(const Volume& field, double top_mm, const ToolPathOptions& options, Progress& progress) {
    return plan(field, nullptr, top_mm, options, progress);
}

Result<ToolPath> planToolPath(const Volume& field, const TriangleMesh& planned, double top_mm,
                              const ToolPathOptions& options, Progress& progress) {
    if (Result<void> solid = requireSolid(planned, "planned cavity"); !solid) return solid.error();
    // The top is open: its face is no wall.
    TriangleMesh walls{planned.vertices, {}};
    for (const Triangle& t : planned.triangles) {
        const auto below = [&](std::int32_t v) {
            return planned.vertices[static_cast<std::size_t>(v)].z() < top_mm - 1e-6;
        };
        if (std::any_of(t.begin(), t.end(), below)) walls.triangles.push_back(t);
    }
    const Result<MeshDistance> wall = MeshDistance::build(std::move(walls), "planned cavity below its top");
    if (!wall) return wall.error();
    return plan(field, &*wall, top_mm, options, progress);
}

}  // namespace fluorocut
