#include "core/fiducial/corkscrew/twins.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/base/units.h"

namespace fluorocut::corkscrew {
namespace {

constexpr double kStepMm = 1.5;    // between the points of a line
constexpr double kNearPx = 2.5;    // lines this near lie on each other, for 512 pixels across
constexpr int kTwists = 90;        // steps of 4 degrees; 2.5 px are 2 degrees at the rim of a wide corkscrew
constexpr double kSameRad = 0.07;  // 4 degrees
constexpr double kOtherTwistRad = 0.3;

// Rings and helix: what tells poses apart. The shaft lies on itself in all of them, except for its ends.
std::vector<Vector3> linesOf(const CorkscrewLayout& layout) {
    std::vector<Vector3> points;
    for (const CorkscrewRing& ring : layout.rings) {
        const int count = static_cast<int>(std::ceil(2 * std::numbers::pi * ring.radius_mm / kStepMm));
        for (int i = 0; i < count; ++i)
            points.push_back(ring.point(2 * std::numbers::pi * i / count));
    }
    const int count = static_cast<int>(std::ceil(layout.helix.length_mm() / kStepMm));
    for (int i = 0; i <= count; ++i)
        points.push_back(layout.helix.point(static_cast<double>(i) / count));
    // Beads weigh like as much wire as they are wide.
    for (const CorkscrewBead& bead : layout.beads)
        points.insert(points.end(), 2, bead.center_mm);
    for (const double end : layout.shaft_x_mm)
        points.insert(points.end(), 4, Vector3(end, 0, 0));
    return points;
}

// Pixels within `near` of any of the lines.
class Lines {
  public:
    Lines(const CArm& carm, const std::vector<Vector3>& points, const Rigid3& pose, double near_px)
        : carm_(carm), cell_px_(near_px / 2) {
        std::vector<Vector2> seen;
        for (const Vector3& point : points) {
            seen.push_back(carm.projectIdeal(pose * point));
            if (!seen.back().allFinite()) continue;
            low_ = low_.cwiseMin(seen.back());
            high_ = high_.cwiseMax(seen.back());
        }
        low_.array() -= 2 * near_px;
        high_.array() += 2 * near_px;
        const Vector2 size = (high_ - low_) / cell_px_;
        if (!(size.allFinite() && size.maxCoeff() < 20000)) return;
        columns_ = static_cast<int>(size.x()) + 1;
        rows_ = static_cast<int>(size.y()) + 1;
        near_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), 0);
        const int reach = static_cast<int>(std::round(near_px / cell_px_));
        for (const Vector2& pixel : seen) {
            if (!pixel.allFinite()) continue;
            const Vector2 cell = (pixel - low_) / cell_px_;
            const int cx = static_cast<int>(cell.x()), cy = static_cast<int>(cell.y());
            for (int y = -reach; y <= reach; ++y)
                for (int x = -reach; x <= reach; ++x)
                    if (x * x + y * y <= reach * reach) mark(cx + x, cy + y);
        }
    }

    // Of the points seen in `pose`, the share that lies on the lines.
    double overlap(const std::vector<Vector3>& points, const Rigid3& pose) const {
        std::size_t on = 0;
        for (const Vector3& point : points) {
            const Vector2 cell = (carm_.projectIdeal(pose * point) - low_) / cell_px_;
            if (!(cell.x() >= 0 && cell.y() >= 0 && cell.x() < columns_ && cell.y() < rows_)) continue;
            on += near_[index(static_cast<int>(cell.x()), static_cast<int>(cell.y()))];
        }
        return static_cast<double>(on) / static_cast<double>(points.size());
    }

  private:
    std::size_t index(int x, int y) const {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(x);
    }
    void mark(int x, int y) {
        if (x >= 0 && y >= 0 && x < columns_ && y < rows_) near_[index(x, y)] = 1;
    }

    const CArm& carm_;
    double cell_px_;
    Vector2 low_ = Vector2::Constant(1e9), high_ = Vector2::Constant(-1e9);
    int columns_ = 0, rows_ = 0;
    std::vector<unsigned char> near_;
};

Rigid3 turnedAbout(const Vector3& center, const Vector3& axis, double angle_rad) {
    return Rigid3::fromTranslation(center) * Rigid3::fromRotationVector(angle_rad * axis) *
           Rigid3::fromTranslation(-center);
}

}  // namespace

std::string Twin::inWords() const {
    if (other_axis && other_roll) return "with its axis the other way round and rolled to the other side";
    if (other_axis) return "with its axis the other way round";
    if (other_roll) return "rolled to the other side";
    return "twisted by another angle";
}

std::vector<Twin> twins(const CArm& carm, const CorkscrewLayout& layout, const Rigid3& pose, double least_overlap) {
    const std::vector<Vector3> points = linesOf(layout);
    const double near_px = kNearPx * std::max(carm.columns, carm.rows) / 512.0;
    const Lines lines(carm, points, pose, near_px);

    // Turned about the middle of the rings, which stays where it is seen.
    const double middle_x = 0.5 * (layout.rings.front().x_mm + layout.rings.back().x_mm);
    const Vector3 middle = pose * Vector3(middle_x, 0, 0);
    const Vector3 ray = middle.normalized();
    const Vector3 axis = pose.rotate(Vector3::UnitX());
    const Vector3 across = ray.cross(axis);
    std::vector<Twin> found;
    if (!(across.norm() > 0.05)) return found;  // seen end on: no estimate either
    const double out_of_plane = std::asin(std::clamp(axis.dot(ray), -1.0, 1.0));
    // About this axis the corkscrew turns toward the viewer or away from him, seen along the same line all the time.
    const Rigid3 other_side = turnedAbout(middle, across.normalized(), 2 * out_of_plane);
    const Rigid3 other_way = turnedAbout(middle, across.normalized(), std::numbers::pi);
    for (const bool reversed : {false, true}) {
        for (const bool flipped : {false, true}) {
            Rigid3 start = pose;
            if (flipped) start = other_side * start;
            if (reversed) start = other_way * start;
            Twin best;
            best.other_axis = reversed;
            best.other_roll = flipped;
            for (int i = 0; i < kTwists; ++i) {
                const double twist = 2 * std::numbers::pi * i / kTwists;
                const Rigid3 turned = start * Rigid3::fromRotationVector({twist, 0, 0});
                if ((turned * pose.inverse()).rotationAngle() < kSameRad) continue;
                // The pose's own twist is no twin, nor is the slope down from it.
                if (!reversed && !flipped && std::min(twist, 2 * std::numbers::pi - twist) < kOtherTwistRad) continue;
                const double overlap = lines.overlap(points, turned);
                if (overlap <= best.overlap) continue;
                best.overlap = overlap;
                best.imager_from_corkscrew = turned;
            }
            if (best.overlap >= least_overlap) found.push_back(best);
        }
    }
    std::sort(found.begin(), found.end(), [](const Twin& a, const Twin& b) { return a.overlap > b.overlap; });
    return found;
}

}  // namespace fluorocut::corkscrew
