#include "core/fabrication/plate_drawing.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "core/distortion/plate_solid.h"

namespace fluorocut {
namespace {

// Of the edges of lands along one axis, from the rim: begin and end of each.
std::vector<std::pair<double, double>> lands(int grooves, const GroovedPlate& plate) {
    std::vector<std::pair<double, double>> all;
    double begin = 0;
    for (int n = 0; n < grooves; ++n) {
        const double middle = (n + 0.5) * plate.pitch_mm;
        all.emplace_back(begin, middle - 0.5 * plate.groove_width_mm);
        begin = middle + 0.5 * plate.groove_width_mm;
    }
    all.emplace_back(begin, grooves * plate.pitch_mm);
    return all;
}

// The plate's section between two places along it: the outline of lands and grooves over the smooth side. `at` is the
// corner of the smooth side at `from`; the grooves open toward +y.
void section(Drawing& drawing, const GroovedPlate& plate, int first, int last, const Vector2& at, double scale,
             bool open_ends) {
    const double p = plate.pitch_mm, w = plate.groove_width_mm;
    const double top = plate.thickness_mm, floor = plate.thickness_mm - plate.groove_depth_mm;
    const auto place = [&](double x, double y) { return Vector2(at + scale * Vector2(x, y)); };
    std::vector<Vector2> upper{place(0, top)};
    for (int n = first; n < last; ++n) {
        const double middle = (n - first + 0.5) * p;
        for (const auto& [x, y] : {std::pair(middle - 0.5 * w, top), std::pair(middle - 0.5 * w, floor),
                                   std::pair(middle + 0.5 * w, floor), std::pair(middle + 0.5 * w, top)}) {
            upper.push_back(place(x, y));
        }
    }
    const double length = (last - first) * p;
    upper.push_back(place(length, top));
    drawing.polyline(upper, false);
    drawing.line(place(0, 0), place(length, 0));
    const Pen ends = open_ends ? Pen::thin : Pen::outline;
    drawing.line(place(0, 0), place(0, top), ends);
    drawing.line(place(length, 0), place(length, top), ends);
}

std::string materialText(Material material) {
    if (material == Material::aluminium) return "aluminium, precision plate (e.g. EN AW-5083), both faces milled";
    return std::string(name(material));
}

}  // namespace

Result<Drawing> drawPlate(const GroovedPlate& plate) {
    if (const Result<void> good = plate.validate(); !good) return good.error();
    const PlateExtent extent = plateExtent(plate);
    const auto [columns, rows] = extent.grooves;
    const double p = plate.pitch_mm, w = plate.groove_width_mm, d = plate.groove_depth_mm, t = plate.thickness_mm;
    const Vector2 size = extent.high - extent.low;
    const bool inches = isWholeInches64(p) && isWholeInches64(w) && isWholeInches64(d) && isWholeInches64(t);
    const auto label = [&](double mm) { return inches ? millimetresAndInches(mm) : millimetres(mm); };

    // Left the top view, in the middle the side view, right three grooves in section over notes and title block.
    constexpr double kLeftMm = 34, kSideMm = 25, kAfterSideMm = 48, kAboveMm = 26, kBelowMm = 28;
    constexpr double kScales[] = {20, 10, 5, 2, 1};
    constexpr std::size_t kNotes = 6;
    const double scale =
        *std::find_if(std::begin(kScales), std::end(kScales), [&](double s) { return s * 3 * p < 110 || s == 1; });
    const double column = std::max(size.x(), 85.0);
    // Dimensions that do not fit along a small plate stand above it.
    const double above = kAboveMm + std::max(0.0, 80 - size.y());
    const double section_width = std::max(scale * 3 * p + 40, Drawing::kTitleWidthMm - kAfterSideMm);
    const double section_height = 48 + scale * t + 20 + kNotes * Drawing::kNoteMm + Drawing::kTitleHeightMm;
    const Vector2 needed(kLeftMm + column + kSideMm + t + kAfterSideMm + section_width,
                         std::max(above + size.y() + kBelowMm, section_height));
    Drawing drawing(needed);
    const Vector2 low(Drawing::kBorderMm + kLeftMm, drawing.size().y() - Drawing::kBorderMm - above - size.y());
    const Vector2 high = low + size;
    const double captions = drawing.size().y() - Drawing::kBorderMm - 8;

    // Top view: the lands are what stands between the grooves.
    drawing.rectangle(low, high);
    const auto across = lands(columns, plate), along = lands(rows, plate);
    for (std::size_t j = 0; j < along.size(); ++j) {
        for (std::size_t i = 0; i < across.size(); ++i) {
            const Vector2 a = low + Vector2(across[i].first, along[j].first);
            const Vector2 b = low + Vector2(across[i].second, along[j].second);
            // Not the sides that the rim has already.
            if (i > 0) drawing.line(a, {a.x(), b.y()}, Pen::thin);
            if (i + 1 < across.size()) drawing.line({b.x(), a.y()}, b, Pen::thin);
            if (j > 0) drawing.line(a, {b.x(), a.y()}, Pen::thin);
            if (j + 1 < along.size()) drawing.line({a.x(), b.y()}, b, Pen::thin);
        }
    }
    drawing.text({low.x(), captions}, "TOP VIEW, grooved side, 1:1", Align::left, 4);
    drawing.dimensionX(low, {high.x(), low.y()}, low.y() - 22, label(size.x()));
    drawing.dimensionY(low, {low.x(), high.y()}, low.x() - 22, label(size.y()));
    // From the datum edges to the first and to the last groove.
    const double last_x = (columns - 0.5) * p, last_y = (rows - 0.5) * p;
    drawing.dimensionX(low + Vector2(0.5 * p, 0), low + Vector2(last_x, 0), low.y() - 11,
                       fmt::format("{} x {} = {}", columns - 1, label(p), label((columns - 1) * p)));
    drawing.dimensionY(low + Vector2(0, 0.5 * p), low + Vector2(0, last_y), low.x() - 11,
                       fmt::format("{} x {} = {}", rows - 1, label(p), label((rows - 1) * p)));
    drawing.dimensionX({low.x(), high.y()}, {low.x() + 0.5 * p, high.y()}, high.y() + 8,
                       label(0.5 * p) + " to the first groove, both ways");
    drawing.text(low + Vector2(-7, -7), "A", Align::middle, 4);

    // Side view from the left, to the right of the top view (first angle): turned so that the grooves open to the
    // right.
    const double side_x = low.x() + column + kSideMm;
    const auto turned = [&](double y, double z) { return Vector2(side_x + z, low.y() + y); };
    std::vector<Vector2> profile{turned(0, t)};
    for (int n = 0; n < rows; ++n) {
        const double middle = (n + 0.5) * p;
        for (const auto& [y, z] : {std::pair(middle - 0.5 * w, t), std::pair(middle - 0.5 * w, t - d),
                                   std::pair(middle + 0.5 * w, t - d), std::pair(middle + 0.5 * w, t)}) {
            profile.push_back(turned(y, z));
        }
    }
    profile.push_back(turned(size.y(), t));
    profile.push_back(turned(size.y(), 0));
    profile.push_back(turned(0, 0));
    drawing.polyline(profile, true);
    drawing.text({side_x - 3, captions}, "SIDE VIEW, 1:1", Align::left, 4);

    // Detail: three grooves in section.
    const Vector2 at(side_x + t + kAfterSideMm, captions - 40 - scale * t);
    drawing.text({at.x(), captions}, fmt::format("SECTION ACROSS GROOVES, {}:1", scale), Align::left, 4);
    section(drawing, plate, 0, 3, at, scale, true);
    const auto spot = [&](double x, double y) { return Vector2(at + scale * Vector2(x, y)); };
    for (int n = 0; n < 3; ++n)
        drawing.line(spot((n + 0.5) * p, -0.4), spot((n + 0.5) * p, t + 0.6), Pen::center);
    const double top = spot(0, t).y();
    drawing.dimensionX(spot(0.5 * p, t + 0.6), spot(1.5 * p, t + 0.6), top + 22, label(p));
    drawing.dimensionX(spot(1.5 * p - 0.5 * w, t), spot(1.5 * p + 0.5 * w, t), top + 11, label(w));
    drawing.dimensionY(spot(3 * p, 0), spot(3 * p, t), at.x() + scale * 3 * p + 24, label(t));
    drawing.dimensionY(spot(2.5 * p + 0.5 * w, t - d), spot(3 * p, t), at.x() + scale * 3 * p + 11, label(d));
    drawing.text(at + Vector2(0, -13), "lies on the detector with this side; the grooves face the X-ray source",
                 Align::left, 2.8);

    const std::array<std::string, kNotes> notes{
        "Datum: corner A and the two edges that meet there.",
        fmt::format("{} grooves {} wide, {} deep, square bottomed, all alike.",
                    columns == rows ? fmt::format("2 x {}", columns) : fmt::format("{} and {}", columns, rows),
                    label(w), label(d)),
        fmt::format("Grooves run out through the rim. Floor of {} left under them.", label(t - d)),
        "The place of a groove counts from the datum, errors must not add up: it calibrates images.",
        "The two sets of grooves square to each other within 0.02 over their length. Flat within 0.1.",
        "No burrs. Clear anodising is welcome (10 um); no paint that holds metal."};
    drawing.frame({fmt::format("Grooved plate, {} x {} grooves", columns, rows),
                   fmt::format("1:1, section {}:1", scale),
                   materialText(plate.material),
                   "ISO 2768-m; groove's place \xC2\xB1"
                   "0.02 from datum A, width \xC2\xB1"
                   "0.05, depth \xC2\xB1"
                   "0.1",
                   {notes.begin(), notes.end()}});
    return drawing;
}

}  // namespace fluorocut
