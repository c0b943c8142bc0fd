#include "core/distortion/groove_image.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "core/base/parallel.h"
#include "core/image/blur.h"

namespace fluorocut::grooves {
namespace {

constexpr std::size_t kRowsPerPiece = 16;
constexpr double kDarkShare = 0.03;     // of the range between dark and bright: below it a pixel counts as dark
constexpr double kDarkSurround = 0.3;   // an image whose darkest part is brighter than this share has no dark part
constexpr float kMinCounted = 0.01f;    // of a Gaussian's weight: less holds no mean
constexpr int kHighPasses = 2;          // in which what stands out is left out of the mean
constexpr double kPlateauShare = 2e-4;  // of the pixels at the largest value: more is saturation

struct Levels {
    float low = 0, high = 0, least = 0, most = 0;
    bool saturated = false;
    std::size_t finite = 0;
};

float percentile(std::vector<float>& values, double share) {
    const auto place = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), place, values.end());
    return *place;
}

Levels levelsOf(const Image& image) {
    Levels levels;
    std::vector<float> finite;
    finite.reserve(image.size() / 5 + 1);
    const std::size_t step = std::max<std::size_t>(1, image.size() / 50021);
    for (std::size_t n = 0; n < image.size(); n += step)
        if (std::isfinite(image.pixels()[n])) finite.push_back(image.pixels()[n]);
    levels.finite = finite.size();
    if (finite.empty()) return levels;
    levels.low = percentile(finite, 0.005);  // dead pixels are fewer
    levels.high = percentile(finite, 0.95);
    // Saturated values pile up at the top; an unsaturated histogram thins out there.
    float most = -INFINITY, next = -INFINITY, least = INFINITY;
    std::size_t at_most = 0, at_next = 0;
    for (const float value : image.pixels()) {
        if (!std::isfinite(value)) continue;
        least = std::min(least, value);
        if (value > most) {
            next = std::exchange(most, value);
            at_next = std::exchange(at_most, 1);
        } else if (value == most) {
            ++at_most;
        } else if (value > next) {
            next = value;
            at_next = 1;
        } else if (value == next) {
            ++at_next;
        }
    }
    levels.least = least;
    levels.most = most;
    levels.saturated =
        static_cast<double>(at_most) > kPlateauShare * static_cast<double>(image.size()) && at_most > 2 * at_next;
    return levels;
}

// Dark pixels that hang together with the image's border lie outside the field.
void floodOutside(BasicImage<Seen>& seen, const Mask& dark) {
    std::vector<std::pair<int, int>> open;
    const auto visit = [&](int x, int y) {
        if (x < 0 || y < 0 || x >= seen.width() || y >= seen.height() || !dark(x, y) || seen(x, y) == Seen::outside)
            return;
        seen(x, y) = Seen::outside;
        open.emplace_back(x, y);
    };
    for (int x = 0; x < seen.width(); ++x) {
        visit(x, 0);
        visit(x, seen.height() - 1);
    }
    for (int y = 0; y < seen.height(); ++y) {
        visit(0, y);
        visit(seen.width() - 1, y);
    }
    while (!open.empty()) {
        const auto [x, y] = open.back();
        open.pop_back();
        visit(x - 1, y);
        visit(x + 1, y);
        visit(x, y - 1);
        visit(x, y + 1);
    }
}

int coarseFactor(int width, int height, double min_pitch_px) {
    int factor = 1;
    while (std::max(width, height) / factor > 640 && min_pitch_px / (2 * factor) >= 4)
        factor *= 2;
    return factor;
}

}  // namespace

Result<PreparedImage> prepare(const Image& image, double min_pitch_px) {
    const int width = image.width(), height = image.height();
    const Levels levels = levelsOf(image);
    if (levels.finite == 0 || !(levels.high > levels.low)) {
        return noSolution("groove detection",
                          levels.finite == 0 ? std::string("an image without any finite pixel")
                                             : fmt::format("an image that is {} nearly everywhere", levels.low),
                          "an X-ray image of a grooved plate", "Check which image was given and that the beam was on");
    }
    const bool has_dark = levels.low < kDarkSurround * levels.high;
    const float threshold =
        has_dark ? levels.low + static_cast<float>(kDarkShare) * (levels.high - levels.low) : -INFINITY;

    PreparedImage prepared;
    prepared.seen = BasicImage<Seen>(width, height, Seen::lit);
    Mask dark(width, height);
    double dark_sum = 0;
    std::size_t dark_count = 0;
    for (std::size_t n = 0; n < image.size(); ++n) {
        const float value = image.pixels()[n];
        if (std::isfinite(value) && value >= threshold && !(levels.saturated && value == levels.most)) continue;
        prepared.seen.pixels()[n] = Seen::unreadable;
        if (!std::isfinite(value) || value < threshold) dark.pixels()[n] = 1;
        if (std::isfinite(value) && value < threshold) {
            dark_sum += static_cast<double>(value);
            ++dark_count;
        }
    }
    if (has_dark) floodOutside(prepared.seen, dark);

    // A large dark part shows what the detector reads without light.
    double base = dark_count * 33 > image.size() ? dark_sum / static_cast<double>(dark_count) : 0;
    const float least_lit = has_dark ? threshold : levels.least;
    base = std::min(base, static_cast<double>(least_lit) - 1e-3 * static_cast<double>(levels.high - levels.low));
    if (base > 0 && dark_count * 33 <= image.size()) base = 0;

    prepared.factor = coarseFactor(width, height, min_pitch_px);
    const int factor = prepared.factor;
    prepared.log = Image(width, height);
    prepared.coarse = Image(width / factor, height / factor);
    prepared.coarse_lit = prepared.coarse;
    std::vector<std::size_t> lit_in_row(static_cast<std::size_t>(height));
    parallelFor(static_cast<std::size_t>(height), kRowsPerPiece, [&](std::size_t begin, std::size_t end) {
        for (std::size_t row = begin; row < end; ++row) {
            const int y = static_cast<int>(row);
            for (int x = 0; x < width; ++x) {
                if (prepared.seen(x, y) != Seen::lit) continue;
                prepared.log(x, y) = std::log(image(x, y) - static_cast<float>(base));
                ++lit_in_row[row];
            }
        }
    });
    std::size_t lit = 0;
    for (const std::size_t count : lit_in_row)
        lit += count;
    prepared.lit_share = static_cast<double>(lit) / static_cast<double>(image.size());

    parallelFor(static_cast<std::size_t>(prepared.coarse.height()), kRowsPerPiece,
                [&](std::size_t begin, std::size_t end) {
                    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
                        for (int x = 0; x < prepared.coarse.width(); ++x) {
                            float sum = 0;
                            int count = 0;
                            for (int b = 0; b < factor; ++b) {
                                for (int a = 0; a < factor; ++a) {
                                    const int u = x * factor + a, v = y * factor + b;
                                    if (prepared.seen(u, v) != Seen::lit) continue;
                                    sum += image(u, v) - static_cast<float>(base);
                                    ++count;
                                }
                            }
                            if (count == 0) continue;
                            prepared.coarse(x, y) = std::log(sum / static_cast<float>(count));
                            prepared.coarse_lit(x, y) = static_cast<float>(count) / static_cast<float>(factor * factor);
                        }
                    }
                });
    return prepared;
}

Image highPassed(const PreparedImage& image, double sigma_coarse_px, double limit) {
    // Metal would drag the mean down around it, and what it leaves beside it is stronger than grooves. So what lies far
    // from the mean does not count in the next mean: first what is darker, then what still stands out either way.
    Image counted = image.coarse_lit;
    Image high(image.coarse.width(), image.coarse.height());
    std::vector<float> magnitudes;
    for (int pass = 0;; ++pass) {
        Image counted_log = image.coarse;
        for (std::size_t n = 0; n < counted_log.size(); ++n)
            counted_log.pixels()[n] *= counted.pixels()[n];
        const Image mean = gaussianBlurred(counted_log, sigma_coarse_px);
        const Image weight = gaussianBlurred(counted, sigma_coarse_px);
        magnitudes.clear();
        for (std::size_t n = 0; n < high.size(); ++n) {
            high.pixels()[n] = 0;
            if (image.coarse_lit.pixels()[n] < 0.5f || weight.pixels()[n] <= kMinCounted) continue;
            high.pixels()[n] = image.coarse.pixels()[n] - mean.pixels()[n] / weight.pixels()[n];
            if (n % 11 == 0) magnitudes.push_back(std::abs(high.pixels()[n]));
        }
        if (magnitudes.empty()) return high;
        const float largest = static_cast<float>(limit * 1.4826) * percentile(magnitudes, 0.5);
        if (pass == kHighPasses) {
            for (float& value : high.pixels())
                if (std::abs(value) > largest) value = 0;
            return high;
        }
        const float brightest = pass == 0 ? INFINITY : largest;
        for (std::size_t n = 0; n < high.size(); ++n) {
            const float value = high.pixels()[n];
            counted.pixels()[n] = value < -largest || value > brightest ? 0 : image.coarse_lit.pixels()[n];
        }
    }
}

}  // namespace fluorocut::grooves
