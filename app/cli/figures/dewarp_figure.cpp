#include "app/cli/figures/dewarp_figure.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "app/cli/figures/canvas.h"
#include "core/base/units.h"
#include "core/distortion/dewarp.h"
#include "core/distortion/distortion_acceptance.h"

namespace fluorocut::cli {
namespace {

constexpr double kPanel = 560;  // width of a picture
constexpr double kGap = 24;
constexpr double kTitle = 34;    // height of the line above a picture
constexpr double kLetters = 13;  // height

// One picture of the figure: where image pixels come to lie.
struct Panel {
    Vector2 corner;
    double scale = 1;

    Vector2 at(const Vector2& pixel) const { return corner + scale * (pixel + Vector2(0.5, 0.5)); }
};

class Sheet {
  public:
    Sheet(int columns, int rows)
        : scale_(kPanel / std::max(columns, rows)),
          size_(scale_ * columns, scale_ * rows),
          canvas_(static_cast<int>(std::ceil(3 * size_.x() + 4 * kGap)),
                  static_cast<int>(std::ceil(2 * (size_.y() + kTitle) + 3 * kGap))) {}

    Panel panel(int number, const std::string& title) {
        const Vector2 corner(kGap + (number % 3) * (size_.x() + kGap),
                             kGap + kTitle + (number / 3) * (size_.y() + kTitle + kGap));
        canvas_.text(corner - Vector2(0, 10), title, kLetters + 1);
        canvas_.frame(corner - Vector2(1, 1), size_ + Vector2(1, 1), kFaint);
        return {corner, scale_};
    }

    Canvas& canvas() { return canvas_; }
    const Vector2& size() const { return size_; }

  private:
    double scale_;
    Vector2 size_;
    Canvas canvas_;
};

// Brightness between the 1st and 99th percentile; `dim` makes room for what is drawn over it.
Image shown(const Image& levels, double dim) {
    std::vector<float> sorted = levels.pixels();
    const auto percentile = [&](double share) {
        const auto nth = sorted.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(sorted.size() - 1));
        std::nth_element(sorted.begin(), nth, sorted.end());
        return *nth;
    };
    const float low = percentile(0.01), high = std::max(percentile(0.995), low + 1e-6F);
    Image result = levels;
    for (float& value : result.pixels())
        value = static_cast<float>(dim) * std::clamp((value - low) / (high - low), 0.0F, 1.0F);
    return result;
}

std::vector<Vector2> placed(const Panel& panel, std::vector<Vector2> pixels) {
    for (Vector2& pixel : pixels)
        pixel = panel.at(pixel);
    return pixels;
}

// A groove as the map has it, where the map is supported.
void drawGroove(Canvas& canvas, const Panel& panel, const DistortionMap& map, bool along_y, double at_mm,
                double reach_mm, Color color) {
    const PlaneMotion& detector_from_plate = map.parts().detector_from_plate;
    std::vector<Vector2> curve;
    const double step = 0.25 * map.parts().pitch_mm;
    for (double along = -reach_mm; along <= reach_mm; along += step) {
        const Vector2 plate = along_y ? Vector2(at_mm, along) : Vector2(along, at_mm);
        const Vector2 pixel = map.pixelFromDetector(detector_from_plate * plate);
        curve.push_back(map.covers(pixel) ? panel.at(pixel) : Vector2::Constant(std::nan("")));
    }
    canvas.curve(curve, color);
}

void drawGrooves(Canvas& canvas, const Panel& panel, const DistortionMap& map) {
    const double pitch = map.parts().pitch_mm;
    const double reach = map.pixelMm() * std::hypot(map.columns(), map.rows());
    const int count = static_cast<int>(std::ceil(reach / pitch));
    for (int index = -count; index <= count; ++index) {
        drawGroove(canvas, panel, map, true, index * pitch, reach, kOrange);
        drawGroove(canvas, panel, map, false, index * pitch, reach, kSkyBlue);
    }
}

// Places on a grid inside the support and how far the map moves them.
std::vector<std::pair<Vector2, Vector2>> displacements(const DistortionMap& map, double step) {
    std::vector<std::pair<Vector2, Vector2>> result;
    for (double v = 0.5 * step; v < map.rows(); v += step) {
        for (double u = 0.5 * step; u < map.columns(); u += step) {
            const Vector2 pixel(u, v);
            if (map.covers(pixel)) result.emplace_back(pixel, map.idealPixel(pixel) - pixel);
        }
    }
    return result;
}

void drawDisplacements(Sheet& sheet, int number, const DistortionMap& map) {
    const double step = std::max(map.columns(), map.rows()) / 24.0;
    const auto moved = displacements(map, step);
    double longest = 1e-6;
    for (const auto& [pixel, by] : moved)
        longest = std::max(longest, by.norm());
    // As large as it can be without arrows over more than their neighbours.
    double magnification = 1;
    for (const double larger : {2.0, 3.0, 5.0, 10.0, 20.0, 50.0, 100.0}) {
        if (larger * longest <= 1.6 * step) magnification = larger;
    }
    const Panel panel = sheet.panel(number, fmt::format("E  displacement, {:g} times", magnification));
    for (const auto& [pixel, by] : moved)
        sheet.canvas().arrow(panel.at(pixel), panel.at(pixel + magnification * by), kVermilion);
    std::vector<Vector2> rim = placed(panel, map.parts().support.polygon());
    rim.push_back(rim.front());
    sheet.canvas().curve(rim, kFaint);
}

void writeFigures(Canvas& canvas, const Panel& panel, const GrooveDetection& grooves, const DistortionMap& map) {
    const DistortionQuality& quality = map.quality();
    const MapUncertainty uncertainty = uncertaintyOf(map);
    double farthest = 0;
    for (const Vector2& rim : map.parts().support.polygon())
        farthest = std::max(farthest, (map.idealPixel(rim) - rim).norm());
    const std::vector<std::pair<std::string, std::string>> lines{
        {"model", std::string(map.model().name())},
        {"grooves", fmt::format("{} along y, {} along x", quality.columns_found, quality.rows_found)},
        {"points", fmt::format("{} used, {} rejected", quality.points_used, quality.points_rejected)},
        {"hidden, doubtful", fmt::format("{}, {} of {} segments", grooves.along_y.hidden + grooves.along_x.hidden,
                                         grooves.along_y.doubtful + grooves.along_x.doubtful,
                                         grooves.along_y.expected + grooves.along_x.expected)},
        {"coverage", fmt::format("{:.0f} % of the image", 100 * quality.coverage)},
        {"residual", fmt::format("{:.3f} px = {:.3f} mm rms", quality.rms_px, quality.rms_mm)},
        {"uncertainty", fmt::format("{:.3f} mm middle, {:.3f} mm rim", uncertainty.middle_mm, uncertainty.largest_mm)},
        {"moved by", fmt::format("up to {:.1f} px at the rim", farthest)},
        {"pixel", fmt::format("{:.4f} mm in the plate's plane", map.pixelMm())},
        {"plate turned by", fmt::format("{:.2f} degrees", degreesFromRadians(grooves.rotation_rad))},
        {"contrast", fmt::format("{:.1f} %, noise {:.1f} % per pixel", 100 * grooves.contrast, 100 * grooves.noise)}};
    Vector2 at = panel.corner + Vector2(20, 40);
    for (const auto& [label, value] : lines) {
        canvas.text(at, label, kLetters, kFaint);
        canvas.text(at + Vector2(180, 0), value, kLetters);
        at.y() += 2.6 * kLetters;
    }
}

}  // namespace

Result<ColorImage> dewarpFigure(const Image& image, const GrooveDetection& grooves, const DistortionMap& map) {
    const Result<Image> straight = Dewarper(map).dewarped(image);
    if (!straight) return straight.error();
    Sheet sheet(image.width(), image.height());
    Canvas& canvas = sheet.canvas();
    const auto picture = [&](int number, const std::string& title, const Image& levels, double dim) {
        const Panel panel = sheet.panel(number, title);
        canvas.picture(shown(levels, dim), panel.at(Vector2::Zero()), panel.scale);
        return panel;
    };
    picture(0, "A  image of the grooved plate", image, 1);
    const Panel points = picture(1, "B  points found on the grooves", image, 0.55);
    for (const GroovePoint& point : grooves.points.along_y)
        canvas.dot(points.at(point.pixel), 1.6, kOrange);
    for (const GroovePoint& point : grooves.points.along_x)
        canvas.dot(points.at(point.pixel), 1.6, kSkyBlue);
    drawGrooves(canvas, picture(2, "C  grooves as the map has them", image, 0.55), map);
    picture(3, "D  dewarped", *straight, 1);
    drawDisplacements(sheet, 4, map);
    writeFigures(canvas, sheet.panel(5, "Figures"), grooves, map);
    return canvas.image();
}

}  // namespace fluorocut::cli
