// Canvas: figures for eyes, drawn on pixels without a screen: pictures, curves, points and text, smooth-edged.
// Coordinates are pixels of the canvas, pixel centres at integers, as in images.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "core/geometry/rigid3.h"
#include "core/image/image.h"

namespace fluorocut::cli {

using Color = std::array<std::uint8_t, 3>;

// Distinguishable with every kind of colour blindness (Okabe and Ito 2008).
inline constexpr Color kOrange{230, 159, 0}, kSkyBlue{86, 180, 233}, kGreen{0, 158, 115}, kYellow{240, 228, 66},
    kVermilion{213, 94, 0}, kInk{33, 37, 41}, kFaint{134, 142, 150}, kPaper{255, 255, 255};

class Canvas {
  public:
    Canvas(int width, int height, Color background = kPaper);
    ~Canvas();
    Canvas(Canvas&&) noexcept;
    Canvas& operator=(Canvas&&) noexcept;

    // `values` in [0, 1], black to white, magnified so that its pixel centre (0, 0) comes to `at` and one of its pixels
    // is `scale` wide.
    void picture(const Image& values, const Vector2& at, double scale);
    void curve(std::span<const Vector2> points, Color color, int thickness = 1);
    void arrow(const Vector2& from, const Vector2& to, Color color);
    void dot(const Vector2& center, double radius, Color color);
    void frame(const Vector2& corner, const Vector2& size, Color color);
    // `at`: left end of the baseline; letters are about `height` tall.
    void text(const Vector2& at, const std::string& words, double height, Color color = kInk);

    ColorImage image() const;

  private:
    struct Pixels;
    std::unique_ptr<Pixels> pixels_;
};

}  // namespace fluorocut::cli
