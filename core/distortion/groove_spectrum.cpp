#include "core/distortion/groove_spectrum.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include <unsupported/Eigen/FFT>

#include "core/base/median.h"
#include "core/base/parallel.h"

namespace fluorocut::grooves {
namespace {

constexpr double kMinStrength = 3;       // peak power over the median of its ring
constexpr double kMaxLengthRatio = 1.2;  // between the two waves of a pair
constexpr double kMaxSkewRad = 0.17;     // from perpendicular
constexpr std::size_t kMaxPeaks = 60;
constexpr std::size_t kMaxPairs = 8;
constexpr float kMinLit = 0.45f;  // of a patch

struct Spectrum {
    int size = 0;                   // of the patches
    std::vector<float> power;       // size x size, frequency 0 at (0, 0)
    std::vector<float> background;  // by ring
    float at(int fx, int fy) const {
        const int x = (fx + size) % size, y = (fy + size) % size;
        return power[static_cast<std::size_t>(y * size + x)];
    }
};

// Power of one patch under a Hann window, scaled to unit total so that no single patch rules the mean.
bool addPatch(const Image& image, int left, int top, int size, std::vector<float>& power) {
    const auto n = static_cast<std::size_t>(size);
    std::vector<std::complex<float>> data(n * n), line(n), transformed(n);
    std::vector<float> window(n);
    for (std::size_t k = 0; k < n; ++k)
        window[k] = 0.5f - 0.5f * std::cos(2 * std::numbers::pi_v<float> * (static_cast<float>(k) + 0.5f) /
                                           static_cast<float>(size));
    double squares = 0;
    std::size_t lit = 0;
    Eigen::FFT<float> fft;
    for (int y = 0; y < size; ++y) {
        const int v = top + y;
        if (v >= image.height()) break;
        for (int x = 0; x < size; ++x) {
            const float value = left + x < image.width() ? image(left + x, v) : 0.0f;
            lit += value != 0;
            squares += static_cast<double>(value) * static_cast<double>(value);
            line[static_cast<std::size_t>(x)] =
                value * window[static_cast<std::size_t>(x)] * window[static_cast<std::size_t>(y)];
        }
        fft.fwd(transformed.data(), line.data(), size);
        std::copy(transformed.begin(), transformed.end(), data.begin() + y * size);
    }
    if (static_cast<float>(lit) < kMinLit * static_cast<float>(n * n) || !(squares > 0)) return false;
    const float scale = static_cast<float>(static_cast<double>(n * n) / squares);
    for (std::size_t x = 0; x <= n / 2; ++x) {  // the other half is its mirror image
        for (std::size_t y = 0; y < n; ++y)
            line[y] = data[y * n + x];
        fft.fwd(transformed.data(), line.data(), size);
        for (std::size_t y = 0; y < n; ++y) {
            const float p = std::norm(transformed[y]) * scale;
            power[y * n + x] += p;
            if (x > 0 && x < n / 2) power[(n - y) % n * n + (n - x)] += p;
        }
    }
    return true;
}

Spectrum averageSpectrum(const Image& image, int size) {
    Spectrum spectrum;
    spectrum.size = size;
    const auto starts = [size](int length) {
        std::vector<int> places;
        const int count = std::max(1, 2 * length / size - 1);
        for (int n = 0; n < count; ++n)
            places.push_back(count == 1 ? 0 : n * (length - size) / (count - 1));
        return places;
    };
    const std::vector<int> lefts = starts(image.width()), tops = starts(image.height());
    const auto bins = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);
    std::vector<std::vector<float>> rows(tops.size());  // summed in order afterwards: the same for any thread count
    parallelFor(tops.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n) {
            rows[n].assign(bins, 0.0f);
            for (const int left : lefts)
                addPatch(image, left, tops[n], size, rows[n]);
        }
    });
    spectrum.power.assign(bins, 0.0f);
    for (const auto& row : rows)
        for (std::size_t n = 0; n < bins; ++n)
            spectrum.power[n] += row[n];

    std::vector<std::vector<float>> rings(static_cast<std::size_t>(size));
    for (int fy = -size / 2; fy < size / 2; ++fy)
        for (int fx = 0; fx < size / 2; ++fx)
            rings[static_cast<std::size_t>(std::lround(std::hypot(fx, fy)))].push_back(spectrum.at(fx, fy));
    for (auto& ring : rings) {
        if (ring.empty()) break;
        spectrum.background.push_back(median(std::move(ring)));
    }
    return spectrum;
}

struct Peak {
    Vector2 wave = Vector2::Zero();  // cycles per pixel
    double strength = 0;
};

double subBin(double before, double at, double after) {
    const double a = std::log(before), b = std::log(at), c = std::log(after), curvature = a - 2 * b + c;
    return curvature < 0 ? std::clamp(0.5 * (a - c) / curvature, -0.5, 0.5) : 0;
}

std::vector<Peak> findPeaks(const Spectrum& spectrum, double min_period_px, double max_period_px) {
    const int size = spectrum.size, half = size / 2 - 1;
    const double least = std::max(1.8, 0.85 * size / max_period_px);
    const double most = std::min<double>(half - 1, 1.15 * size / min_period_px);
    std::vector<Peak> peaks;
    for (int fy = -half + 1; fy < half; ++fy) {
        for (int fx = 0; fx < half; ++fx) {
            if (fx == 0 && fy < 0) continue;
            const double length = std::hypot(fx, fy);
            if (length < least || length > most) continue;
            const float here = spectrum.at(fx, fy);
            bool highest = here > 0;
            for (int b = -1; b <= 1 && highest; ++b)
                for (int a = -1; a <= 1 && highest; ++a)
                    highest = (a == 0 && b == 0) || spectrum.at(fx + a, fy + b) <= here;
            if (!highest) continue;
            const auto ring = static_cast<std::size_t>(std::lround(length));
            const float background = spectrum.background[std::min(ring, spectrum.background.size() - 1)];
            const double strength = static_cast<double>(here) / std::max(1e-30, static_cast<double>(background));
            if (strength < kMinStrength) continue;
            const auto power = [&](int a, int b) {
                return std::max(1e-30, static_cast<double>(spectrum.at(fx + a, fy + b)));
            };
            peaks.push_back({Vector2(fx + subBin(power(-1, 0), power(0, 0), power(1, 0)),
                                     fy + subBin(power(0, -1), power(0, 0), power(0, 1))) /
                                 size,
                             strength});
        }
    }
    std::stable_sort(peaks.begin(), peaks.end(), [](const Peak& a, const Peak& b) { return a.strength > b.strength; });
    if (peaks.size() > kMaxPeaks) peaks.resize(kMaxPeaks);
    return peaks;
}

void addPairs(const std::vector<Peak>& peaks, std::vector<WavePair>& pairs) {
    for (std::size_t a = 0; a < peaks.size(); ++a) {
        for (std::size_t b = a + 1; b < peaks.size(); ++b) {
            const double la = peaks[a].wave.norm(), lb = peaks[b].wave.norm();
            if (std::max(la, lb) > kMaxLengthRatio * std::min(la, lb)) continue;
            if (std::abs(peaks[a].wave.dot(peaks[b].wave)) > std::sin(kMaxSkewRad) * la * lb) continue;
            pairs.push_back(oriented({peaks[a].wave, peaks[b].wave, std::min(peaks[a].strength, peaks[b].strength)}));
        }
    }
}

}  // namespace

WavePair oriented(WavePair pair) {
    if (std::abs(pair.first.x()) < std::abs(pair.second.x())) std::swap(pair.first, pair.second);
    if (pair.first.x() < 0) pair.first = -pair.first;
    if (pair.first.x() * pair.second.y() - pair.first.y() * pair.second.x() < 0) pair.second = -pair.second;
    return pair;
}

WaveSearch findWaves(const Image& image, int patch_px, double min_period_px, double max_period_px) {
    WaveSearch search;
    if (patch_px > 128 && patch_px > std::min(image.width(), image.height())) return search;
    const Spectrum spectrum = averageSpectrum(image, patch_px);
    const std::vector<Peak> peaks = findPeaks(spectrum, min_period_px, max_period_px);
    if (peaks.empty()) return search;
    search.strongest_single = peaks[0].strength;
    search.strongest = peaks[0].wave;
    addPairs(peaks, search.pairs);
    std::stable_sort(search.pairs.begin(), search.pairs.end(),
                     [](const WavePair& a, const WavePair& b) { return a.strength > b.strength; });
    if (search.pairs.size() > kMaxPairs) search.pairs.resize(kMaxPairs);
    return search;
}

}  // namespace fluorocut::grooves
