#include "core/imaging/xray_physics.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/image/blur.h"

namespace fluorocut {
namespace {

constexpr std::size_t kRowsPerPiece = 8;
constexpr int kLargestKernel = 63;

void forRows(int rows, const std::function<void(int)>& body) {
    parallelFor(static_cast<std::size_t>(rows), kRowsPerPiece, [&](std::size_t begin, std::size_t end) {
        for (std::size_t y = begin; y < end; ++y)
            body(static_cast<int>(y));
    });
}

// One random stream per row and purpose.
enum class Stream : std::uint64_t { quanta = 0, electronics = 1 };

Random rowStream(const Random& seeded, int y, Stream stream) {
    return seeded.fork(2 * static_cast<std::uint64_t>(y) + static_cast<std::uint64_t>(stream));
}

void addQuantumNoise(Image& expected, const Random& seeded) {
    forRows(expected.height(), [&](int y) {
        Random random = rowStream(seeded, y, Stream::quanta);
        float* row = expected.row(y);
        for (int x = 0; x < expected.width(); ++x)
            row[x] = static_cast<float>(random.poisson(std::max(0.0f, row[x])));
    });
}

double meanOf(const Image& image) {
    double sum = 0;
    for (const float value : image.pixels())
        sum += value;
    return sum / static_cast<double>(image.size());
}

// The columns [begin, end) of a row that lie in the detector's field.
struct Columns {
    int begin, end;
};

Columns fieldColumns(const CArm& carm, const XrayOptions& options, int y) {
    if (!options.field_radius_mm) return {0, carm.columns};
    const double dy = (y - 0.5 * (carm.rows - 1)) * carm.pixel_mm.y();
    const double squared = *options.field_radius_mm * *options.field_radius_mm - dy * dy;
    if (!(squared >= 0)) return {0, 0};
    const double reach_px = std::sqrt(squared) / carm.pixel_mm.x(), middle = 0.5 * (carm.columns - 1);
    const double begin = std::max(0.0, std::ceil(middle - reach_px));
    const double end = std::min<double>(carm.columns, std::floor(middle + reach_px) + 1);
    return begin < end ? Columns{static_cast<int>(begin), static_cast<int>(end)} : Columns{0, 0};
}

double automaticGain(const Image& noise_free, const CArm& carm, const XrayOptions& options) {
    if (options.bits == 0) return 1;
    // Below a thousandth of the open beam there is lead, not anatomy: it does not drag the mean to nothing.
    const auto floor = static_cast<float>(1e-3 * options.photons_per_pixel);
    std::vector<double> rows(static_cast<std::size_t>(noise_free.height()));
    std::vector<int> pixels(rows.size());
    forRows(noise_free.height(), [&](int y) {
        const Columns field = fieldColumns(carm, options, y);
        double sum = 0;
        for (int x = field.begin; x < field.end; ++x)
            sum += std::log(std::max(floor, noise_free(x, y)));
        rows[static_cast<std::size_t>(y)] = sum;
        pixels[static_cast<std::size_t>(y)] = field.end - field.begin;
    });
    const double count = std::accumulate(pixels.begin(), pixels.end(), 0.0);
    const double mean_log = count > 0 ? std::accumulate(rows.begin(), rows.end(), 0.0) / count : std::log(floor);
    const double full_scale = std::ldexp(1.0, options.bits) - 1;
    return std::max(options.brightness * full_scale - options.offset, 1e-6 * full_scale) / std::exp(mean_log);
}

Result<void> validKernel(const char* field, const std::optional<Image>& kernel) {
    if (!kernel) return {};
    const int width = kernel->width(), height = kernel->height();
    if (width % 2 == 0 || height % 2 == 0 || width > kLargestKernel || height > kLargestKernel) {
        return invalidOption(field, fmt::format("{} x {} pixels", width, height),
                             fmt::format("odd sizes from 1 to {}", kLargestKernel));
    }
    double sum = 0;
    for (const float weight : kernel->pixels()) {
        if (!(weight >= 0 && std::isfinite(weight))) {
            return invalidOption(field, fmt::format("a weight of {}", weight), "finite weights of at least 0");
        }
        sum += weight;
    }
    if (!(sum > 0)) return invalidOption(field, "weights that are all 0", "a positive sum");
    return {};
}

}  // namespace

XrayOptions XrayOptions::ideal(double photons_per_pixel) {
    XrayOptions options;
    options.photons_per_pixel = photons_per_pixel;
    options.focal_spot_mm = 0;
    options.scatter_per_attenuation = 0;
    options.detector_blur_px = 0;
    options.glare_fraction = 0;
    options.quantum_noise = false;
    options.electronic_noise_photons = 0;
    options.gain = 1;
    options.bits = 0;
    return options;
}

Result<void> XrayOptions::validate() const {
    const auto ranges = requireRanges({
        {"photons_per_pixel", photons_per_pixel, 1e-3, 1e9, "photons"},
        {"focal_spot_mm", focal_spot_mm, 0, 10, "mm"},
        {"object_depth_mm", object_depth_mm, 1, 10000, "mm"},
        {"scatter_per_attenuation", scatter_per_attenuation, 0, 10, ""},
        {"scatter_sigma_mm", scatter_sigma_mm, 0, 1000, "mm"},
        {"field_radius_mm", field_radius_mm.value_or(1), 1e-3, 1e5, "mm"},
        {"detector_blur_px", detector_blur_px, 0, 100, "px"},
        {"glare_fraction", glare_fraction, 0, 1, ""},
        {"glare_sigma_mm", glare_sigma_mm, 0, 1000, "mm"},
        {"electronic_noise_photons", electronic_noise_photons, 0, 1e6, "photons"},
        {"gain", gain.value_or(1), 1e-9, 1e9, "levels per photon"},
        {"brightness", brightness, 0.001, 1, "of the full scale"},
        {"offset", offset, -65535, 65535, "levels"},
    });
    if (!ranges) return ranges;
    if (!(bits == 0 || (bits >= 8 && bits <= 16))) {
        return invalidOption("bits", fmt::format("{}", bits), "8 to 16, or 0 for real numbers");
    }
    if (auto ok = validKernel("focal_kernel", focal_kernel); !ok) return ok;
    return validKernel("detector_kernel", detector_kernel);
}

double penumbraSigmaPx(const CArm& carm, double focal_spot_mm, double object_depth_mm) {
    const double magnification = carm.focal_length_mm / object_depth_mm;
    return focal_spot_mm / std::sqrt(12.0) * (magnification - 1) / carm.pixel_mm.mean();
}

Image penumbraBlurred(const Image& beam, const CArm& carm, const XrayOptions& options) {
    if (options.focal_kernel) return convolved(beam, *options.focal_kernel);
    return gaussianBlurred(beam, penumbraSigmaPx(carm, options.focal_spot_mm, options.object_depth_mm));
}

Image expectedQuanta(const Image& line_integrals, const CArm& carm, const XrayOptions& options) {
    const int width = line_integrals.width(), height = line_integrals.height();
    const bool with_scatter = options.scatter_per_attenuation > 0;
    Image primary(width, height);
    Image scatter(with_scatter ? width : 0, with_scatter ? height : 0);
    const auto open_beam = static_cast<float>(options.photons_per_pixel);
    const auto scatter_factor = static_cast<float>(options.scatter_per_attenuation);
    forRows(height, [&](int y) {
        const float* in = line_integrals.row(y);
        float* out = primary.row(y);
        for (int x = 0; x < width; ++x)
            out[x] = open_beam * std::exp(-in[x]);
        if (!with_scatter) return;
        float* scattered = scatter.row(y);
        for (int x = 0; x < width; ++x)
            scattered[x] = scatter_factor * out[x] * std::max(0.0f, in[x]);
    });
    primary = penumbraBlurred(primary, carm, options);
    if (with_scatter) {
        scatter = gaussianBlurred(scatter, options.scatter_sigma_mm / carm.pixel_mm.mean());
        forRows(height, [&](int y) {
            for (int x = 0; x < width; ++x)
                primary(x, y) += scatter(x, y);
        });
    }
    if (options.field_radius_mm) {
        forRows(height, [&](int y) {
            const Columns field = fieldColumns(carm, options, y);
            std::fill(primary.row(y), primary.row(y) + field.begin, 0.0f);
            std::fill(primary.row(y) + field.end, primary.row(y) + width, 0.0f);
        });
    }
    return primary;
}

Image detectorSpread(Image quanta, const CArm& carm, const XrayOptions& options) {
    if (options.detector_kernel) {
        quanta = convolved(quanta, *options.detector_kernel);
    } else {
        quanta = gaussianBlurred(quanta, options.detector_blur_px);
    }
    if (options.glare_fraction > 0) {
        const Image glare = gaussianBlurred(quanta, options.glare_sigma_mm / carm.pixel_mm.mean());
        const auto fraction = static_cast<float>(options.glare_fraction);
        forRows(quanta.height(), [&](int y) {
            for (int x = 0; x < quanta.width(); ++x)
                quanta(x, y) += fraction * (glare(x, y) - quanta(x, y));
        });
    }
    return quanta;
}

Result<Exposure> expose(const Image& line_integrals, const CArm& carm, const XrayOptions& options) {
    if (auto ok = carm.validate(); !ok) return ok.error();
    if (auto ok = options.validate(); !ok) return ok.error();
    if (line_integrals.width() != carm.columns || line_integrals.height() != carm.rows) {
        throw std::logic_error("expose: the image of line integrals does not have the C-arm's size");
    }
    if (!(options.object_depth_mm <= carm.focal_length_mm)) {
        return invalidOption("object_depth_mm", fmt::format("{}", options.object_depth_mm),
                             fmt::format("at most the focal length, {} mm", carm.focal_length_mm));
    }
    for (const float value : line_integrals.pixels()) {
        // A little below zero is an object that displaces more than its own attenuation; e^10 times the beam is not.
        if (!(value >= -10 && std::isfinite(value))) {
            return invalidInput("line integrals", fmt::format("{}", value), "finite numbers of at least -10");
        }
    }

    Exposure exposure;
    const Random seeded(options.seed);
    Image quanta = expectedQuanta(line_integrals, carm, options);
    exposure.mean_photons = meanOf(quanta);
    const bool needs_expectation = !options.gain.has_value() || !options.correlated_noise || !options.quantum_noise;
    Image expected = needs_expectation ? detectorSpread(quanta, carm, options) : Image();
    exposure.gain = options.gain ? *options.gain : automaticGain(expected, carm, options);
    if (options.quantum_noise && options.correlated_noise) {
        addQuantumNoise(quanta, seeded);
        exposure.image = detectorSpread(std::move(quanta), carm, options);
    } else {
        if (options.quantum_noise) addQuantumNoise(expected, seeded);
        exposure.image = std::move(expected);
    }

    const double highest = std::ldexp(1.0, options.bits) - 1;
    std::vector<int> saturated(static_cast<std::size_t>(carm.rows), 0);
    forRows(carm.rows, [&](int y) {
        Random random = rowStream(seeded, y, Stream::electronics);
        float* row = exposure.image.row(y);
        for (int x = 0; x < carm.columns; ++x) {
            double photons = row[x];
            if (options.electronic_noise_photons > 0) photons += options.electronic_noise_photons * random.normal();
            double level = options.offset + exposure.gain * photons;
            if (options.bits > 0) {
                level = std::clamp(std::floor(level + 0.5), 0.0, highest);
                saturated[static_cast<std::size_t>(y)] += level == highest;
            }
            row[x] = static_cast<float>(level);
        }
    });
    exposure.saturated_fraction =
        std::accumulate(saturated.begin(), saturated.end(), 0.0) / static_cast<double>(exposure.image.size());
    return exposure;
}

}  // namespace fluorocut
