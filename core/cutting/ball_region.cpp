#include "core/cutting/ball_region.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace fluorocut {
namespace {

constexpr double kOutside = 1e3;  // mm: the field beyond its grid

// Follows the border between values <= 0 and > 0 on a grid of nodes: places on its edges, the inside to the left.
// Edge ids: 2 node (to the next column), 2 node + 1 (to the next row).
class MarchingSquares {
  public:
    MarchingSquares(const std::vector<double>& values, int columns, int rows)
        : values_(values), columns_(columns), rows_(rows), next_(2 * values.size(), -1) {}

    std::vector<std::vector<int>> loops() {
        for (int j = 0; j + 1 < rows_; ++j)
            for (int i = 0; i + 1 < columns_; ++i)
                cell(i, j);
        std::vector<std::vector<int>> result;
        for (int start = 0; start < static_cast<int>(next_.size()); ++start) {
            if (next(start) < 0) continue;
            std::vector<int>& loop = result.emplace_back();
            for (int edge = start; next(edge) >= 0;) {
                loop.push_back(edge);
                edge = std::exchange(next(edge), -1);
            }
        }
        return result;
    }

  private:
    int& next(int edge) { return next_[static_cast<std::size_t>(edge)]; }
    double at(int i, int j) const { return values_[static_cast<std::size_t>(j * columns_ + i)]; }

    void cell(int i, int j) {
        const double corner[4] = {at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)};
        const int node = j * columns_ + i;
        const int edge[4] = {2 * node, 2 * (node + 1) + 1, 2 * (node + columns_), 2 * node + 1};
        int leaving[2], entering[2], leave = 0, enter = 0;
        for (int k = 0; k < 4; ++k) {
            const bool in = corner[k] <= 0, next_in = corner[(k + 1) % 4] <= 0;
            if (in && !next_in) leaving[leave++] = k;
            if (!in && next_in) entering[enter++] = k;
        }
        if (leave == 1) next(edge[leaving[0]]) = edge[entering[0]];
        if (leave == 2) {
            // Opposite corners are inside: joined when the bilinear middle is.
            const bool joined = corner[0] + corner[1] + corner[2] + corner[3] <= 0;
            for (const int from : leaving)
                next(edge[from]) = edge[(from + (joined ? 1 : 3)) % 4];
        }
    }

    const std::vector<double>& values_;
    int columns_, rows_;
    std::vector<int> next_;  // of the edge at which the border goes on; -1: none
};

// Where `value` crosses 0 between two points of different sign (Illinois variant of the false position).
template <class Value>
Vector2 crossing(const Value& value, Vector2 a, double fa, Vector2 b, double fb) {
    int side = 0;
    Vector2 p = a;
    for (int i = 0; i < 20; ++i) {
        p = a + fa / (fa - fb) * (b - a);
        const double f = value(p);
        if (std::abs(f) < 1e-5) break;
        if ((f > 0) == (fb > 0)) {
            b = p, fb = f;
            if (side == -1) fa *= 0.5;
            side = -1;
        } else {
            a = p, fa = f;
            if (side == 1) fb *= 0.5;
            side = 1;
        }
    }
    return p;
}

// The least value near a place, by steps along the axes that get smaller.
template <class Value>
Vector2 deepest(const Value& value, Vector2 at, double step) {
    double least = value(at);
    for (; step > 1e-3; step *= 0.5) {
        for (bool better = true; better;) {
            better = false;
            for (int k = 0; k < 8; ++k) {
                const double around = k * std::numbers::pi / 4;
                const Vector2 other = at + step * Vector2(std::cos(around), std::sin(around));
                const double there = value(other);
                if (there < least - 1e-9) least = there, at = other, better = true;
            }
        }
    }
    return at;
}

// A part of the region that none of the grid's nodes is in, as it is seen from its deepest place.
template <class Value>
PlaneRegion aroundDeepest(const Value& value, const Vector2& node, double spacing) {
    if (!(value(node) < spacing)) return {};
    const Vector2 middle = deepest(value, node, 0.5 * spacing);
    const double least = value(middle);
    if (!(least < -1e-4)) return {};
    Polygon polygon;
    constexpr int kRays = 24;
    for (int k = 0; k < kRays; ++k) {
        const double around = 2 * std::numbers::pi * k / kRays;
        const Vector2 end = middle + 2 * spacing * Vector2(std::cos(around), std::sin(around));
        const double there = value(end);
        if (!(there > 0)) return {};
        polygon.push_back(crossing(value, middle, least, end, there));
    }
    return {polygon};
}

}  // namespace

Result<BallReach> BallReach::of(const Volume& field, const MeshDistance* wall, double radius_mm, double top_mm,
                                double open_mm, double tolerance_mm) {
    const VolumeGrid& grid = field.grid();
    if (std::min({grid.size[0], grid.size[1], grid.size[2]}) < 2) {
        return invalidInput("cavity field",
                            fmt::format("{} x {} x {} voxels", grid.size[0], grid.size[1], grid.size[2]),
                            "at least 2 along each axis");
    }
    if (!(grid.direction - Matrix3::Identity()).isZero(1e-9) || !(grid.spacing_mm.minCoeff() > 0)) {
        return invalidInput("cavity field", "a grid that is turned", "one along the frame's axes");
    }
    if (!std::all_of(field.voxels().begin(), field.voxels().end(), [](float v) { return std::isfinite(v); })) {
        return invalidInput("cavity field", "values that are no number", "distances in mm");
    }
    const double low = grid.origin_mm.z(), high = low + grid.spacing_mm.z() * (grid.size[2] - 1);
    if (!(top_mm > low && top_mm <= high)) {
        return invalidInput("cavity field", fmt::format("a top at {:.2f} mm", top_mm),
                            fmt::format("one inside the field, {:.2f} to {:.2f} mm", low, high));
    }
    BallReach reach(field, wall, radius_mm, top_mm, open_mm, tolerance_mm);
    reach.straight_ = reach.widensUpward();
    return reach;
}

bool BallReach::widensUpward() const {
    const Volume& field = *field_;
    for (int j = 0; j < field.size(1); ++j) {
        for (int i = 0; i < field.size(0); ++i) {
            bool inside = false;
            for (int k = 0; k < field.size(2); ++k) {
                const double value = static_cast<double>(field(i, j, k)) + radius_mm_;
                // A tenth of the tolerance: rounding of the field.
                if (inside && value > 0.1 * tolerance_mm_) return false;
                inside = inside || value <= 0;
                if (field.grid().origin_mm.z() + k * field.grid().spacing_mm.z() > top_mm_) break;
            }
        }
    }
    return true;
}

double BallReach::ballValue(const Vector3& center) const {
    const Vector3 point(center.x(), center.y(), std::min(center.z(), top_mm_));
    const Vector3 index = (point - field_->grid().origin_mm).cwiseQuotient(field_->grid().spacing_mm);
    const double value = static_cast<double>(sampleLinear(*field_, index, static_cast<float>(kOutside))) + radius_mm_;
    // Interpolation is off by less than a voxel: farther from the border its sign is enough.
    if (!wall_ || !(std::abs(value) < field_->grid().spacing_mm.maxCoeff())) return value;
    const NearestPoint near = wall_->nearest(point, radius_mm_ + 2 * field_->grid().spacing_mm.maxCoeff());
    return near.triangle >= 0 ? radius_mm_ - near.distance_mm : value;
}

double BallReach::value(const Vector3& center, const Vector3& spindle) const {
    double greatest = ballValue(center);
    if (straight_ && spindle == Vector3::UnitZ()) return greatest;
    const double end = (open_mm_ - center.z()) / spindle.z(), step = field_->grid().spacing_mm.minCoeff();
    // No value of interest is larger than some voxels.
    for (double t = step; t < end + step && greatest < 2; t += step)
        greatest = std::max(greatest, ballValue(center + std::min(t, end) * spindle));
    return greatest;
}

bool BallReach::shankClear(const Vector3& center, const Vector3& spindle) const {
    if (straight_ && spindle == Vector3::UnitZ()) return ballValue(center) <= 0;
    const double end = (open_mm_ - center.z()) / spindle.z(), step = 2 * field_->grid().spacing_mm.minCoeff();
    for (double t = 0; t < end + step; t += step)
        if (!(ballValue(center + std::min(t, end) * spindle) <= 0)) return false;
    return true;
}

template <class Value>
PlaneRegion BallReach::contour(double z_mm, const Value& value) const {
    const VolumeGrid& grid = field_->grid();
    const int columns = grid.size[0], rows = grid.size[1];
    const auto node = [&](int n) {
        return Vector2(grid.origin_mm.x() + n % columns * grid.spacing_mm.x(),
                       grid.origin_mm.y() + n / columns * grid.spacing_mm.y());
    };
    // Half the tolerance inside; the chords may use the other half.
    const double inset = 0.5 * tolerance_mm_;
    const auto level = [&](const Vector2& p) { return value(Vector3(p.x(), p.y(), z_mm)) + inset; };
    std::vector<double> values(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), kOutside);
    bool any = false;
    for (int j = 1; j + 1 < rows; ++j) {
        for (int i = 1; i + 1 < columns; ++i) {
            const int n = j * columns + i;
            any |= (values[static_cast<std::size_t>(n)] = level(node(n))) <= 0;
        }
    }
    if (!any) {
        const auto least = std::min_element(values.begin(), values.end());
        return aroundDeepest(level, node(static_cast<int>(least - values.begin())),
                             grid.spacing_mm.head<2>().maxCoeff());
    }

    PlaneRegion region;
    for (const std::vector<int>& loop : MarchingSquares(values, columns, rows).loops()) {
        Polygon rough;
        for (const int edge : loop) {
            const int a = edge / 2, b = a + (edge % 2 ? columns : 1);
            rough.push_back(crossing(level, node(a), values[static_cast<std::size_t>(a)], node(b),
                                     values[static_cast<std::size_t>(b)]));
        }
        // Halve chords whose middle is off the level.
        Polygon fine;
        const auto refine = [&](const auto& self, const Vector2& a, const Vector2& b, int depth) -> void {
            fine.push_back(a);
            const Vector2 middle = 0.5 * (a + b), way = b - a;
            const double off = level(middle);
            if (depth == 0 || std::abs(off) < 0.125 * tolerance_mm_ || !(way.norm() > 1e-3)) return;
            const Vector2 inward = Vector2(-way.y(), way.x()).normalized();
            const Vector2 other = middle + 2 * off * inward;
            const double there = level(other);
            if ((there > 0) == (off > 0)) return;
            const Vector2 between = crossing(level, middle, off, other, there);
            fine.pop_back();
            self(self, a, between, depth - 1);
            self(self, between, b, depth - 1);
        };
        for (std::size_t i = 0; i < rough.size(); ++i)
            refine(refine, rough[i], rough[(i + 1) % rough.size()], 4);
        const Polygon polygon = simplified(fine, 0.3 * tolerance_mm_);
        if (polygon.size() >= 3) region.push_back(polygon);
    }
    return region;
}

PlaneRegion BallReach::region(double z_mm, const Vector3& spindle) const {
    return contour(z_mm, [&](const Vector3& p) { return value(p, spindle); });
}

PlaneRegion BallReach::ballRegion(double z_mm) const {
    return contour(z_mm, [&](const Vector3& p) { return ballValue(p); });
}

std::vector<Vector3> BallReach::places(double z_mm, int stride) const {
    const VolumeGrid& grid = field_->grid();
    std::vector<Vector3> result;
    for (int j = 1; j + 1 < grid.size[1]; j += stride) {
        for (int i = 1; i + 1 < grid.size[0]; i += stride) {
            Vector3 place = grid.pointFromIndex(Vector3(i, j, 0));
            place.z() = z_mm;
            if (ballValue(place) <= 0) result.push_back(place);
        }
    }
    return result;
}

bool BallReach::anywhere(double z_mm) const {
    const VolumeGrid& grid = field_->grid();
    Vector3 best(0, 0, z_mm);
    double least = kOutside;
    for (int j = 1; j + 1 < grid.size[1]; ++j) {
        for (int i = 1; i + 1 < grid.size[0]; ++i) {
            Vector3 place = grid.pointFromIndex(Vector3(i, j, 0));
            place.z() = z_mm;
            const double value = ballValue(place);
            if (value <= -tolerance_mm_) return true;
            if (value < least) least = value, best = place;
        }
    }
    const double spacing = grid.spacing_mm.head<2>().maxCoeff();
    if (!(least < spacing)) return false;
    const auto value = [&](const Vector2& p) { return ballValue(Vector3(p.x(), p.y(), z_mm)); };
    return value(deepest(value, best.head<2>(), spacing)) <= -tolerance_mm_;
}

double BallReach::lowest() const {
    const VolumeGrid& grid = field_->grid();
    const auto height = [&](double k) { return grid.origin_mm.z() + k * grid.spacing_mm.z(); };
    int k = 0;
    while (k < grid.size[2] && height(k) < top_mm_ && !anywhere(height(k)))
        ++k;
    double high = std::min(height(k), top_mm_), low = height(k - 1);
    if (k == grid.size[2] || !anywhere(high)) return std::numeric_limits<double>::quiet_NaN();
    while (k > 0 && high - low > 1e-4) {
        const double middle = 0.5 * (low + high);
        (anywhere(middle) ? high : low) = middle;
    }
    return high;
}

}  // namespace fluorocut
