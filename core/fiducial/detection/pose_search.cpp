#include "core/fiducial/detection/pose_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

#include "core/base/parallel.h"
#include "core/fiducial/detection/three_points.h"

namespace fluorocut::detection {
namespace {

// How far a depth told by a shadow's size may be off: the size of a small shadow is blurred.
constexpr double kSizeTolerance = 0.3;
constexpr double kNearestDepth = 0.15;  // of the focal length
constexpr double kFarthestDepth = 1.15;
constexpr std::size_t kKeptPerBead = 8;

std::vector<std::size_t> spreadOrder(const std::vector<Bead>& beads) {
    std::vector<double> distance(beads.size(), std::numeric_limits<double>::infinity());
    std::vector<std::size_t> order;
    std::size_t next = 0;
    while (order.size() < beads.size()) {
        order.push_back(next);
        distance[next] = -1;
        for (std::size_t i = 0; i < beads.size(); ++i) {
            if (distance[i] >= 0)
                distance[i] = std::min(distance[i], (beads[i].center_mm - beads[next].center_mm).norm());
        }
        next = static_cast<std::size_t>(std::max_element(distance.begin(), distance.end()) - distance.begin());
    }
    return order;
}

double triangleArea(const Shadow& a, const Shadow& b, const Shadow& c) {
    const Vector2 u = b.ideal_px - a.ideal_px, v = c.ideal_px - a.ideal_px;
    return 0.5 * std::abs(u.x() * v.y() - u.y() * v.x());
}

}  // namespace

VotingGrid::VotingGrid(const std::vector<Shadow>& shadows, int columns, int rows, double distance_px)
    : margin_(distance_px + 2 * kCellPx),
      columns_(static_cast<int>((columns + 2 * margin_) / kCellPx) + 1),
      rows_(static_cast<int>((rows + 2 * margin_) / kCellPx) + 1),
      cells_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), -1) {
    std::vector<float> nearest(cells_.size(), std::numeric_limits<float>::infinity());
    const int reach = static_cast<int>(std::ceil(distance_px / kCellPx));
    for (std::size_t i = 0; i < shadows.size(); ++i) {
        const Vector2 place = (shadows[i].ideal_px.array() + margin_) / kCellPx;
        if (!(place.x() >= 0 && place.y() >= 0 && place.x() < columns_ && place.y() < rows_)) continue;
        const int cx = static_cast<int>(place.x()), cy = static_cast<int>(place.y());
        for (int y = std::max(0, cy - reach); y <= std::min(rows_ - 1, cy + reach); ++y) {
            for (int x = std::max(0, cx - reach); x <= std::min(columns_ - 1, cx + reach); ++x) {
                const double distance = kCellPx * std::hypot(x + 0.5 - place.x(), y + 0.5 - place.y());
                const auto cell =
                    static_cast<std::size_t>(y) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(x);
                if (distance <= distance_px && distance < nearest[cell]) {
                    nearest[cell] = static_cast<float>(distance);
                    cells_[cell] = static_cast<std::int16_t>(i);
                }
            }
        }
    }
}

int VotingGrid::at(const Vector2& ideal_px) const {
    const Vector2 place = (ideal_px.array() + margin_) / kCellPx;
    if (!(place.x() >= 0 && place.y() >= 0 && place.x() < columns_ && place.y() < rows_)) return -1;
    return cells_[static_cast<std::size_t>(place.y()) * static_cast<std::size_t>(columns_) +
                  static_cast<std::size_t>(place.x())];
}

PoseSearch::PoseSearch(const BeadLayout& layout, const std::vector<Shadow>& shadows, const PixelIntrinsics& intrinsics,
                       const SearchLimits& limits)
    : layout_(layout),
      shadows_(shadows),
      intrinsics_(intrinsics),
      limits_(limits),
      grid_(shadows, limits.columns, limits.rows, limits.vote_distance_px),
      order_(spreadOrder(layout.beads)) {}

int PoseSearch::votes(const Matrix3& rotation, const Vector3& translation) const {
    std::array<std::uint64_t, 16> used{};  // 1024 shadows
    int votes = 0, asked = 0;
    const int all = static_cast<int>(order_.size());
    for (const std::size_t index : order_) {
        const Vector3 place = rotation * layout_.beads[index].center_mm + translation;
        ++asked;
        if (place.z() > 1) {
            const double scale = intrinsics_.focal_px / place.z();
            const int shadow = grid_.at({scale * place.x() + intrinsics_.principal_point_px.x(),
                                         intrinsics_.aspect * scale * place.y() + intrinsics_.principal_point_px.y()});
            if (shadow >= 0) {
                const auto bit = static_cast<std::size_t>(shadow);
                if ((used[bit / 64] >> (bit % 64) & 1) == 0) ++votes;
                used[bit / 64] |= std::uint64_t{1} << (bit % 64);
            }
        }
        // Three agree by construction. Give up where even the rest cannot make it, or hardly any so far has.
        if (votes + all - asked < limits_.least_votes) return 0;
        if (asked >= 10 && votes < 0.2 * asked) return 0;
    }
    return votes;
}

std::vector<PoseHypothesis> PoseSearch::posesFor(const std::array<std::size_t, 3>& triple, std::size_t most,
                                                 std::atomic<long long>& tried, const Progress& progress) const {
    const std::vector<Bead>& beads = layout_.beads;
    const std::array<Vector3, 3> directions{shadows_[triple[0]].direction, shadows_[triple[1]].direction,
                                            shadows_[triple[2]].direction};
    const double f = limits_.focal_length_mm;
    // Depth that a shadow's size asks for, for each bead.
    std::array<std::vector<double>, 3> hint;
    for (std::size_t corner = 0; corner < 3; ++corner) {
        for (const Bead& bead : beads) {
            hint[corner].push_back(intrinsics_.focal_px * 0.5 * bead.diameter_mm /
                                   std::max(0.5, shadows_[triple[corner]].radius_px));
        }
    }
    const auto angle = [&](std::size_t a, std::size_t b) { return (directions[a] - directions[b]).norm(); };
    const std::array<double, 3> angles{angle(0, 1), angle(1, 2), angle(2, 0)};
    const auto possible = [&](std::size_t corner, std::size_t bead) {
        const double z = hint[corner][bead];
        return !limits_.use_sizes ||
               (z > (1 - kSizeTolerance) * kNearestDepth * f && z < (1 + kSizeTolerance) * kFarthestDepth * f);
    };
    const auto possiblePair = [&](std::size_t corner, std::size_t other, double between, std::size_t bead,
                                  std::size_t other_bead) {
        const double apart = (beads[bead].center_mm - beads[other_bead].center_mm).norm();
        if (!limits_.use_sizes) return apart >= between * kNearestDepth * f;
        const double z = hint[corner][bead], other_z = hint[other][other_bead];
        return apart >= between * (1 - kSizeTolerance) * std::min(z, other_z) &&
               std::abs(z - other_z) <= apart + kSizeTolerance * std::max(z, other_z);
    };

    std::vector<std::vector<PoseHypothesis>> found(beads.size());
    parallelFor(beads.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            if (progress.isCancelled()) return;
            std::vector<PoseHypothesis>& own = found[i];
            long long count = 0;
            for (std::size_t j = 0; j < beads.size() && possible(0, i); ++j) {
                if (j == i || !possible(1, j) || !possiblePair(0, 1, angles[0], i, j)) continue;
                for (std::size_t k = 0; k < beads.size(); ++k) {
                    if (k == i || k == j || !possible(2, k) || !possiblePair(1, 2, angles[1], j, k) ||
                        !possiblePair(2, 0, angles[2], k, i)) {
                        continue;
                    }
                    const std::array<Vector3, 3> points{beads[i].center_mm, beads[j].center_mm, beads[k].center_mm};
                    ++count;
                    for (const auto& distances : distancesToThreePoints(points, directions)) {
                        std::array<Vector3, 3> seen;
                        bool sensible = true;
                        const std::array<std::size_t, 3> bead{i, j, k};
                        for (std::size_t corner = 0; corner < 3; ++corner) {
                            seen[corner] = distances[corner] * directions[corner];
                            const double z = seen[corner].z(), expected = hint[corner][bead[corner]];
                            sensible = sensible && z > kNearestDepth * f && z < kFarthestDepth * f &&
                                       (!limits_.use_sizes ||
                                        (z > (1 - kSizeTolerance) * expected && z < (1 + kSizeTolerance) * expected));
                        }
                        if (!sensible) continue;
                        if (!((points[1] - points[0]).cross(points[2] - points[0]).norm() > 1e-6)) continue;
                        if (!((seen[1] - seen[0]).cross(seen[2] - seen[0]).norm() > 1e-6)) continue;
                        const Rigid3 pose = motionOfTriangle(points, seen);
                        const int agree = votes(pose.rotationMatrix(), pose.translation());
                        if (agree >= limits_.least_votes) own.push_back({pose, agree});
                    }
                }
            }
            tried += count;
            std::stable_sort(own.begin(), own.end(),
                             [](const PoseHypothesis& a, const PoseHypothesis& b) { return a.votes > b.votes; });
            if (own.size() > kKeptPerBead) own.resize(kKeptPerBead);
        }
    });
    std::vector<PoseHypothesis> all;
    for (const auto& own : found)
        all.insert(all.end(), own.begin(), own.end());
    std::stable_sort(all.begin(), all.end(),
                     [](const PoseHypothesis& a, const PoseHypothesis& b) { return a.votes > b.votes; });
    if (all.size() > most) all.resize(most);
    return all;
}

std::vector<std::array<std::size_t, 3>> wideTriples(const std::vector<Shadow>& shadows, std::size_t count,
                                                    Random& random) {
    struct Triple {
        std::array<std::size_t, 3> shadows;
        double area;
    };
    std::vector<Triple> sample;
    std::set<std::array<std::size_t, 3>> known;
    const std::size_t all = shadows.size();
    if (all < 3) return {};
    for (std::size_t i = 0; i < 20 * count; ++i) {
        std::array<std::size_t, 3> one{random.below(all), random.below(all), random.below(all)};
        std::sort(one.begin(), one.end());
        if (one[0] == one[1] || one[1] == one[2] || !known.insert(one).second) continue;
        sample.push_back({one, triangleArea(shadows[one[0]], shadows[one[1]], shadows[one[2]])});
    }
    if (sample.empty()) return {};
    const double largest = std::max_element(sample.begin(), sample.end(), [](const Triple& a, const Triple& b) {
                               return a.area < b.area;
                           })->area;
    // The wide ones in the order drawn; then the others, widest first: where false shadows lie outside of a slender
    // layout, none of the wide ones may be of beads alone.
    std::stable_sort(sample.begin(), sample.end(), [&](const Triple& a, const Triple& b) {
        return std::min(a.area, 0.3 * largest) > std::min(b.area, 0.3 * largest);
    });
    std::vector<std::array<std::size_t, 3>> wide;
    for (std::size_t i = 0; i < sample.size() && wide.size() < count; ++i)
        wide.push_back(sample[i].shadows);
    return wide;
}

}  // namespace fluorocut::detection
