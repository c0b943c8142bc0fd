#include "core/fiducial/corkscrew/ring_search.h"

#include <algorithm>
#include <array>
#include <numbers>

namespace fluorocut::corkscrew {
namespace {

constexpr double kSizeStep = 1.05;   // of the ellipses' major half axis
constexpr double kDepthStep = 1.04;  // of the pattern
constexpr double kRatioStep = 0.06;  // of minor over major axis
constexpr int kRatios = 17;          // 0 to 0.96
constexpr double kRollStep = 3.5 * std::numbers::pi / 180;
constexpr int kPlaceStepPx = 2;
constexpr int kAround = 32;          // samples of an ellipse
constexpr double kLeastSpeed = 0.3;  // of a sample along it: nearer to the end of an edge-on ring nothing runs along
constexpr int kBeyondPx = 48;        // the pattern's middle may lie this far outside the image
constexpr int kPlacesPerBin = 2;     // of kPlaceStepPx: the best of each bin is kept
constexpr int kDepthBins = 6;
constexpr int kRollBins = 9;

// The picture along a line, one plane per direction of the ridge: rows across, columns along.
class Strip {
  public:
    Strip(const RidgeMap& ridges, const Vector2& foot, const Vector2& along, const Vector2& across, int first,
          int length, int half)
        : length_(length), half_(half), planes_(static_cast<std::size_t>(kDirections) * plane(), kChance) {
        for (int t = -half; t <= half; ++t) {
            const Vector2 start = foot + t * across + first * along;
            std::uint8_t* out = planes_.data() + static_cast<std::size_t>(t + half) * static_cast<std::size_t>(length);
            for (int s = 0; s < length; ++s) {
                const double x = start.x() + s * along.x(), y = start.y() + s * along.y();
                if (!ridges.contains(x, y)) continue;
                const Strengths& cell = ridges.at(static_cast<int>(x + 0.5), static_cast<int>(y + 0.5));
                for (std::size_t k = 0; k < kDirections; ++k)
                    out[k * plane() + static_cast<std::size_t>(s)] = cell[k];
            }
        }
    }
    const std::uint8_t* row(int direction, int t) const {
        return planes_.data() + static_cast<std::size_t>(direction) * plane() +
               static_cast<std::size_t>(t + half_) * static_cast<std::size_t>(length_);
    }

  private:
    std::size_t plane() const { return static_cast<std::size_t>(length_) * static_cast<std::size_t>(2 * half_ + 1); }
    int length_, half_;
    std::vector<std::uint8_t> planes_;
};

// How well an ellipse of each size, flatness and place is seen: mean strength above chance, times kFull.
class EllipseScores {
  public:
    EllipseScores(const RidgeMap& ridges, const Vector2& foot, const ImageLine& line, double least_px, double most_px,
                  int first, int places)
        : first_(first), places_(places), least_(least_px) {
        sizes_ = static_cast<int>(std::ceil(std::log(most_px / least_px) / std::log(kSizeStep))) + 1;
        const double largest = least_px * std::pow(kSizeStep, sizes_ - 1);
        const int half = static_cast<int>(std::ceil(largest)) + 1;
        const Strip strip(ridges, foot, line.along(), line.normal(), first - half, places + 2 * half, half);
        scores_.resize(static_cast<std::size_t>(sizes_ * kRatios) * static_cast<std::size_t>(places));
        std::vector<std::uint16_t> sums(static_cast<std::size_t>(places));
        std::array<double, kAround> sines{}, cosines{};
        for (std::size_t i = 0; i < kAround; ++i) {
            sines[i] = std::sin(2 * std::numbers::pi * (static_cast<double>(i) + 0.5) / kAround);
            cosines[i] = std::cos(2 * std::numbers::pi * (static_cast<double>(i) + 0.5) / kAround);
        }
        for (int size = 0; size < sizes_; ++size) {
            const double a = least_px * std::pow(kSizeStep, size);
            for (int ratio = 0; ratio < kRatios; ++ratio) {
                const double b = a * ratio * kRatioStep;
                std::fill(sums.begin(), sums.end(), std::uint16_t{0});
                int samples = 0;
                for (int i = 0; i < kAround; ++i) {
                    const double sine = sines[static_cast<std::size_t>(i)],
                                 cosine = cosines[static_cast<std::size_t>(i)];
                    const double across = -a * sine, along = b * cosine;
                    if (across * across + along * along < kLeastSpeed * kLeastSpeed * a * a) continue;
                    const Vector2 tangent = across * line.normal() + along * line.along();
                    const std::uint8_t* in =
                        strip.row(directionOf(tangent.x(), tangent.y()), static_cast<int>(std::lround(a * cosine))) +
                        half + std::lround(b * sine);
                    for (int s = 0; s < places; ++s)
                        sums[static_cast<std::size_t>(s)] =
                            static_cast<std::uint16_t>(sums[static_cast<std::size_t>(s)] + in[s]);
                    ++samples;
                }
                std::int16_t* out = scores_.data() + index(size, ratio);
                for (int s = 0; s < places; ++s)
                    out[s] = static_cast<std::int16_t>(sums[static_cast<std::size_t>(s)] / samples - kChance);
            }
        }
    }

    int sizeIndex(double a) const {
        return std::clamp(static_cast<int>(std::lround(std::log(a / least_) / std::log(kSizeStep))), 0, sizes_ - 1);
    }
    const std::int16_t* row(int size, int ratio) const { return scores_.data() + index(size, ratio); }
    int first() const { return first_; }
    int places() const { return places_; }

  private:
    std::size_t index(int size, int ratio) const {
        return static_cast<std::size_t>(size * kRatios + ratio) * static_cast<std::size_t>(places_);
    }
    int first_, places_;
    double least_;
    int sizes_ = 0;
    std::vector<std::int16_t> scores_;
};

// Adds what a ring is worth to the scores of all places of the pattern, which it follows as gain * place + shift.
void addRing(const EllipseScores& ellipses, int size, double gain, double shift, double along, double away,
             double foot_px, std::vector<int>& scores) {
    constexpr int kBlock = 16;  // places within which the ellipse's flatness stays
    const int steps = static_cast<int>(scores.size()), first = ellipses.first(), places = ellipses.places();
    const int step = static_cast<int>(gain * kPlaceStepPx * 65536);  // 16 bits after the point
    for (int begin = 0; begin < steps; begin += kBlock) {
        const double start = gain * (first + begin * kPlaceStepPx) + shift - first + 0.5;
        const double stop = start + gain * kPlaceStepPx * kBlock;
        if (!(stop >= 1 && start <= places - 1)) continue;
        const double middle = 0.5 * (start + stop) + first;
        const double cosine =
            std::abs(along * middle + away * foot_px) / std::sqrt(middle * middle + foot_px * foot_px);
        const std::int16_t* row =
            ellipses.row(size, std::min(static_cast<int>(cosine / kRatioStep + 0.5), kRatios - 1));
        const int end = std::min(begin + kBlock, steps);
        int at = static_cast<int>(std::floor(start * 65536));
        int* out = scores.data();
        if (start >= 0 && stop < places) {
            for (int i = begin; i < end; ++i, at += step)
                out[i] += row[at >> 16];
            continue;
        }
        for (int i = begin; i < end; ++i, at += step) {
            const int place = at >> 16;
            if (place >= 0 && place < places) out[i] += row[place];
        }
    }
}

struct Guess {
    int score = 0;  // kFull per ring
    int depth = 0, roll = 0, place = 0, sense = 0;
};

}  // namespace

std::vector<AxisGuess> ringPatterns(const RidgeMap& ridges, const CArm& ideal, const CorkscrewLayout& layout,
                                    const ImageLine& line, const CorkscrewDetectionOptions& options, int most) {
    const double focal_px = ideal.focal_length_mm / ideal.pixel_mm.x();
    const double foot_px = std::hypot(focal_px, line.offset_px);  // f'
    const Vector2 foot = ideal.principal_point_px + line.offset_px * line.normal();

    // The part of the line inside the image, from the foot.
    double low = -1e9, high = 1e9;
    for (int axis = 0; axis < 2; ++axis) {
        const double size = axis == 0 ? ideal.columns : ideal.rows, step = line.along()(axis);
        if (std::abs(step) < 1e-9) continue;
        const double one = (-0.5 - foot(axis)) / step, two = (size - 0.5 - foot(axis)) / step;
        low = std::max(low, std::min(one, two));
        high = std::min(high, std::max(one, two));
    }
    if (!(high - low > 16)) return {};

    double least_radius = 1e9, most_radius = 0, reach_mm = 0;
    for (const CorkscrewRing& ring : layout.rings) {
        least_radius = std::min(least_radius, ring.radius_mm);
        most_radius = std::max(most_radius, ring.radius_mm);
        reach_mm = std::max(reach_mm, std::abs(ring.x_mm));
    }
    const double near_mm = std::max(options.least_depth * ideal.focal_length_mm, 1.0),
                 far_mm = options.most_depth * ideal.focal_length_mm;
    const double nearest_mm = std::max(near_mm - reach_mm * std::sin(options.steepest_rad), 0.5 * near_mm);
    const int first = static_cast<int>(low) - kBeyondPx, places = static_cast<int>(high - low) + 2 * kBeyondPx;
    const double largest_px = std::min(most_radius * foot_px / nearest_mm, 200.0);
    const double smallest_px = std::max(least_radius * foot_px / (far_mm + reach_mm), 3.0);
    if (!(largest_px > smallest_px)) return {};
    const EllipseScores ellipses(ridges, foot, line, smallest_px, largest_px, first, places);

    const int depths = static_cast<int>(std::ceil(std::log(far_mm / near_mm) / std::log(kDepthStep))) + 1;
    const int rolls = 2 * static_cast<int>(std::ceil(options.steepest_rad / kRollStep)) + 1;
    const int steps = places / kPlaceStepPx;
    const int place_bins = (steps - 1) / kPlacesPerBin + 1;
    std::vector<Guess> best(static_cast<std::size_t>(2 * kDepthBins * kRollBins * place_bins));
    std::vector<int> scores(static_cast<std::size_t>(steps));
    for (int d = 0; d < depths; ++d) {
        const double depth = near_mm * std::pow(kDepthStep, d);
        for (int r = 0; r < rolls; ++r) {
            const double roll = (r - rolls / 2) * kRollStep, along = std::cos(roll), away = std::sin(roll);
            for (int sense = 0; sense < 2; ++sense) {
                std::fill(scores.begin(), scores.end(), 0);
                for (const CorkscrewRing& ring : layout.rings) {
                    const double x = sense == 1 ? ring.x_mm : -ring.x_mm;
                    const double ring_depth = depth + x * away;
                    if (!(ring_depth > 0.2 * depth)) continue;
                    const double gain = depth / ring_depth, shift = foot_px * x * along / ring_depth;
                    addRing(ellipses, ellipses.sizeIndex(ring.radius_mm * foot_px / ring_depth), gain, shift, along,
                            away, foot_px, scores);
                }
                Guess* kept =
                    best.data() +
                    ((sense * kDepthBins + d * kDepthBins / depths) * kRollBins + r * kRollBins / rolls) * place_bins;
                for (int i = 0; i < steps; ++i) {
                    if (scores[static_cast<std::size_t>(i)] > kept[i / kPlacesPerBin].score)
                        kept[i / kPlacesPerBin] = {scores[static_cast<std::size_t>(i)], d, r, i, sense};
                }
            }
        }
    }
    std::stable_sort(best.begin(), best.end(), [](const Guess& a, const Guess& b) { return a.score > b.score; });

    const Vector3 along(line.along().x(), line.along().y(), 0);
    const Vector3 away =
        Vector3(line.offset_px * line.normal().x(), line.offset_px * line.normal().y(), focal_px) / foot_px;
    std::vector<Guess> chosen;
    std::vector<AxisGuess> guesses;
    for (const Guess& guess : best) {
        if (guess.score <= 0 || static_cast<int>(guesses.size()) >= most) break;
        const bool known = std::any_of(chosen.begin(), chosen.end(), [&](const Guess& other) {
            return other.sense == guess.sense && std::abs(other.place - guess.place) <= 1 &&
                   std::abs(other.roll - guess.roll) <= 1 && std::abs(other.depth - guess.depth) <= 1;
        });
        if (known) continue;
        chosen.push_back(guess);
        const double roll = (guess.roll - rolls / 2) * kRollStep, depth = near_mm * std::pow(kDepthStep, guess.depth);
        const double place = first + guess.place * kPlaceStepPx;
        const Vector3 axis = (guess.sense == 1 ? 1 : -1) * (std::cos(roll) * along + std::sin(roll) * away);
        const Vector3 middle = depth * (place / foot_px * along + away);
        const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(Vector3::UnitX(), axis);
        guesses.push_back({Rigid3(turn, middle), static_cast<double>(guess.score) / kFull});
    }
    return guesses;
}

}  // namespace fluorocut::corkscrew
