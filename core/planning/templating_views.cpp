#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "core/base/units.h"
#include "core/planning/templating.h"
#include "core/planning/templating_search.h"

namespace fluorocut {
namespace {

constexpr double kLeastCrossingRad = 0.35;  // 20 degrees between two views' planes
constexpr int kMiddlePlaces = 25;

// A wall as a line in the detector plane (mm, without distortion), its ends continued straight, turned so that the
// canal lies on its left.
class WallLine {
  public:
    WallLine(const CArm& carm, const DrawnWall& wall, const Vector2& inside) {
        for (const Vector2& pixel : wall.pixels) {
            const Vector2 p = carm.detectorPoint(pixel).head<2>();
            if (places_.empty() || (p - places_.back()).norm() > 1e-6) places_.push_back(p);
        }
        const Vector2 d = (places_.back() - places_.front()).normalized();
        const double side = d.x() * (inside - places_.front()).y() - d.y() * (inside - places_.front()).x();
        if (side < 0) std::reverse(places_.begin(), places_.end());
        reversed_ = side < 0;
        const std::size_t n = places_.size();
        const Vector2 first = (places_[0] - places_[1]).normalized(),
                      last = (places_[n - 1] - places_[n - 2]).normalized();
        places_.insert(places_.begin(), places_.front() + 500 * first);
        places_.push_back(places_.back() + 500 * last);
    }

    struct Nearest {
        double beyond;  // signed distance, positive away from the canal
        Vector2 slope;  // its gradient
    };
    Nearest nearest(const Vector2& p) const {
        double least = std::numeric_limits<double>::infinity();
        Vector2 away = Vector2::Zero(), normal = Vector2::UnitX();
        for (std::size_t i = 0; i + 1 < places_.size(); ++i) {
            const Vector2 step = places_[i + 1] - places_[i];
            const double t = std::clamp((p - places_[i]).dot(step) / step.squaredNorm(), 0.0, 1.0);
            const Vector2 from = p - places_[i] - t * step;
            const double squared = from.squaredNorm();
            if (squared >= least) continue;
            least = squared;
            away = from;
            normal = outward(i);
            // At a corner both of its segments have a say about the side.
            if (t == 1 && i + 2 < places_.size()) normal += outward(i + 1);
            if (t == 0 && i > 0) normal += outward(i - 1);
        }
        const double distance = std::sqrt(least);
        const double sign = away.dot(normal) >= 0 ? 1 : -1;
        return {sign * distance, distance > 1e-9 ? Vector2(sign * away / distance) : Vector2(normal.normalized())};
    }
    Vector2 drawn(double part) const {  // 0: proximal end, 1: distal end
        const std::size_t last = places_.size() - 2;
        const double place = 1 + (reversed_ ? 1 - part : part) * static_cast<double>(last - 1);
        const auto i = std::min(static_cast<std::size_t>(place), last - 1);
        return places_[i] + (place - static_cast<double>(i)) * (places_[i + 1] - places_[i]);
    }

  private:
    Vector2 outward(std::size_t i) const {
        const Vector2 step = (places_[i + 1] - places_[i]).normalized();
        return {step.y(), -step.x()};  // the canal lies on the left
    }
    std::vector<Vector2> places_;
    bool reversed_ = false;
};

struct Flank {
    WallLine canal;
    std::optional<WallLine> outer;
};

struct PreparedView {
    const CanalView* drawn;
    std::array<Flank, 2> flanks;  // medial and lateral, or anterior and posterior
    bool medio_lateral;
};

Vector2 middleOf(const CArm& carm, const DrawnWall& wall) {
    Vector2 sum = Vector2::Zero();
    for (const Vector2& pixel : wall.pixels)
        sum += carm.detectorPoint(pixel).head<2>();
    return sum / static_cast<double>(wall.pixels.size());
}

Result<PreparedView> prepare(const CanalView& view) {
    const CArm& carm = view.view.carm;
    for (const DrawnWall& wall : view.walls) {
        const std::string where = fmt::format("view {}, {} wall", view.name, name(wall.side));
        if (wall.pixels.size() < 2) return invalidInput(where, "fewer than two points", "a line along the wall");
        for (const Vector2& pixel : wall.pixels)
            if (!carm.detectorPoint(pixel).allFinite())
                return invalidInput(where, "a point outside the image's map of distortion", "points inside it");
        if (!((carm.detectorPoint(wall.pixels.front()) - carm.detectorPoint(wall.pixels.back())).norm() > 1))
            return invalidInput(where, "a line that ends where it begins", "a line from proximal to distal");
    }
    const auto find = [&](WallSide side, bool outer) -> const DrawnWall* {
        const auto it = std::find_if(view.walls.begin(), view.walls.end(),
                                     [&](const DrawnWall& w) { return w.side == side && w.outer == outer; });
        return it == view.walls.end() ? nullptr : &*it;
    };
    for (const auto& [a, b] :
         {std::pair(WallSide::medial, WallSide::lateral), std::pair(WallSide::anterior, WallSide::posterior)}) {
        const DrawnWall *one = find(a, false), *other = find(b, false);
        if (!one || !other) continue;
        const Vector2 middle = 0.5 * (middleOf(carm, *one) + middleOf(carm, *other));
        const auto flank = [&](WallSide side, const DrawnWall& canal) {
            const DrawnWall* outer = find(side, true);
            return Flank{WallLine(carm, canal, middle),
                         outer ? std::optional<WallLine>(WallLine(carm, *outer, middle)) : std::nullopt};
        };
        return PreparedView{&view, {flank(a, *one), flank(b, *other)}, a == WallSide::medial};
    }
    return invalidInput("view " + view.name, "walls that make no pair",
                        "both walls of the canal: medial and lateral, or anterior and posterior");
}

Result<std::vector<PreparedView>> prepareAll(const std::vector<CanalView>& views) {
    std::vector<PreparedView> prepared;
    for (const CanalView& view : views) {
        Result<PreparedView> one = prepare(view);
        if (!one) return one.error();
        prepared.push_back(std::move(*one));
    }
    if (std::none_of(prepared.begin(), prepared.end(), [](const PreparedView& v) { return v.medio_lateral; }) ||
        std::all_of(prepared.begin(), prepared.end(), [](const PreparedView& v) { return v.medio_lateral; }))
        return invalidInput("views", fmt::format("{} of one kind", views.size()),
                            "one with medial and lateral walls and one with anterior and posterior walls");
    return prepared;
}

class SilhouetteFilling final : public Filling {
  public:
    SilhouetteFilling(const std::vector<PreparedView>& views, const TemplateOptions& options)
        : views_(views), options_(options) {}

    struct Worst {
        double excess = -std::numeric_limits<double>::infinity();
        double cut = 0, left = 0;  // into the cortex; what is left of it (NaN: not drawn), mm
        Vector3 gradient = Vector3::Zero();
    };
    Worst worst(const Vector3& p) const {
        Worst most;
        for (const PreparedView& view : views_) {
            const CArm& carm = view.drawn->view.carm;
            const Rigid3& pose = view.drawn->view.imager_from_world;
            const Vector3 q = pose * p;
            const double scale = q.z() / carm.focal_length_mm;  // from the detector plane to the point's depth
            const Vector2 at = q.head<2>() / scale;
            for (const Flank& flank : view.flanks) {
                const WallLine::Nearest canal = flank.canal.nearest(at);
                const double c = scale * canal.beyond;
                double excess = c - options_.most_reaming_mm;
                double left = std::numeric_limits<double>::quiet_NaN();
                Vector2 slope = canal.slope;
                if (flank.outer) {
                    const WallLine::Nearest outer = flank.outer->nearest(at);
                    left = -scale * outer.beyond;
                    const double wall = options_.least_wall_mm - left;
                    if (std::min(c, wall) > excess) {
                        excess = std::min(c, wall);
                        if (wall < c) slope = outer.slope;
                    }
                }
                if (excess <= most.excess) continue;
                // d(scale * beyond) for scale = z / f and at = f (x, y) / z, without the scale's own small change.
                const Vector3 in_imager(slope.x(), slope.y(), -slope.dot(at) / carm.focal_length_mm);
                most = {excess, c, left, pose.rotation().conjugate() * in_imager};
            }
        }
        return most;
    }
    double excess(const Vector3& p, Vector3& gradient) const override {
        const Worst most = worst(p);
        gradient = most.gradient;
        return most.excess;
    }

  private:
    const std::vector<PreparedView>& views_;
    const TemplateOptions& options_;
};

// Unit normal, in femur, of the plane through the source that holds the canal's middle line best.
Vector3 middlePlane(const PreparedView& view) {
    const CArm& carm = view.drawn->view.carm;
    Matrix3 sum = Matrix3::Zero();
    for (int i = 0; i < kMiddlePlaces; ++i) {
        const double part = (i + 0.5) / kMiddlePlaces;
        // The place of the one wall and its nearest on the other.
        const Vector2 a = view.flanks[0].canal.drawn(part);
        const WallLine::Nearest other = view.flanks[1].canal.nearest(a);
        const Vector2 middle = a - 0.5 * other.beyond * other.slope;
        const Vector3 ray = Vector3(middle.x(), middle.y(), carm.focal_length_mm).normalized();
        sum += ray * ray.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Matrix3> eigen(sum);
    return view.drawn->view.imager_from_world.rotation().conjugate() * Vector3(eigen.eigenvectors().col(0));
}

Vector3 sourceOf(const PreparedView& view) {
    return view.drawn->view.imager_from_world.inverse().translation();
}

// The point of a line nearest to the ray through a place in the detector plane.
Vector3 onAxis(const PreparedView& view, const Vector2& at, const Vector3& point, const Vector3& axis) {
    const Vector3 ray = view.drawn->view.imager_from_world.rotation().conjugate() *
                        Vector3(at.x(), at.y(), view.drawn->view.carm.focal_length_mm).normalized();
    const Vector3 between = sourceOf(view) - point;
    const double cosine = ray.dot(axis);
    return point + (between.dot(axis) - cosine * between.dot(ray)) / (1 - cosine * cosine) * axis;
}

double depthScale(const PreparedView& view, const Vector3& p) {
    return (view.drawn->view.imager_from_world * p).z() / view.drawn->view.carm.focal_length_mm;
}

struct Axis {
    Vector3 point, direction;  // proximal
};

Result<Axis> canalAxis(const std::vector<PreparedView>& views) {
    Matrix3 normals = Matrix3::Zero();
    Matrix3 planes = Matrix3::Zero();
    Vector3 right = Vector3::Zero();
    double widest = 0;
    Vector3 first = Vector3::Zero();
    for (const PreparedView& view : views) {
        const Vector3 n = middlePlane(view);
        if (first.isZero()) first = n;
        widest = std::max(widest, first.cross(n).norm());
        normals += n * n.transpose();
        planes += n * n.transpose();
        right += n * n.dot(sourceOf(view));
    }
    if (widest < std::sin(kLeastCrossingRad))
        return invalidInput(
            "views",
            fmt::format("planes through the canal only {:.0f} degrees apart", degreesFromRadians(std::asin(widest))),
            "views at least 20 degrees apart about the shaft");
    const Eigen::SelfAdjointEigenSolver<Matrix3> eigen(normals);
    Axis axis{Vector3::Zero(), eigen.eigenvectors().col(0)};
    // Nearest to all planes; along the axis anywhere: nearest to the first source.
    planes += axis.direction * axis.direction.transpose();
    right += axis.direction * axis.direction.dot(sourceOf(views.front()));
    axis.point = planes.ldlt().solve(right);
    const WallLine& wall = views.front().flanks[0].canal;
    const Vector3 top = onAxis(views.front(), wall.drawn(0), axis.point, axis.direction);
    const Vector3 end = onAxis(views.front(), wall.drawn(1), axis.point, axis.direction);
    if ((top - end).dot(axis.direction) < 0) axis.direction = -axis.direction;
    axis.point = top;
    return axis;
}

}  // namespace

std::string_view name(WallSide side) {
    switch (side) {
        case WallSide::medial:
            return "medial";
        case WallSide::lateral:
            return "lateral";
        case WallSide::anterior:
            return "anterior";
        case WallSide::posterior:
            return "posterior";
    }
    throw std::logic_error("name: unknown side of a wall");
}

Result<StemSeat> seatFromViews(const std::vector<CanalView>& views) {
    const auto prepared = prepareAll(views);
    if (!prepared) return prepared.error();
    const Result<Axis> axis = canalAxis(*prepared);
    if (!axis) return axis.error();
    StemSeat seat;
    seat.axis = axis->direction;
    // Down to where every wall has begun.
    double lowest = std::numeric_limits<double>::infinity();
    Vector3 medial = Vector3::Zero(), anterior = Vector3::Zero();
    for (const PreparedView& view : *prepared) {
        for (const Flank& flank : view.flanks)
            lowest = std::min(lowest, seat.axis.dot(onAxis(view, flank.canal.drawn(0), axis->point, seat.axis)));
        // Across the axis and the ray: what this view shows of a direction across the axis, toward its first wall.
        const Vector3 ray = axis->point - sourceOf(view);
        Vector3 across = ray.cross(seat.axis).normalized();
        const Vector2 toward = view.flanks[0].canal.drawn(0.5) - view.flanks[1].canal.drawn(0.5);
        if ((view.drawn->view.imager_from_world.rotate(across)).head<2>().dot(toward) < 0) across = -across;
        (view.medio_lateral ? medial : anterior) += across;
    }
    seat.point = axis->point + (lowest - seat.axis.dot(axis->point)) * seat.axis;
    // Seen from proximal, anterior lies a quarter turn counter-clockwise from medial on a left femur.
    seat.side = seat.axis.dot(medial.cross(anterior)) > 0 ? Side::left : Side::right;
    const Vector3 turned = seat.side == Side::left ? anterior.cross(seat.axis) : seat.axis.cross(anterior);
    seat.medial = (medial.normalized() + turned.normalized()).normalized();
    return seat;
}

Result<TemplateProposal> proposeStem(const std::vector<Implant>& sizes, const std::vector<CanalView>& views,
                                     const StemSeat& seat, const TemplateOptions& options, Progress& progress) {
    if (sizes.empty()) throw std::logic_error("proposeStem: no sizes");
    const auto prepared = prepareAll(views);
    if (!prepared) return prepared.error();
    const SilhouetteFilling filling(*prepared, options);
    const auto complaint = [&](const Vector3& p, double) {
        const SilhouetteFilling::Worst worst = filling.worst(p);
        if (worst.cut - options.most_reaming_mm >= worst.excess - 1e-9 || !std::isfinite(worst.left))
            return fmt::format("would cut {:.1f} mm into the cortex (allowed {:g} mm)", worst.cut,
                               options.most_reaming_mm);
        return fmt::format("would leave a wall of {:.1f} mm (limit {:g} mm)", worst.left, options.least_wall_mm);
    };
    // Known down to where the first wall ends.
    double lowest = -std::numeric_limits<double>::infinity();
    for (const PreparedView& view : *prepared)
        for (const Flank& flank : view.flanks)
            lowest = std::max(lowest, seat.axis.dot(onAxis(view, flank.canal.drawn(1), seat.point, seat.axis)));
    TemplateBone bone{filling, complaint, seat.point + (lowest - seat.axis.dot(seat.point)) * seat.axis, {}};
    for (const double turn : {0.0, radiansFromDegrees(12), radiansFromDegrees(-12)}) {
        StemSeat turned = seat;
        turned.medial = Eigen::AngleAxisd(turn, seat.axis) * seat.medial;
        bone.starts.push_back(turned.femurFromCavity(sizes.front().resection_z_mm));
    }
    Result<TemplateProposal> proposal = searchSizes(sizes, seat, bone, options, progress);
    if (!proposal) return proposal;

    // Fill: widths at a level as the views show them.
    const Implant& implant = implantOfSize(sizes, proposal->size);
    const Rigid3& pose = proposal->femur_from_cavity;
    const std::vector<Vector3> surface = stemSurface(implant, 6000);
    for (double below = 1; below < implant.stem_length_mm - 1; below += options.level_step_mm) {
        FillLevel level;
        level.below_mm = below;
        level.stem_mm = level.canal_mm = Vector2::Constant(std::numeric_limits<double>::quiet_NaN());
        const Vector3 middle = pose * Vector3(0, 0, implant.resection_z_mm - below);
        for (const PreparedView& view : *prepared) {
            const Vector3 ray = (middle - sourceOf(view)).normalized();
            const Vector3 across = ray.cross(pose.rotate(Vector3::UnitZ())).normalized();
            double low = std::numeric_limits<double>::infinity(), high = -low;
            for (const Vector3& p : surface)
                if (std::abs(implant.resection_z_mm - p.z() - below) < 1.5) {
                    const double place = across.dot(pose * p - middle);
                    low = std::min(low, place);
                    high = std::max(high, place);
                }
            const double scale = depthScale(view, middle);
            const Vector3 q = view.drawn->view.imager_from_world * middle;
            const Vector2 at = q.head<2>() / scale;
            const double canal =
                -scale * (view.flanks[0].canal.nearest(at).beyond + view.flanks[1].canal.nearest(at).beyond);
            level.stem_mm[view.medio_lateral ? 0 : 1] = high - low;
            level.canal_mm[view.medio_lateral ? 0 : 1] = canal;
        }
        level.area = level.medioLateral() * level.anteroPosterior();
        proposal->fill.push_back(level);
    }
    for (const bool only_cut : {false, true}) {
        LeastWall& least = only_cut ? proposal->least_cut : proposal->least_wall;
        for (const Vector3& p : surface) {
            const SilhouetteFilling::Worst worst = filling.worst(pose * p);
            if (!std::isfinite(worst.left) || (only_cut && worst.cut <= 0)) continue;
            const double thickness = worst.left + std::min(0.0, worst.cut);
            if (least.thickness_mm <= thickness) continue;
            least = {thickness, pose * p, implant.resection_z_mm - p.z(), sideOf(p, implant.side), worst.cut > 0};
        }
    }
    if (!std::isfinite(proposal->least_wall.thickness_mm))
        proposal->warnings.push_back("no outer wall is drawn: what the stem leaves of the cortex is not known");
    return proposal;
}

}  // namespace fluorocut
