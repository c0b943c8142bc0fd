#include "core/fiducial/corkscrew_refinement/image_noise.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/base/median.h"

namespace fluorocut::corkscrew {
namespace {

constexpr int kRowStep = 12, kGroups = 6;

struct Difference {
    float level, far, near;  // squares of second differences of the image, divided by what white noise makes of them
};

double varianceOf(std::vector<float> squares) {
    return median(std::move(squares)) / 0.4549;  // median of chi-squared with one degree of freedom
}

}  // namespace

ImageNoise noiseOf(const Image& image) {
    std::vector<Difference> differences;
    for (int y = kRowStep / 2; y < image.height(); y += kRowStep) {
        const float* row = image.row(y);
        for (int x = 3; x + 3 < image.width(); ++x) {
            const float level = (row[x - 3] + row[x] + row[x + 3]) / 3;
            if (!(row[x - 3] > 0 && row[x] > 0 && row[x + 3] > 0)) continue;
            const float far = row[x - 3] - 2 * row[x] + row[x + 3], near = row[x - 1] - 2 * row[x] + row[x + 1];
            differences.push_back({level, far * far / 6, near * near / 6});
        }
    }
    if (differences.size() < 100 * kGroups) return {};
    // Groups of like brightness: variance of the level against the level is a straight line, a level + b.
    const std::size_t size = differences.size() / kGroups;
    std::vector<double> levels, variances, alike;
    auto begin = differences.begin();
    for (int g = 0; g < kGroups; ++g) {
        const auto end = begin + static_cast<std::ptrdiff_t>(size);
        if (end < differences.end())
            std::nth_element(begin, end, differences.end(),
                             [](const Difference& p, const Difference& q) { return p.level < q.level; });
        std::vector<float> level, far, near;
        for (auto at = begin; at != end; ++at) {
            level.push_back(at->level);
            far.push_back(at->far);
            near.push_back(at->near);
        }
        levels.push_back(median(std::move(level)));
        variances.push_back(varianceOf(std::move(far)));
        alike.push_back(varianceOf(std::move(near)) / variances.back());
        begin = end;
    }
    // Weighted by 1 / variance^2 (its own error is in proportion to it); both terms at least zero.
    double s = 0, sx = 0, sxx = 0, sy = 0, sxy = 0;
    for (std::size_t g = 0; g < levels.size(); ++g) {
        if (!(variances[g] > 0)) continue;
        const double w = 1 / (variances[g] * variances[g]);
        s += w;
        sx += w * levels[g];
        sxx += w * levels[g] * levels[g];
        sy += w * variances[g];
        sxy += w * levels[g] * variances[g];
    }
    if (!(s > 0)) return {};
    ImageNoise noise;
    noise.a = (s * sxy - sx * sy) / (s * sxx - sx * sx);
    noise.b = (sy - noise.a * sx) / s;
    if (!(noise.b >= 0)) {
        noise.b = 0;
        noise.a = sxy / sxx;
    } else if (!(noise.a > 0)) {
        noise.a = 1e-3 * sy / sx;
        noise.b = sy / s;
    }
    // Neighbours correlated as exp(-d^2 / (4 s^2)): what that leaves of differences between neighbours.
    const double ratio = std::clamp(median(std::move(alike)), 0.0, 1.0);
    double spread = 0.05;
    const auto leaves = [](double sigma) {
        const double one = std::exp(-0.25 / (sigma * sigma)), two = std::pow(one, 4);
        return (6 - 8 * one + 2 * two) / 6;
    };
    while (spread < 2 && leaves(spread) > ratio)
        spread += 0.01;
    noise.alike_px = std::max(1.0, 4 * std::numbers::pi * spread * spread);
    return noise;
}

}  // namespace fluorocut::corkscrew
