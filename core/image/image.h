// Images: row-major pixels, (0, 0) is the centre of the first pixel, x along columns, y down the rows.
// Bright means more photons, whatever the file said. An image knows its pixels and nothing else: scale and pose belong
// to the C-arm (core/imaging).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <utility>
#include <vector>

namespace fluorocut {

template <class T>
class BasicImage {
  public:
    BasicImage() = default;
    BasicImage(int width, int height, T fill = T{}) : width_(width), height_(height) {
        if (width < 0 || height < 0) throw std::logic_error("BasicImage: negative size");
        pixels_.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), fill);
    }
    BasicImage(int width, int height, std::vector<T> pixels)
        : width_(width), height_(height), pixels_(std::move(pixels)) {
        if (width < 0 || height < 0 ||
            pixels_.size() != static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {
            throw std::logic_error("BasicImage: size does not match the number of pixels");
        }
    }

    int width() const { return width_; }
    int height() const { return height_; }
    std::size_t size() const { return pixels_.size(); }
    bool empty() const { return pixels_.empty(); }

    T& operator()(int x, int y) { return pixels_[index(x, y)]; }
    const T& operator()(int x, int y) const { return pixels_[index(x, y)]; }
    T* row(int y) { return pixels_.data() + index(0, y); }
    const T* row(int y) const { return pixels_.data() + index(0, y); }
    std::vector<T>& pixels() { return pixels_; }
    const std::vector<T>& pixels() const { return pixels_; }

    friend bool operator==(const BasicImage&, const BasicImage&) = default;

  private:
    std::size_t index(int x, int y) const {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
    }

    int width_ = 0;
    int height_ = 0;
    std::vector<T> pixels_;
};

using Image = BasicImage<float>;
using Mask = BasicImage<std::uint8_t>;
using ColorImage = BasicImage<std::array<std::uint8_t, 3>>;  // red, green, blue: for eyes only

}  // namespace fluorocut
