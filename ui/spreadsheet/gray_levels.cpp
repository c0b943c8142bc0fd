#include "ui/spreadsheet/gray_levels.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fluorocut::ui {
namespace {

constexpr int kSteps = 65535;  // 1 ... 65535

// The step below which `part` of the counted pixels lie.
int percentile(const std::vector<std::uint32_t>& histogram, double part) {
    std::uint64_t total = 0;
    for (const std::uint32_t count : histogram)
        total += count;
    const double wanted = part * static_cast<double>(total);
    std::uint64_t sum = 0;
    for (std::size_t step = 0; step < histogram.size(); ++step) {
        sum += histogram[step];
        if (static_cast<double>(sum) >= wanted && sum > 0) return static_cast<int>(step);
    }
    return static_cast<int>(histogram.size()) - 1;
}

}  // namespace

GrayLevels::GrayLevels(const Image& image) : width_(image.width()), height_(image.height()) {
    float low = std::numeric_limits<float>::infinity();
    float high = -low;
    for (const float value : image.pixels()) {
        if (!std::isfinite(value)) continue;
        low = std::min(low, value);
        high = std::max(high, value);
    }
    low_ = std::isfinite(low) ? low : 0.0;
    high_ = std::isfinite(high) ? high : 1.0;
    if (!(high_ > low_)) high_ = low_ + std::max(1e-6, 1e-6 * std::abs(low_));

    const double scale = (kSteps - 1) / (high_ - low_);
    std::vector<std::uint32_t> histogram(kSteps, 0);
    steps_.reserve(image.size());
    for (const float value : image.pixels()) {
        if (!std::isfinite(value)) {
            steps_.push_back(0);
            continue;
        }
        const auto step = static_cast<std::uint16_t>(std::lround((value - low_) * scale));
        ++histogram[step];
        steps_.push_back(static_cast<std::uint16_t>(step + 1));
    }
    const double black = low_ + percentile(histogram, 0.005) / scale;
    const double white = low_ + percentile(histogram, 0.995) / scale;
    fitting_ = white > black ? DisplayWindow{0.5 * (black + white), white - black}
                             : DisplayWindow{0.5 * (low_ + high_), high_ - low_};
}

QImage GrayLevels::render(const DisplayWindow& window) const {
    QImage shown(width_, height_, QImage::Format_RGB32);
    if (steps_.empty()) return shown;

    table_.resize(kSteps + 1);
    table_[0] = kNotFinite;
    const double step_size = (high_ - low_) / (kSteps - 1);
    const double black = window.center - 0.5 * window.width;
    for (int step = 1; step <= kSteps; ++step) {
        const double value = low_ + (step - 1) * step_size;
        const int gray = static_cast<int>(std::clamp(255.0 * (value - black) / window.width + 0.5, 0.0, 255.0));
        table_[static_cast<std::size_t>(step)] = qRgb(gray, gray, gray);
    }
    const std::uint16_t* step = steps_.data();
    for (int y = 0; y < height_; ++y) {
        auto* pixel = reinterpret_cast<QRgb*>(shown.scanLine(y));
        for (int x = 0; x < width_; ++x)
            *pixel++ = table_[*step++];
    }
    return shown;
}

}  // namespace fluorocut::ui
