#include "core/fiducial/detection/bead_candidates.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include "core/base/parallel.h"
#include "core/image/blur.h"

namespace fluorocut::detection {
namespace {

constexpr double kRadiusStep = 1.3;    // of the ladder
constexpr double kHalvingSigma = 4.0;  // an image this smooth keeps everything at every other pixel
constexpr float kFloor = 0.002F;       // of the 99th percentile

struct Level {
    Image image;
    int factor = 1;       // full-resolution pixels per pixel
    double sigma_px = 0;  // full resolution
};

Image halved(const Image& image) {
    Image half((image.width() + 1) / 2, (image.height() + 1) / 2);
    for (int y = 0; y < half.height(); ++y) {
        for (int x = 0; x < half.width(); ++x)
            half(x, y) = image(2 * x, 2 * y);
    }
    return half;
}

// s^2 times the smaller eigenvalue, negative where the surface is no bowl.
Image bowlStrength(const Level& level) {
    const Image& in = level.image;
    Image out(in.width(), in.height(), 0.0F);
    const double sigma = level.sigma_px / level.factor;
    const auto scale = static_cast<float>(sigma * sigma);
    parallelFor(static_cast<std::size_t>(std::max(0, in.height() - 2)), 32, [&](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin) + 1; y < static_cast<int>(end) + 1; ++y) {
            const float* above = in.row(y - 1);
            const float* here = in.row(y);
            const float* below = in.row(y + 1);
            float* result = out.row(y);
            for (int x = 1; x + 1 < in.width(); ++x) {
                const float xx = here[x + 1] - 2 * here[x] + here[x - 1];
                const float yy = below[x] - 2 * here[x] + above[x];
                const float xy = 0.25F * (below[x + 1] - below[x - 1] - above[x + 1] + above[x - 1]);
                const float half = 0.5F * (xx - yy);
                result[x] = scale * (0.5F * (xx + yy) - std::sqrt(half * half + xy * xy));
            }
        }
    });
    return out;
}

void collectMaxima(const Level& level, double least_response, std::vector<BeadCandidate>& found) {
    const Image strength = bowlStrength(level);
    for (int y = 1; y + 1 < strength.height(); ++y) {
        for (int x = 1; x + 1 < strength.width(); ++x) {
            const float value = strength(x, y);
            if (!(value >= least_response)) continue;
            bool highest = true;
            for (int dy = -1; dy <= 1 && highest; ++dy) {
                for (int dx = -1; dx <= 1; ++dx) {
                    const float other = strength(x + dx, y + dy);
                    // Of equal neighbours the first in reading order counts.
                    const bool before = dy < 0 || (dy == 0 && dx < 0);
                    if (other > value || (before && other == value)) highest = false;
                }
            }
            if (!highest) continue;
            const auto vertex = [&](float low, float high) {
                const double bend = low - 2.0 * value + high;
                return bend < 0 ? std::clamp(0.5 * (low - high) / bend, -0.5, 0.5) : 0.0;
            };
            const Vector2 place(x + vertex(strength(x - 1, y), strength(x + 1, y)),
                                y + vertex(strength(x, y - 1), strength(x, y + 1)));
            found.push_back({level.factor * place, std::numbers::sqrt2 * level.sigma_px, value});
        }
    }
}

}  // namespace

Image logIntensity(const Image& image) {
    std::vector<float> sample;
    const std::size_t stride = std::max<std::size_t>(1, image.size() / 100000);
    for (std::size_t i = 0; i < image.size(); i += stride)
        sample.push_back(image.pixels()[i]);
    const auto place = sample.begin() + static_cast<std::ptrdiff_t>(0.99 * static_cast<double>(sample.size() - 1));
    std::nth_element(sample.begin(), place, sample.end());
    const float floor = *place > 0 ? kFloor * *place : 1e-6F;
    Image result(image.width(), image.height());
    for (std::size_t i = 0; i < image.size(); ++i)
        result.pixels()[i] = std::log(std::max(image.pixels()[i], floor));
    return result;
}

std::vector<BeadCandidate> findBeadCandidates(const Image& log_intensity, const CandidateSearch& search) {
    std::vector<BeadCandidate> found;
    Level level{log_intensity, 1, 0};
    const double last = search.most_radius_px * std::sqrt(kRadiusStep);
    for (double radius = search.least_radius_px; radius < last; radius *= kRadiusStep) {
        const double sigma = radius / std::numbers::sqrt2;
        if (level.sigma_px / level.factor >= kHalvingSigma) {
            level.image = halved(level.image);
            level.factor *= 2;
        }
        const double more = std::sqrt(sigma * sigma - level.sigma_px * level.sigma_px) / level.factor;
        level.image = gaussianBlurred(level.image, more);
        level.sigma_px = sigma;
        if (level.image.width() < 3 || level.image.height() < 3) break;
        collectMaxima(level, search.least_response, found);
    }
    std::sort(found.begin(), found.end(), [](const BeadCandidate& a, const BeadCandidate& b) {
        return std::make_tuple(-a.response, a.center_px.y(), a.center_px.x()) <
               std::make_tuple(-b.response, b.center_px.y(), b.center_px.x());
    });
    std::vector<BeadCandidate> kept;
    for (const BeadCandidate& candidate : found) {
        // The same thing at another scale, or the rim of a stronger one; beads that touch are farther apart.
        const bool known = std::any_of(kept.begin(), kept.end(), [&](const BeadCandidate& other) {
            const double reach = candidate.radius_px < 2 * other.radius_px
                                     ? std::max(0.8 * candidate.radius_px, 1.2 * other.radius_px)
                                     : 1.2 * other.radius_px;
            return (candidate.center_px - other.center_px).squaredNorm() < reach * reach;
        });
        if (!known) kept.push_back(candidate);
        if (kept.size() >= search.most) break;
    }
    return kept;
}

}  // namespace fluorocut::detection
