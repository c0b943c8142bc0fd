#include "core/procedure/report_picture.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Geometry>

#include "core/imaging/display_picture.h"
#include "core/procedure/report_canvas.h"

namespace fluorocut {

namespace {

// The levels about the curves, by half of their size all round; without curves all.
std::vector<float> levelsThatMatter(const ReportPicture& picture) {
    const Image& image = picture.image;
    Eigen::AlignedBox2d box;
    for (const ReportCurve& curve : picture.curves)
        for (const Vector2& point : curve.points)
            box.extend(point);
    if (box.isEmpty()) return {image.pixels().begin(), image.pixels().end()};
    const double margin = 0.5 * box.sizes().maxCoeff();
    const auto bound = [](double value, int size) { return static_cast<int>(std::clamp(value, 0.0, size - 1.0)); };
    const int left = bound(box.min().x() - margin, image.width()), right = bound(box.max().x() + margin, image.width());
    const int top = bound(box.min().y() - margin, image.height());
    const int bottom = bound(box.max().y() + margin, image.height());
    std::vector<float> levels;
    for (int y = top; y <= bottom; ++y)
        levels.insert(levels.end(), image.row(y) + left, image.row(y) + right + 1);
    return levels;
}

}  // namespace

Result<Image> reportGrey(const ReportPicture& picture) {
    if (picture.image.empty()) return invalidInput("report", "a picture without pixels", "a picture");
    std::vector<float> levels = levelsThatMatter(picture);
    std::sort(levels.begin(), levels.end());
    const float low = levels[levels.size() / 200], high = levels[levels.size() - 1 - levels.size() / 1000];
    Image clamped = picture.image;
    for (float& level : clamped.pixels())
        level = std::clamp(level, low, high);
    Result<Image> grey = displayPicture(clamped);
    if (!grey) return grey;
    for (float& value : grey->pixels())
        value *= 255;
    return grey;
}

Result<ColorImage> burnedIn(const ReportPicture& picture, const std::vector<std::string>& lines) {
    constexpr int kLeastWidth = 1024;
    constexpr ReportColor kBlack{0, 0, 0}, kWhite{236, 240, 243};
    const Result<Image> grey = reportGrey(picture);
    if (!grey) return grey.error();
    const int scale = std::max(1, (kLeastWidth + grey->width() - 1) / grey->width());
    const int width = scale * grey->width(), height = scale * grey->height();
    const double letters = width / 64.0, margin = letters, across = width - 2 * margin;
    const TextLook look{letters, false, kWhite};
    double text_height = 0;
    const ReportCanvas measuring = ReportCanvas::pixels(1, 1);
    for (const std::string& line : lines)
        text_height += measuring.sizeOf(line, look, across).height + letters / 4;
    const int strip = static_cast<int>(std::ceil(text_height + 1.5 * letters + 2 * margin));

    ReportCanvas canvas = ReportCanvas::pixels(width, height + strip);
    canvas.rectangle(0, 0, width, height + strip, kBlack);
    canvas.picture(*grey, picture.curves, 0, 0, width, width / 500.0);
    double y = height + margin;
    for (const std::string& line : lines)
        y += canvas.text(line, look, margin, y, across).height + letters / 4;
    double x = margin;
    for (const auto kind : {ReportCurve::Kind::planned, ReportCurve::Kind::first, ReportCurve::Kind::found}) {
        if (std::none_of(picture.curves.begin(), picture.curves.end(),
                         [&](const ReportCurve& drawn) { return drawn.kind == kind; }))
            continue;
        const CurveLook& curve = lookOf(kind);
        canvas.line(x, y + 0.6 * letters, x + 3 * letters, y + 0.6 * letters, curve.color, width / 350.0, curve.dashed);
        x += 3.6 * letters;
        x += canvas.text(curve.label, look, x, y).width + 2 * letters;
    }
    return canvas.image();
}

}  // namespace fluorocut
