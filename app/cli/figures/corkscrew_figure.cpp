#include "app/cli/figures/corkscrew_figure.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "app/cli/figures/canvas.h"
#include "core/image/blur.h"
#include "core/imaging/display_picture.h"

namespace fluorocut::cli {
namespace {

constexpr double kPanel = 640;  // width or height of a picture, whichever is larger
constexpr double kGap = 16;
constexpr double kSmoothPx = 8;  // of the local brightness, in which metal and bone both show
constexpr double kAxisMm = 15;

// Logarithm against its surroundings: wires show over bone and beside it.
Image shown(const Image& levels) {
    Image picture = levels;
    for (float& value : picture.pixels())
        value = std::log(std::max(value, 0.0F) + 1.0F);
    const Image around = gaussianBlurred(picture, kSmoothPx * 4);
    std::vector<float> sorted;
    for (std::size_t i = 0; i < picture.size(); ++i) {
        picture.pixels()[i] -= 0.6F * around.pixels()[i];
        sorted.push_back(picture.pixels()[i]);
    }
    const auto percentile = [&](double share) {
        const auto nth = sorted.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(sorted.size() - 1));
        std::nth_element(sorted.begin(), nth, sorted.end());
        return *nth;
    };
    const float low = percentile(0.02), high = std::max(percentile(0.98), low + 1e-6F);
    for (float& value : picture.pixels())
        value = std::clamp((value - low) / (high - low), 0.0F, 1.0F);
    return picture;
}

}  // namespace

ColorImage corkscrewFigure(const Image& image, const CArm& carm, const CorkscrewLayout& layout,
                           const Rigid3& imager_from_corkscrew) {
    const double scale = kPanel / std::max(image.width(), image.height());
    const Vector2 size(scale * image.width(), scale * image.height());
    Canvas canvas(static_cast<int>(2 * size.x() + 3 * kGap), static_cast<int>(size.y() + 2 * kGap));
    const Image picture = shown(image);
    const Vector2 left(kGap, kGap), right(2 * kGap + size.x(), kGap);
    const Vector2 half(0.5 * (scale - 1), 0.5 * (scale - 1));
    canvas.picture(picture, left + half, scale);
    canvas.picture(picture, right + half, scale);

    const auto place = [&](const Vector3& point) -> Vector2 {
        return right + half + scale * carm.project(imager_from_corkscrew * point);
    };
    const auto inside = [&](const Vector2& at) {
        return at.x() >= right.x() && at.y() >= right.y() && at.x() < right.x() + size.x() &&
               at.y() < right.y() + size.y();
    };
    const auto draw = [&](const std::vector<Vector3>& line, Color color, int thickness) {
        std::vector<Vector2> part;
        for (const Vector3& point : line) {
            const Vector2 at = place(point);
            if (inside(at)) {
                part.push_back(at);
            } else {
                canvas.curve(part, color, thickness);
                part.clear();
            }
        }
        canvas.curve(part, color, thickness);
    };
    std::vector<Vector3> line;
    for (int i = 0; i <= 100; ++i)
        line.emplace_back(std::lerp(layout.shaft_x_mm[0], layout.shaft_x_mm[1], i / 100.0), 0, 0);
    draw(line, kSkyBlue, 1);
    for (const CorkscrewRing& ring : layout.rings) {
        line.clear();
        for (int i = 0; i <= 120; ++i)
            line.push_back(ring.point(2 * std::numbers::pi * i / 120));
        draw(line, kOrange, 1);
    }
    line.clear();
    for (int i = 0; i <= 240; ++i)
        line.push_back(layout.helix.point(i / 240.0));
    draw(line, kYellow, 1);
    for (const CorkscrewBead& bead : layout.beads) {
        const Vector2 at = place(bead.center_mm);
        if (inside(at)) canvas.dot(at, 2.5, kSkyBlue);
    }
    const Color colors[] = {kVermilion, kGreen, kSkyBlue};
    for (int axis = 0; axis < 3; ++axis) {
        const Vector2 from = place(Vector3::Zero()), to = place(kAxisMm * Vector3::Unit(axis));
        if (inside(from) && inside(to)) canvas.arrow(from, to, colors[axis]);
    }
    return canvas.image();
}

}  // namespace fluorocut::cli
