// From float pixels to what a screen shows.
//
// The pixels are cut into 65536 steps between the image's extremes once; a change of window then rebuilds one table and
// looks every pixel up in it (RGB32: Qt draws its Grayscale formats four to five times slower). A pixel that is not
// finite is shown in the colour kNotFinite, which no grey level has.
#pragma once

#include <QImage>
#include <cstdint>
#include <vector>

#include "core/image/image.h"

namespace fluorocut::ui {

// Values from center - width / 2 (black) to center + width / 2 (white).
struct DisplayWindow {
    double center = 0;
    double width = 1;

    friend bool operator==(const DisplayWindow&, const DisplayWindow&) = default;
};

inline constexpr QRgb kNotFinite = 0xff802020;

class GrayLevels {
  public:
    GrayLevels() = default;
    explicit GrayLevels(const Image& image);

    // The window from the 0.5th to the 99.5th percentile, so that a few extreme pixels do not make the rest flat.
    DisplayWindow fittingWindow() const { return fitting_; }
    // max - min of the finite pixels; at least a small positive number.
    double range() const { return high_ - low_; }

    QImage render(const DisplayWindow& window) const;

  private:
    int width_ = 0;
    int height_ = 0;
    double low_ = 0;
    double high_ = 1;
    DisplayWindow fitting_{0.5, 1};
    std::vector<std::uint16_t> steps_;          // 0 is kept for pixels that are not finite
    mutable std::vector<std::uint32_t> table_;  // of the latest window
};

}  // namespace fluorocut::ui
