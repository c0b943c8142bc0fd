// Where dark lines run in an image, and which way: what the corkscrew's search looks at instead of the image.
//
// The working grid is that of an ideal (undistorted) C-arm with square pixels, a wire about two of them wide: some
// 256 x 256 whatever the detector's resolution. A line's strength at a pixel of log intensity L, blurred:
//
//     r = max over d of min(L(p + d n), L(p - d n)) - L(p),     n: direction of the Hessian's larger eigenvalue
//
// so that the foot of an edge (a cortex, a spindle) is no line: one of its sides is darker yet. It is counted from the
// noise, measured in the image, up to a modest contrast and no further: a screw is worth no more than a wire.
// Strength is kept for eight directions, so that a predicted curve scores only where a line runs along it.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/base/result.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"

namespace fluorocut::corkscrew {

constexpr int kDirections = 8;        // over half a turn
constexpr int kFull = 240;            // strength of a line that is certainly one
constexpr std::uint8_t kChance = 60;  // where nothing can be seen: outside the field, behind thick metal

constexpr float kBlindSigma = 0.12F;  // noise of log intensity beyond which a wire does not show

// Eight strengths, direction k at angle k pi / 8 of the line's tangent.
using Strengths = std::array<std::uint8_t, kDirections>;

class RidgeMap {
  public:
    RidgeMap() = default;
    RidgeMap(int width, int height) : width_(width), height_(height) {
        cells_.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
        for (Strengths& cell : cells_)
            cell.fill(kChance);
    }
    int width() const { return width_; }
    int height() const { return height_; }
    Strengths& at(int x, int y) { return cells_[index(x, y)]; }
    const Strengths& at(int x, int y) const { return cells_[index(x, y)]; }
    bool contains(double x, double y) const { return x >= -0.5 && y >= -0.5 && x < width_ - 0.5 && y < height_ - 0.5; }

  private:
    std::size_t index(int x, int y) const {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
    }
    int width_ = 0, height_ = 0;
    std::vector<Strengths> cells_;
};

// Nearest direction of a tangent (dx, dy).
inline int directionOf(double dx, double dy) {
    if (dy < 0 || (dy == 0 && dx < 0)) {
        dx = -dx;
        dy = -dy;
    }
    // tan(pi / 16), tan(3 pi / 16)
    const double across = std::abs(dx), low = 0.19891236737966, high = 0.66817863791930;
    const int folded = dy <= low * across    ? 0
                       : dy <= high * across ? 1
                       : across > high * dy  ? 2
                       : across > low * dy   ? 3
                                             : 4;
    return dx >= 0 ? folded : (kDirections - folded) % kDirections;
}

// A pixel on the middle of a dark line.
struct RidgePoint {
    float x, y;
    float angle_rad;  // of the line's tangent, -pi/2 to pi/2
    float strength;   // 0 to 1
};

struct WorkingImage {
    CArm carm;    // ideal; of the working grid
    Image log;    // natural logarithm of intensity, metal dark; NaN outside the field
    Image sigma;  // standard deviation of `log`'s noise
    int binning = 1;

    // Where a wire would show: inside the field, and not black.
    bool sees(int x, int y) const { return sigma(x, y) < kBlindSigma; }
};

// Reduced to pixels near `pixel_mm`, undistorted, metal dark. noSolution: nothing but one grey value.
Result<WorkingImage> workingImage(const Image& image, const CArm& carm, double pixel_mm, bool metal_is_bright);

// Of a picture taken as one with dark metal, is its thin metal bright? It leaves a tail on its own side of what is left
// when the image is smoothed.
bool looksBright(const WorkingImage& dark);

// Lines about `width_px` wide (working pixels). `points`, unless null: the lines' middles.
RidgeMap ridgesOfWidth(const WorkingImage& image, double width_px, std::vector<RidgePoint>* points);

// The cellwise maximum over 3 x 3 neighbours: forgives a pixel.
RidgeMap dilated(const RidgeMap& map);

}  // namespace fluorocut::corkscrew
