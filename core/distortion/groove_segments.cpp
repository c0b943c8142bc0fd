#include "core/distortion/groove_segments.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <tuple>

#include <Eigen/Cholesky>

#include "core/base/parallel.h"

namespace fluorocut::grooves {
namespace {

constexpr double kHalfWindow = 0.34;    // across the groove, pitches: wider holds more photons and more tissue
constexpr double kBlurMargin = 1.2;     // sigmas kept from the crossing grooves
constexpr double kMinHalfLength = 0.2;  // pitches
constexpr int kIterations = 3;
constexpr double kSmallStep = 0.003;  // pitches
constexpr double kMaxStep = 0.08;     // pitches, per iteration
constexpr double kMinSeen = 3;        // contrast over its standard deviation
constexpr std::size_t kSegmentsPerPiece = 16;

// Integral and value of the standard normal density, interpolated between tabulated places: error below 1e-6.
class Normal {
  public:
    Normal() {
        for (std::size_t n = 0; n < kCount; ++n) {
            const double z = kLow + static_cast<double>(n) / kPerUnit;
            integral_[n] = static_cast<float>(0.5 * std::erfc(-z / std::sqrt(2.0)));
            density_[n] = static_cast<float>(std::exp(-0.5 * z * z) / std::sqrt(2 * std::numbers::pi));
        }
    }
    void at(float z, float& integral, float& density) const {
        const float place = std::clamp((z - static_cast<float>(kLow)) * static_cast<float>(kPerUnit), 0.0f,
                                       static_cast<float>(kCount) - 1.001f);
        const auto n = static_cast<std::size_t>(place);
        const float t = place - static_cast<float>(n);
        integral = integral_[n] + t * (integral_[n + 1] - integral_[n]);
        density = density_[n] + t * (density_[n + 1] - density_[n]);
    }

  private:
    static constexpr double kLow = -5, kPerUnit = 200;
    static constexpr std::size_t kCount = 2001;
    std::array<float, kCount> integral_{}, density_{};
};

const Normal& normal() {
    static const Normal table;
    return table;
}

// f(d) of the header and its derivative.
class Profile {
  public:
    Profile(double half_width_px, double blur_px, double contrast)
        : half_width_(static_cast<float>(half_width_px)),
          inverse_blur_(static_cast<float>(1 / blur_px)),
          c_(static_cast<float>(std::expm1(contrast))),
          inverse_log_(static_cast<float>(1 / contrast)) {}

    void at(float d, float& value, float& slope) const {
        float right, right_density, left, left_density;
        normal().at((d + half_width_) * inverse_blur_, right, right_density);
        normal().at((d - half_width_) * inverse_blur_, left, left_density);
        const float box = right - left;
        value = std::log(1 + c_ * box) * inverse_log_;
        slope = c_ * (right_density - left_density) * inverse_blur_ / (1 + c_ * box) * inverse_log_;
    }

  private:
    float half_width_, inverse_blur_, c_, inverse_log_;
};

struct Sample {
    float d, s, value;  // px, px, log intensity
    bool follows;       // the pixel before it in its row is the sample before
};

struct Window {
    std::vector<Sample> samples;
    bool outside = false;  // touches what is not lit field
    int unreadable = 0;
};

Profile profileFor(const Segment& segment, const GrooveShape& shape) {
    return Profile(0.5 * shape.width * segment.pitch_px, shape.blur_px[static_cast<std::size_t>(segment.direction)],
                   shape.contrast);
}

// All pixels of the segment's window, with second-order lattice coordinates about its middle.
void collect(const PreparedImage& image, const LatticeMap& map, const GrooveShape& shape, const Segment& segment,
             Window& window) {
    window.samples.clear();
    window.outside = false;
    window.unreadable = 0;
    const LatticePlace place = map.place(segment.start);
    const auto across = static_cast<Eigen::Index>(segment.direction), along = 1 - across;
    const double pitch_across = 1 / place.jacobian.row(across).norm(),
                 pitch_along = 1 / place.jacobian.row(along).norm();
    const double half_across = kHalfWindow * pitch_across;
    const double blur = shape.blur_px[static_cast<std::size_t>(along)];
    const double half_along =
        std::max(kMinHalfLength, 0.5 - 0.5 * shape.width - kBlurMargin * blur / pitch_along) * pitch_along;
    const Eigen::Matrix2d back = place.jacobian.inverse();
    // Bounding box of the window, which is a parallelogram to first order.
    const Vector2 reach = back.col(across).cwiseAbs() * half_across / pitch_across +
                          back.col(along).cwiseAbs() * half_along / pitch_along + Vector2::Constant(0.5);
    const int left = static_cast<int>(std::floor(segment.start.x() - reach.x()));
    const int right = static_cast<int>(std::ceil(segment.start.x() + reach.x()));
    const int top = static_cast<int>(std::floor(segment.start.y() - reach.y()));
    const int bottom = static_cast<int>(std::ceil(segment.start.y() + reach.y()));
    const Vector2 middle = segment.lattice();
    const Vector2 gd = place.jacobian.row(across).transpose() * pitch_across;
    const Vector2 gs = place.jacobian.row(along).transpose() * pitch_along;
    const Eigen::Matrix2d hd = 0.5 * pitch_across * place.hessian[static_cast<std::size_t>(across)];
    const Eigen::Matrix2d hs = 0.5 * pitch_along * place.hessian[static_cast<std::size_t>(along)];
    const double d0 = (place.lattice[across] - middle[across]) * pitch_across;
    const double s0 = (place.lattice[along] - middle[along]) * pitch_along;
    for (int v = top; v <= bottom; ++v) {
        const double y = v - segment.start.y();
        bool follows = false;
        for (int u = left; u <= right; ++u) {
            const double x = u - segment.start.x();
            const double d = d0 + gd.x() * x + gd.y() * y + hd(0, 0) * x * x + 2 * hd(0, 1) * x * y + hd(1, 1) * y * y;
            const double s = s0 + gs.x() * x + gs.y() * y + hs(0, 0) * x * x + 2 * hs(0, 1) * x * y + hs(1, 1) * y * y;
            if (std::abs(d) > half_across || std::abs(s) > half_along) {
                follows = false;
                continue;
            }
            if (u < 0 || v < 0 || u >= image.log.width() || v >= image.log.height() ||
                image.seen(u, v) == Seen::outside) {
                window.outside = true;
                return;
            }
            if (image.seen(u, v) == Seen::unreadable) {
                ++window.unreadable;
                follows = false;
                continue;
            }
            window.samples.push_back({static_cast<float>(d), static_cast<float>(s), image.log(u, v), follows});
            follows = true;
        }
    }
}

using Normals = Eigen::Matrix<double, 6, 6>;
using Column = Eigen::Matrix<double, 6, 1>;

void measure(const Window& window, const Profile& profile, Segment& segment) {
    const double half_across = kHalfWindow * segment.pitch_px;
    const auto scale = static_cast<float>(1 / half_across);
    float level = 0;
    for (const Sample& sample : window.samples)
        level += sample.value;
    level /= static_cast<float>(window.samples.size());

    Normals inverse;
    Column solution = Column::Zero();
    double shift = 0;
    for (int iteration = 0; iteration < kIterations; ++iteration) {
        std::array<double, 27> sums{};  // lower triangle, then the right side
        for (const Sample& sample : window.samples) {
            std::array<float, 6> row;
            float slope;
            profile.at(sample.d - static_cast<float>(shift), row[0], slope);
            row[1] = -slope;
            row[2] = 1;
            row[3] = sample.d * scale;
            row[4] = sample.s * scale;
            row[5] = row[3] * row[3];
            std::size_t n = 0;
            for (std::size_t a = 0; a < 6; ++a)
                for (std::size_t b = 0; b <= a; ++b)
                    sums[n++] += static_cast<double>(row[a] * row[b]);
            for (std::size_t a = 0; a < 6; ++a)
                sums[n++] += static_cast<double>(row[a] * (sample.value - level));
        }
        Normals matrix;
        std::size_t n = 0;
        for (Eigen::Index a = 0; a < 6; ++a)
            for (Eigen::Index b = 0; b <= a; ++b)
                matrix(a, b) = matrix(b, a) = sums[n++];
        Column right;
        for (Eigen::Index a = 0; a < 6; ++a)
            right[a] = sums[n++];
        const Eigen::LLT<Normals> solver(matrix);
        if (solver.info() != Eigen::Success) {
            segment.state = SegmentState::hidden;
            return;
        }
        solution = solver.solve(right);
        inverse = solver.solve(Normals::Identity());
        if (!(solution[0] > 0)) break;
        const double limit = kMaxStep * segment.pitch_px;
        const double step = std::clamp(solution[1] / solution[0], -limit, limit);
        solution[1] = step * solution[0];
        // The step that is left is linear: it counts, but needs no further round.
        if (iteration + 1 == kIterations || std::abs(step) < kSmallStep * segment.pitch_px) break;
        shift += step;
    }
    double squares = 0, difference_squares = 0, before = 0;
    int differences = 0;
    for (const Sample& sample : window.samples) {
        float value, slope;
        profile.at(sample.d - static_cast<float>(shift), value, slope);
        const float d = sample.d * scale;
        const double fitted = solution[0] * static_cast<double>(value) - solution[1] * static_cast<double>(slope) +
                              solution[2] + solution[3] * static_cast<double>(d) +
                              solution[4] * static_cast<double>(sample.s * scale) +
                              solution[5] * static_cast<double>(d * d);
        const double residual = static_cast<double>(sample.value - level) - fitted;
        squares += residual * residual;
        if (sample.follows) {
            difference_squares += (residual - before) * (residual - before);
            ++differences;
        }
        before = residual;
    }
    const double variance = squares / static_cast<double>(window.samples.size() - 6);
    segment.noise = std::sqrt(variance);
    segment.contrast = solution[0];
    segment.contrast_sigma = std::sqrt(variance * inverse(0, 0));
    segment.roughness =
        differences > 0 && difference_squares > 0 ? std::sqrt(2 * variance * differences / difference_squares) : 1;
    if (!(segment.contrast > kMinSeen * segment.contrast_sigma)) {
        segment.state = SegmentState::hidden;
        return;
    }
    segment.shift_px = shift + solution[1] / solution[0];
    segment.fit_sigma_px = segment.sigma_px = std::sqrt(variance * inverse(1, 1)) / solution[0];
    segment.seen = true;
    segment.state = SegmentState::found;
}

}  // namespace

std::vector<Segment> segmentsNear(const LatticeMap& map, const std::vector<Vector2>& seeds, int width, int height) {
    std::vector<Segment> segments;
    std::set<std::tuple<int, int, int>> known;
    for (const Vector2& seed : seeds) {
        const Vector2 at = map.at(seed);
        for (int direction = 0; direction < 2; ++direction) {
            Segment segment;
            segment.direction = direction;
            segment.index = static_cast<int>(std::lround(at[direction]));
            segment.between = static_cast<int>(std::floor(at[1 - direction]));
            if (!known.insert({direction, segment.index, segment.between}).second) continue;
            const std::optional<Vector2> start = map.pixelOf(segment.lattice(), seed);
            if (!start || !(start->x() > 0 && start->y() > 0 && start->x() < width - 1 && start->y() < height - 1))
                continue;
            segment.start = *start;
            const Vector2 gradient = map.place(*start).jacobian.row(direction).transpose();
            segment.pitch_px = 1 / gradient.norm();
            segment.across = gradient.normalized();
            segments.push_back(segment);
        }
    }
    return segments;
}

void measureSegments(const PreparedImage& image, const LatticeMap& map, const GrooveShape& shape,
                     std::vector<Segment>& segments, std::size_t first) {
    parallelFor(segments.size() - first, kSegmentsPerPiece, [&](std::size_t begin, std::size_t end) {
        Window window;
        for (std::size_t n = begin; n < end; ++n) {
            Segment& segment = segments[first + n];
            segment.seen = false;
            collect(image, map, shape, segment, window);
            if (window.outside) {
                segment.state = SegmentState::outside;
            } else if (window.samples.size() < 24 || window.unreadable * 20 > static_cast<int>(window.samples.size())) {
                segment.state = SegmentState::hidden;
            } else {
                measure(window, profileFor(segment, shape), segment);
            }
        }
    });
}

std::array<double, 2> findBlur(const PreparedImage& image, const LatticeMap& map, const GrooveShape& shape,
                               const std::vector<Segment>& segments) {
    // Average profile in bins of d / pitch, both sides folded together; each segment's level is that of its middle and
    // the places farthest from it.
    constexpr std::size_t kBins = 64, kMaxSegments = 200;
    std::array<double, 2> blur = shape.blur_px;
    for (int direction = 0; direction < 2; ++direction) {
        std::vector<const Segment*> found;
        for (const Segment& segment : segments)
            if (segment.direction == direction && segment.state == SegmentState::found) found.push_back(&segment);
        if (found.size() < 10) continue;
        std::array<double, kBins> sums{}, counts{};
        double pitch = 0, used = 0;
        Window window;
        const std::size_t step = (found.size() + kMaxSegments - 1) / kMaxSegments;
        for (std::size_t n = 0; n < found.size(); n += step) {
            collect(image, map, shape, *found[n], window);
            if (window.outside || window.samples.empty()) continue;
            double mean = 0;
            for (const Sample& sample : window.samples)
                mean += static_cast<double>(sample.value);
            mean /= static_cast<double>(window.samples.size());
            for (const Sample& sample : window.samples) {
                const double d = std::abs(static_cast<double>(sample.d) - found[n]->shift_px) / found[n]->pitch_px;
                const auto bin = static_cast<std::size_t>(d / kHalfWindow * kBins);
                if (bin >= kBins) continue;
                sums[bin] += static_cast<double>(sample.value) - mean;
                counts[bin] += 1;
            }
            pitch += found[n]->pitch_px;
            used += 1;
        }
        if (used == 0) continue;
        pitch /= used;
        double best = std::numeric_limits<double>::infinity();
        // Steps of 4 %, down to what a pixel's own width leaves of a sharp edge.
        for (double sigma = 0.3; sigma < 0.3 * pitch; sigma *= 1.04) {
            const Profile profile(0.5 * shape.width * pitch, sigma, shape.contrast);
            Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
            Eigen::Vector3d right = Eigen::Vector3d::Zero();
            double squares = 0;
            for (std::size_t bin = 0; bin < kBins; ++bin) {
                if (counts[bin] == 0) continue;
                const double d = (static_cast<double>(bin) + 0.5) / kBins * kHalfWindow * pitch;
                float value, slope;
                profile.at(static_cast<float>(d), value, slope);
                const Eigen::Vector3d row(static_cast<double>(value), 1, d * d / (pitch * pitch));
                const double mean = sums[bin] / counts[bin];
                matrix += counts[bin] * row * row.transpose();
                right += counts[bin] * mean * row;
                squares += counts[bin] * mean * mean;
            }
            const double left_over = squares - right.dot(matrix.ldlt().solve(right));
            if (left_over < best) {
                best = left_over;
                blur[static_cast<std::size_t>(direction)] = sigma;
            }
        }
    }
    return blur;
}

}  // namespace fluorocut::grooves
