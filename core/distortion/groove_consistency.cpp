#include "core/distortion/groove_consistency.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include <Eigen/LU>

#include "core/base/median.h"
#include "core/base/parallel.h"

namespace fluorocut::grooves {
namespace {

constexpr double kFaintShare = 0.4;    // of the median contrast: less is no groove
constexpr double kBrightShare = 1.9;   // more is something else
constexpr double kMaxShift = 0.2;      // pitches from the map
constexpr double kMaxRoughness = 4;    // times the median
constexpr double kMaxDeviation = 4.5;  // standard deviations from the neighbours' plane
constexpr double kUnevenness = 0.002;  // pitches: what a smooth map may deviate from a plane over two pitches
constexpr int kRounds = 3;
constexpr int kReach = 2;  // pitches
constexpr int kMinNeighbours = 5;
constexpr double kConnected = 1.6;         // pitches
constexpr double kMaxCarriedError = 0.25;  // pitches
constexpr double kMaxCarriedSigma = 0.1;   // pitches
constexpr std::size_t kMinPart = 8;        // segments that are compared
constexpr double kAgreeingShare = 0.95;    // of them
constexpr double kMapSigma = 0.02;         // pitches: the true map is not the polynomial
constexpr double kMaxSigma = 0.06;         // pitches, of a point: beyond it is of no use
constexpr double kMaxStep = 0.1;           // pitches from the neighbours' plane, whatever the noise

template <class Value>
double medianOfFound(const std::vector<Segment>& segments, Value value) {
    std::vector<double> values;
    for (const Segment& segment : segments)
        if (segment.state == SegmentState::found) values.push_back(value(segment));
    return median(values);
}

// Segments of one direction by (index, between).
class SegmentGrid {
  public:
    SegmentGrid(const std::vector<Segment>& segments, int direction) {
        int low_i = 0, high_i = -1, low_b = 0, high_b = -1;
        for (const Segment& segment : segments) {
            if (segment.direction != direction) continue;
            const bool first = high_i < low_i;
            low_i = first ? segment.index : std::min(low_i, segment.index);
            high_i = first ? segment.index : std::max(high_i, segment.index);
            low_b = first ? segment.between : std::min(low_b, segment.between);
            high_b = first ? segment.between : std::max(high_b, segment.between);
        }
        low_i_ = low_i;
        low_b_ = low_b;
        rows_ = high_i - low_i + 1;
        columns_ = high_b - low_b + 1;
        cells_.assign(static_cast<std::size_t>(rows_) * static_cast<std::size_t>(columns_), -1);
        for (std::size_t n = 0; n < segments.size(); ++n)
            if (segments[n].direction == direction)
                cells_[place(segments[n].index, segments[n].between)] = static_cast<int>(n);
    }
    // -1: none
    int at(int index, int between) const {
        const int i = index - low_i_, b = between - low_b_;
        return i < 0 || b < 0 || i >= rows_ || b >= columns_ ? -1 : cells_[place(index, between)];
    }

  private:
    std::size_t place(int index, int between) const {
        return static_cast<std::size_t>(index - low_i_) * static_cast<std::size_t>(columns_) +
               static_cast<std::size_t>(between - low_b_);
    }
    int low_i_, low_b_, rows_, columns_;
    std::vector<int> cells_;
};

struct Prediction {
    double difference = 0;  // measured minus predicted, pitches
    double variance = 0;    // of the prediction
    bool possible = false;
};

// Robust plane through the neighbours' deviations from the map.
Prediction predict(const std::vector<Segment>& segments, const std::vector<double>& deviations, const SegmentGrid& grid,
                   std::size_t which) {
    const Segment& segment = segments[which];
    struct Neighbour {
        double i, b, deviation, variance;
    };
    std::array<Neighbour, static_cast<std::size_t>((2 * kReach + 1) * (2 * kReach + 1))> neighbours;
    std::size_t count = 0;
    for (int di = -kReach; di <= kReach; ++di) {
        for (int db = -kReach; db <= kReach; ++db) {
            const int n = di == 0 && db == 0 ? -1 : grid.at(segment.index + di, segment.between + db);
            if (n < 0) continue;
            const Segment& other = segments[static_cast<std::size_t>(n)];
            if (other.state != SegmentState::found) continue;
            const double sigma = other.sigma_px / other.pitch_px;
            neighbours[count++] = {static_cast<double>(di), static_cast<double>(db),
                                   deviations[static_cast<std::size_t>(n)], sigma * sigma + kUnevenness * kUnevenness};
        }
    }
    Prediction prediction;
    if (count < kMinNeighbours) return prediction;
    std::vector<double> values;
    for (std::size_t n = 0; n < count; ++n)
        values.push_back(neighbours[n].deviation);
    Eigen::Vector3d plane(median(values), 0, 0);
    Eigen::Matrix3d inverse = Eigen::Matrix3d::Zero();
    const double own = deviations[which];
    for (int iteration = 0; iteration < 4; ++iteration) {
        Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
        Eigen::Vector3d right = Eigen::Vector3d::Zero();
        for (std::size_t n = 0; n < count; ++n) {
            const Neighbour& neighbour = neighbours[n];
            const Eigen::Vector3d row(1, neighbour.i, neighbour.b);
            const double residual = neighbour.deviation - row.dot(plane);
            const double cut = (iteration == 0 ? 64 : 25) * neighbour.variance;
            const double inside = 1 - residual * residual / (cut + (iteration == 0 ? 0.02 * 0.02 : 0));
            if (inside <= 0) continue;
            const double weight = inside * inside / neighbour.variance;
            matrix += weight * row * row.transpose();
            right += weight * neighbour.deviation * row;
        }
        // Neighbours on one line hold no plane: the slopes are then held near zero (a bend of 3 % per pitch).
        matrix(1, 1) += 1 / (0.03 * 0.03);
        matrix(2, 2) += 1 / (0.03 * 0.03);
        if (!(matrix(0, 0) > 0)) return prediction;
        inverse = matrix.inverse();
        plane = inverse * right;
    }
    prediction.difference = own - plane[0];
    prediction.variance = inverse(0, 0);
    prediction.possible = std::isfinite(prediction.difference) && std::isfinite(prediction.variance);
    return prediction;
}

double ownVariance(const Segment& segment) {
    const double sigma = segment.sigma_px / segment.pitch_px;
    return sigma * sigma + kUnevenness * kUnevenness;
}

// How much of the variance above white noise, roughness^2 - 1, must be added to a point's variance (in units of its
// own) for the scatter about the neighbours to be as stated; and a factor for all.
void chargeRoughness(std::vector<Segment>& segments, const std::vector<Prediction>& predictions) {
    struct Entry {
        double excess, squared;
    };
    std::vector<Entry> entries;
    for (std::size_t n = 0; n < segments.size(); ++n) {
        if (segments[n].state != SegmentState::found || !predictions[n].possible) continue;
        const double total = ownVariance(segments[n]) + predictions[n].variance;
        entries.push_back({std::max(0.0, segments[n].roughness * segments[n].roughness - 1),
                           predictions[n].difference * predictions[n].difference / total});
    }
    if (entries.size() < 60) return;
    std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) { return a.excess < b.excess; });
    // Medians of groups of equal size against their excess: a line by least squares. A median of squares is 0.455 of
    // the variance.
    constexpr std::size_t kGroups = 6;
    double sw = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
    for (std::size_t group = 0; group < kGroups; ++group) {
        std::vector<double> excess, squared;
        for (std::size_t n = group * entries.size() / kGroups; n < (group + 1) * entries.size() / kGroups; ++n) {
            excess.push_back(entries[n].excess);
            squared.push_back(entries[n].squared);
        }
        const double x = median(excess), y = median(squared) / 0.4549;
        const double weight = 1 / (y * y + 1e-6);  // a median's scatter grows with it
        sw += weight;
        sx += weight * x;
        sy += weight * y;
        sxx += weight * x * x;
        sxy += weight * x * y;
    }
    const double spread = sw * sxx - sx * sx;
    double slope = spread > 1e-9 * sw * sw ? (sw * sxy - sx * sy) / spread : 0;
    slope = std::max(0.0, slope);
    const double level = std::max(1.0, (sy - slope * sx) / sw);
    for (Segment& segment : segments) {
        if (segment.state != SegmentState::found) continue;
        const double excess = std::max(0.0, segment.roughness * segment.roughness - 1);
        segment.sigma_px *= std::sqrt(level + slope * excess);
    }
}

}  // namespace

double medianContrast(const std::vector<Segment>& segments, int direction) {
    std::vector<double> values;
    for (const Segment& segment : segments)
        if (segment.state == SegmentState::found && segment.direction == direction) values.push_back(segment.contrast);
    return values.empty() ? 0 : median(values);
}

void judgeSegments(std::vector<Segment>& segments, const LatticeMap& map) {
    std::vector<double> deviations(segments.size());  // from the map, pitches
    for (std::size_t n = 0; n < segments.size(); ++n) {
        Segment& segment = segments[n];
        if (!segment.seen) continue;
        segment.state = SegmentState::found;
        segment.sigma_px = segment.fit_sigma_px;
        deviations[n] = map.at(segment.point())[segment.direction] - segment.index;
    }
    const double roughness = medianOfFound(segments, [](const Segment& segment) { return segment.roughness; });
    const std::array<double, 2> contrast = {medianContrast(segments, 0), medianContrast(segments, 1)};
    for (std::size_t n = 0; n < segments.size(); ++n) {
        Segment& segment = segments[n];
        if (!segment.seen) continue;
        const double usual = contrast[static_cast<std::size_t>(segment.direction)];
        if (segment.contrast < kFaintShare * usual) {
            segment.state = SegmentState::hidden;
        } else if (segment.contrast > kBrightShare * usual || segment.roughness > kMaxRoughness * roughness ||
                   !(std::abs(deviations[n]) < kMaxShift) || !(segment.sigma_px < kMaxSigma * segment.pitch_px)) {
            segment.state = SegmentState::doubtful;
        }
    }
    const std::array<SegmentGrid, 2> grids = {SegmentGrid(segments, 0), SegmentGrid(segments, 1)};
    for (int round = 0; round < kRounds; ++round) {
        std::vector<Prediction> predictions(segments.size());
        parallelFor(segments.size(), 64, [&](std::size_t begin, std::size_t end) {
            for (std::size_t n = begin; n < end; ++n) {
                if (segments[n].state != SegmentState::found) continue;
                predictions[n] =
                    predict(segments, deviations, grids[static_cast<std::size_t>(segments[n].direction)], n);
            }
        });
        if (round == 0) chargeRoughness(segments, predictions);
        for (std::size_t n = 0; n < segments.size(); ++n) {
            if (segments[n].state != SegmentState::found) continue;
            const Prediction& prediction = predictions[n];
            const double limit =
                std::min(kMaxStep, kMaxDeviation * std::sqrt(ownVariance(segments[n]) + prediction.variance));
            if (!prediction.possible || !(std::abs(prediction.difference) < limit))
                segments[n].state = SegmentState::doubtful;
        }
    }
}

std::optional<LatticeMap> mapThrough(const std::vector<Segment>& segments, const LatticeMap& map, const Vector2& center,
                                     double radius) {
    std::array<std::vector<LatticeSample>, 2> samples;
    Vector2 sum = Vector2::Zero();
    double count = 0;
    for (const Segment& segment : segments) {
        if (segment.state != SegmentState::found) continue;
        const double sigma = segment.sigma_px / segment.pitch_px;
        samples[static_cast<std::size_t>(segment.direction)].push_back(
            {segment.point(), static_cast<double>(segment.index), 1 / (sigma * sigma + kMapSigma * kMapSigma)});
        sum += segment.start;
        ++count;
    }
    if (count == 0) return std::nullopt;
    LatticeMap next(center, radius, map.place(sum / count).jacobian);
    if (!next.fit(0, samples[0], 0.02) || !next.fit(1, samples[1], 0.02)) return std::nullopt;
    return next;
}

int dropUncertainParts(std::vector<Segment>& segments, const LatticeMap& map, const Vector2& center, double radius) {
    std::map<std::pair<int, int>, std::vector<std::size_t>> cells;
    for (std::size_t n = 0; n < segments.size(); ++n) {
        if (segments[n].state != SegmentState::found) continue;
        const Vector2 at = segments[n].lattice();
        cells[{static_cast<int>(std::floor(at.x())), static_cast<int>(std::floor(at.y()))}].push_back(n);
    }
    std::vector<int> part_of(segments.size(), -1);
    std::vector<std::vector<std::size_t>> parts;
    for (std::size_t first = 0; first < segments.size(); ++first) {
        if (segments[first].state != SegmentState::found || part_of[first] >= 0) continue;
        const int part = static_cast<int>(parts.size());
        parts.emplace_back();
        std::vector<std::size_t> open = {first};
        part_of[first] = part;
        while (!open.empty()) {
            const std::size_t n = open.back();
            open.pop_back();
            parts.back().push_back(n);
            const Vector2 at = segments[n].lattice();
            const int x = static_cast<int>(std::floor(at.x())), y = static_cast<int>(std::floor(at.y()));
            for (int dy = -2; dy <= 2; ++dy) {
                for (int dx = -2; dx <= 2; ++dx) {
                    const auto cell = cells.find({x + dx, y + dy});
                    if (cell == cells.end()) continue;
                    for (const std::size_t other : cell->second) {
                        if (part_of[other] >= 0 || (segments[other].lattice() - at).norm() > kConnected) continue;
                        part_of[other] = part;
                        open.push_back(other);
                    }
                }
            }
        }
    }
    if (parts.size() < 2) return 0;
    std::stable_sort(parts.begin(), parts.end(), [](const auto& a, const auto& b) { return a.size() > b.size(); });

    std::vector<Segment> main;
    const auto join = [&](const std::vector<std::size_t>& part) {
        for (const std::size_t n : part)
            main.push_back(segments[n]);
        return mapThrough(main, map, center, radius);
    };
    std::optional<LatticeMap> by_main = join(parts[0]);
    parts.erase(parts.begin());
    // A part hangs together, so that its numbers are all right or all off by as much: those of each direction are held
    // against the main one's map where that reaches for certain. What was joined carries the map on to the next.
    const auto isCertain = [&](const std::vector<std::size_t>& part) {
        std::array<std::size_t, 2> members{}, reached{}, agreeing{};
        for (const std::size_t n : part) {
            const Segment& segment = segments[n];
            const auto direction = static_cast<std::size_t>(segment.direction);
            ++members[direction];
            if (!(by_main->sigma(segment.direction, segment.point()) < kMaxCarriedSigma)) continue;
            ++reached[direction];
            const double carried = by_main->at(segment.point())[segment.direction];
            agreeing[direction] += std::abs(carried - segment.index) < kMaxCarriedError;
        }
        for (const std::size_t direction : {0, 1})
            if (reached[direction] < std::min(kMinPart / 2, members[direction]) ||
                static_cast<double>(agreeing[direction]) < kAgreeingShare * static_cast<double>(reached[direction]))
                return false;
        return reached[0] + reached[1] >= kMinPart;
    };
    while (by_main) {
        const auto next = std::find_if(parts.begin(), parts.end(), isCertain);
        if (next == parts.end()) break;
        by_main = join(*next);
        parts.erase(next);
    }
    int dropped = 0;
    for (const auto& part : parts) {
        for (const std::size_t n : part)
            segments[n].state = SegmentState::doubtful;
        dropped += static_cast<int>(part.size());
    }
    return dropped;
}

}  // namespace fluorocut::grooves
