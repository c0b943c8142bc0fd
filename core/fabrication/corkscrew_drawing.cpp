#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "core/base/units.h"
#include "core/fabrication/corkscrew_rod.h"

namespace fluorocut {
namespace {

constexpr double kPi = std::numbers::pi;

std::string degrees(double angle_rad) {
    return fmt::format("{:.6g}\xC2\xB0", degreesFromRadians(angle_rad));
}

// Of a place around the axis, 0 to 360 degrees.
std::string placeAround(double angle_rad) {
    const double turns = angle_rad / (2 * kPi);
    double place = 360 * (turns - std::floor(turns));
    if (place > 359.9999) place = 0;
    return fmt::format("{:.6g}\xC2\xB0", std::abs(place) < 1e-9 ? 0 : place);
}

double endPhase(const CorkscrewHelix& helix) {
    const double sense = helix.handedness == Handedness::right ? 1 : -1;
    return helix.phase_rad + sense * 2 * kPi * helix.turns;
}

const char* handText(Handedness handedness) {
    return handedness == Handedness::right ? "right" : "left";
}

// A wire as two lines at its sides, hidden where it is behind (z < 0).
void drawWire(Drawing& drawing, const std::vector<Vector3>& line, double wire_mm, double scale, const Vector2& middle) {
    for (std::size_t i = 0; i + 1 < line.size(); ++i) {
        const Vector2 a = line[i].head<2>(), b = line[i + 1].head<2>();
        const bool behind = 0.5 * (line[i].z() + line[i + 1].z()) < 0;
        // Hidden: every other piece, as one thin line.
        if (behind) {
            if (i % 4 < 2) drawing.line(middle + scale * a, middle + scale * b, Pen::thin);
            continue;
        }
        const Vector2 along = (b - a).norm() > 1e-9 ? Vector2((b - a).normalized()) : Vector2::Zero();
        const Vector2 side = wire_mm * Vector2(-along.y(), along.x());
        for (const int sign : {-1, 1})
            drawing.line(middle + scale * (a + sign * side), middle + scale * (b + sign * side));
    }
}

// x right, y up, seen from +z. `middle`: the corkscrew's origin on the paper.
void drawSide(Drawing& drawing, const CorkscrewLayout& layout, double scale, const Vector2& middle) {
    const double radius = layout.rod_radius_mm;
    const auto at = [&](double x, double y) { return Vector2(middle + scale * Vector2(x, y)); };
    drawing.rectangle(at(layout.rod_x_mm[0], -radius), at(layout.rod_x_mm[1], radius));
    for (const int sign : {-1, 1}) {  // the shaft: seen outside, hidden inside
        const double y = sign * layout.shaft_radius_mm;
        const double in_low = std::max(layout.rod_x_mm[0], layout.shaft_x_mm[0]);
        const double in_high = std::min(layout.rod_x_mm[1], layout.shaft_x_mm[1]);
        if (in_low > layout.shaft_x_mm[0]) drawing.line(at(layout.shaft_x_mm[0], y), at(in_low, y));
        if (in_low < in_high) drawing.line(at(in_low, y), at(in_high, y), Pen::hidden);
        if (in_high < layout.shaft_x_mm[1]) drawing.line(at(in_high, y), at(layout.shaft_x_mm[1], y));
    }
    for (const double x : layout.shaft_x_mm)
        drawing.line(at(x, -layout.shaft_radius_mm), at(x, layout.shaft_radius_mm));
    drawing.line(at(layout.shaft_x_mm[0], 0) - Vector2(4, 0), at(layout.shaft_x_mm[1], 0) + Vector2(4, 0), Pen::center);
    for (const CorkscrewRing& ring : layout.rings) {
        for (const int sign : {-1, 1}) {
            const double x = ring.x_mm + sign * ring.wire_radius_mm;
            drawing.line(at(x, -radius), at(x, radius));
        }
    }
    std::vector<Vector3> line;
    const int steps = std::max(24, static_cast<int>(72 * layout.helix.turns));
    for (int i = 0; i <= steps; ++i)
        line.push_back(layout.helix.point(static_cast<double>(i) / steps));
    drawWire(drawing, line, layout.helix.wire_radius_mm, scale, middle);
    for (std::size_t i = 0; i < layout.beads.size(); ++i) {
        const CorkscrewBead& bead = layout.beads[i];
        const Vector2 place = at(bead.center_mm.x(), bead.center_mm.y());
        const Pen pen = bead.center_mm.z() < 0 ? Pen::hidden : Pen::outline;
        drawing.circle(place, scale * bead.radius_mm, pen);
        drawing.text(place + Vector2(scale * bead.radius_mm + 1.5, 1), fmt::format("B{}", i + 1), Align::left, 2.8);
    }
}

// Seen from +x: y up, z to the left, angles from +y counter-clockwise.
void drawEnd(Drawing& drawing, const CorkscrewLayout& layout, double scale, const Vector2& middle) {
    const double rod = scale * layout.rod_radius_mm;
    const auto at = [&](double y, double z) { return Vector2(middle + scale * Vector2(-z, y)); };
    const auto around = [&](double radius_on_paper, double angle) {
        return Vector2(middle + radius_on_paper * Vector2(-std::sin(angle), std::cos(angle)));
    };
    drawing.circle(middle, rod);
    drawing.circle(middle, scale * layout.shaft_radius_mm);
    drawing.circle(middle, scale * layout.helix.radius_mm, Pen::center);
    drawing.centerMark(middle, rod + 5);
    drawing.text(middle + Vector2(0, rod + 7), "+y: 0\xC2\xB0", Align::middle);
    drawing.text(middle + Vector2(-rod - 7, -1.2), "+z: 90\xC2\xB0", Align::right);
    const CorkscrewHelix& helix = layout.helix;
    // Where the helix starts and ends: a dot on its circle, told where there is room, right of the view.
    int row = 0;
    for (const auto& [name, angle] : {std::pair("starts", helix.phase_rad), std::pair("ends", endPhase(helix))}) {
        const Vector2 place = around(scale * helix.radius_mm, angle);
        drawing.circle(place, scale * helix.wire_radius_mm);
        const Vector2 elbow = middle + Vector2(rod + 8, rod - 4 - 10.0 * row);
        drawing.leader(place, elbow, fmt::format("helix {} at {}", name, placeAround(angle)));
        ++row;
    }
    for (std::size_t i = 0; i < layout.beads.size(); ++i) {
        const CorkscrewBead& bead = layout.beads[i];
        const Vector2 place = at(bead.center_mm.y(), bead.center_mm.z());
        drawing.circle(place, scale * bead.radius_mm);
        // Toward the middle, where no wire is.
        const bool is_right = place.x() > middle.x() + 1;
        const double aside = scale * bead.radius_mm + 1;
        drawing.text(place + Vector2(is_right ? -aside : aside, -1), fmt::format("B{}", i + 1),
                     is_right ? Align::right : Align::left, 2.8);
    }
}

// Across a groove, enlarged. `at`: where its middle line meets the rod's surface.
void drawGroove(Drawing& drawing, double rod_mm, double radius_mm, double wire_mm, double scale, const Vector2& at) {
    const auto spot = [&](double x, double down) { return Vector2(at + scale * Vector2(x, -down)); };
    const double middle = rod_mm - radius_mm;
    for (const int sign : {-1, 1}) {
        drawing.line(spot(sign * wire_mm, 0), spot(sign * 4 * wire_mm, 0));
        drawing.line(spot(sign * wire_mm, 0), spot(sign * wire_mm, middle));
    }
    drawing.arc(spot(0, middle), scale * wire_mm, kPi, 2 * kPi);
    drawing.line(spot(0, -0.8 * wire_mm), spot(0, middle + 1.8 * wire_mm), Pen::center);
    drawing.dimensionX(spot(-wire_mm, 0), spot(wire_mm, 0), at.y() + 9, millimetres(2 * wire_mm));
    drawing.dimensionY(spot(4 * wire_mm, 0), spot(0, middle + wire_mm), at.x() + scale * 4 * wire_mm + 8,
                       millimetres(middle + wire_mm));
    drawing.leader(spot(-wire_mm * std::cos(0.7), middle + wire_mm * std::sin(0.7)),
                   spot(-2.6 * wire_mm, middle + 2.2 * wire_mm), fmt::format("R {}", millimetres(wire_mm)));
}

// The widest groove stands for all when they are alike.
bool groovesAreAlike(const CorkscrewLayout& layout) {
    return std::all_of(layout.rings.begin(), layout.rings.end(), [&](const CorkscrewRing& ring) {
        return ring.radius_mm == layout.helix.radius_mm && ring.wire_radius_mm == layout.helix.wire_radius_mm;
    });
}

std::string grooveText(const char* what, double rod_mm, double radius_mm, double wire_mm) {
    return fmt::format("{}: groove {} wide, {} deep, wire {} thick", what, millimetres(2 * wire_mm),
                       millimetres(rod_mm - radius_mm + wire_mm), millimetres(2 * wire_mm));
}

}  // namespace

Result<Drawing> drawCorkscrew(const CorkscrewLayout& layout) {
    if (const Result<void> good = layout.validate(); !good) return good.error();
    const auto [rod_low, rod_high] = layout.rod_x_mm;
    const double low = std::min(rod_low, layout.shaft_x_mm[0]), high = std::max(rod_high, layout.shaft_x_mm[1]);
    const CorkscrewHelix& helix = layout.helix;

    // Places along the rod, from its left end.
    std::vector<std::pair<double, std::string>> places;
    for (std::size_t i = 0; i < layout.rings.size(); ++i)
        places.emplace_back(layout.rings[i].x_mm, fmt::format("ring {}", i + 1));
    places.emplace_back(helix.x_start_mm, "helix starts");
    places.emplace_back(helix.x_end_mm, "helix ends");
    places.emplace_back(0, "x = 0:");
    std::sort(places.begin(), places.end());

    std::vector<std::string> notes{
        "x counts from x = 0 to the right in the side view; angles from +y toward +z.",
        fmt::format("Helix: {} turns, {}-handed, from {} to {}.", millimetres(helix.turns), handText(helix.handedness),
                    placeAround(helix.phase_rad), placeAround(endPhase(helix))),
        groovesAreAlike(layout) ? "All grooves alike; ball-nosed cutter of the wire's thickness."
                                : grooveText("Helix", layout.rod_radius_mm, helix.radius_mm, helix.wire_radius_mm)};
    if (!groovesAreAlike(layout)) {
        for (std::size_t i = 0; i < layout.rings.size(); ++i) {
            notes.push_back(grooveText(fmt::format("Ring {}", i + 1).c_str(), layout.rod_radius_mm,
                                       layout.rings[i].radius_mm, layout.rings[i].wire_radius_mm));
        }
    }
    notes.push_back("Places along the rod matter most: 0.05 off costs up to 1.5 of depth. Measure the finished piece,");
    notes.push_back("write what was measured into the corkscrew's file, and use that file.");

    constexpr double kScales[] = {5, 2, 1};
    const double scale = *std::find_if(std::begin(kScales), std::end(kScales),
                                       [&](double s) { return s * (high - low) < 270 || s == 1; });
    constexpr double kAbove = 38, kLevel = 8, kTable = 6, kLeft = 10, kBetween = 34, kAfterEnd = 48;
    const double rod = scale * layout.rod_radius_mm;
    const double side_width = scale * (high - low), end_width = 2 * rod;
    const double dims = 12 + kLevel * static_cast<double>(places.size());
    const double beads = layout.beads.empty() ? 0 : 20 + kTable * static_cast<double>(layout.beads.size());
    const double groove_scale = std::clamp(std::floor(10 / helix.wire_radius_mm), 2.0, 20.0);
    const double groove_height =
        34 + groove_scale * (layout.rod_radius_mm - helix.radius_mm + 3 * helix.wire_radius_mm);
    const double title = Drawing::kTitleHeightMm + Drawing::kNoteMm * static_cast<double>(notes.size()) + 10;
    const double below = std::max({dims + beads, dims + title, groove_height + title});
    Drawing drawing(Vector2(kLeft + side_width + kBetween + end_width + kAfterEnd, kAbove + 2 * rod + below));

    const double top = drawing.size().y() - Drawing::kBorderMm;
    const Vector2 middle(Drawing::kBorderMm + kLeft - scale * low, top - kAbove - rod);
    drawing.text({Drawing::kBorderMm + kLeft, top - 8}, fmt::format("SIDE VIEW from +z, {}:1", scale), Align::left, 4);
    drawSide(drawing, layout, scale, middle);
    // Above: lengths. Below: every place from the rod's left end.
    const auto at = [&](double x, double y) { return Vector2(middle + scale * Vector2(x, y)); };
    const double radius = layout.rod_radius_mm;
    drawing.dimensionX(at(layout.shaft_x_mm[0], layout.shaft_radius_mm),
                       at(layout.shaft_x_mm[1], layout.shaft_radius_mm), at(0, radius).y() + 18,
                       "shaft " + millimetres(layout.shaft_x_mm[1] - layout.shaft_x_mm[0]));
    drawing.dimensionX(at(rod_low, radius), at(rod_high, radius), at(0, radius).y() + 8,
                       "rod " + millimetres(rod_high - rod_low));
    double level = at(0, -radius).y() - 4;
    for (const auto& [x, name] : places) {
        level -= kLevel;
        drawing.dimensionX(at(rod_low, -radius), at(x, -radius), level,
                           fmt::format("{} {}", name, millimetres(x - rod_low)));
    }
    const Vector2 end(Drawing::kBorderMm + kLeft + side_width + kBetween + rod, middle.y());
    drawing.text({end.x() - rod, top - 8}, fmt::format("END VIEW from +x, {}:1", scale), Align::left, 4);
    drawEnd(drawing, layout, scale, end);
    const double right = end.x() + rod + 8;
    drawing.text({right, end.y() - 12}, fmt::format("rod \xC3\x98 {}", millimetres(2 * radius)));
    drawing.text({right, end.y() - 18}, fmt::format("shaft \xC3\x98 {}", millimetres(2 * layout.shaft_radius_mm)));
    drawing.text({right, end.y() - 24}, fmt::format("wires' middle \xC3\x98 {}", millimetres(2 * helix.radius_mm)));

    // The groove under the end view.
    const Vector2 groove(end.x(), end.y() - rod - 30);
    drawing.text({end.x() - rod, groove.y() + 18}, fmt::format("GROOVE, {}:1", groove_scale), Align::left, 4);
    drawGroove(drawing, radius, helix.radius_mm, helix.wire_radius_mm, groove_scale, groove);

    if (!layout.beads.empty()) {
        const double left = Drawing::kBorderMm + kLeft;
        double y = level - 14;
        drawing.text({left, y}, "BEADS: drill to this depth under the surface, bead at the bottom", Align::left, 4);
        y -= 7;
        const double columns[] = {0, 16, 36, 58, 84, 110};
        const char* heads[] = {"bead", "x", "angle", "radius", "ball \xC3\x98", "depth"};
        for (std::size_t c = 0; c < std::size(columns); ++c)
            drawing.text({left + columns[c], y}, heads[c], Align::left, 2.8);
        for (std::size_t i = 0; i < layout.beads.size(); ++i) {
            const CorkscrewBead& bead = layout.beads[i];
            const double aside = bead.center_mm.tail<2>().norm();
            const std::string cells[] = {fmt::format("B{}", i + 1),
                                         millimetres(bead.center_mm.x()),
                                         placeAround(std::atan2(bead.center_mm.z(), bead.center_mm.y())),
                                         millimetres(aside),
                                         millimetres(2 * bead.radius_mm),
                                         millimetres(radius - aside + bead.radius_mm)};
            y -= kTable;
            for (std::size_t c = 0; c < std::size(columns); ++c)
                drawing.text({left + columns[c], y}, cells[c]);
        }
    }
    drawing.frame(
        {"Corkscrew: rod with shaft, rings and helix", fmt::format("{}:1", scale),
         fmt::format("rod {}, shaft and beads {}, wire {}", name(layout.rod), name(layout.shaft), name(layout.wire)),
         "ISO 2768-f; grooves along the rod \xC2\xB1"
         "0.02, around \xC2\xB1"
         "0.1\xC2\xB0",
         notes});
    return drawing;
}

Result<Drawing> drawCorkscrewTemplate(const CorkscrewLayout& layout) {
    if (const Result<void> good = layout.validate(); !good) return good.error();
    const auto [low, high] = layout.rod_x_mm;
    const double length = high - low, around = 2 * kPi * layout.rod_radius_mm;
    constexpr double kLeft = 24, kAbove = 14, kFlap = 8, kBelow = 4;
    const std::vector<std::string> notes{
        "Print in true size (100 %, not fitted to the page) and check the scale bar; cut out along the outline.",
        fmt::format(
            "Wrap round the rod of {} with the print outward, x toward the shaft's +x end; the flap goes under.",
            millimetres(2 * layout.rod_radius_mm)),
        "Lines are the middles of wires, crosses those of bead holes. Paper adds its thickness: measure the result."};
    const double title = Drawing::kTitleHeightMm + Drawing::kNoteMm * static_cast<double>(notes.size()) + 10;
    Drawing drawing(
        Vector2(std::max(kLeft + length + 24, Drawing::kTitleWidthMm), kAbove + around + kFlap + kBelow + title));
    const double top = drawing.size().y() - Drawing::kBorderMm - kAbove, left = Drawing::kBorderMm + kLeft;
    // Seen from outside with x to the right, angles grow downward.
    const auto at = [&](double x, double angle) { return Vector2(left + x - low, top - layout.rod_radius_mm * angle); };
    drawing.text({left, top + 8}, "UNROLLED SURFACE OF THE ROD, 1:1", Align::left, 4);
    drawing.rectangle(at(low, 2 * kPi), at(high, 0));
    drawing.rectangle(at(low, 2 * kPi) - Vector2(0, kFlap), at(high, 2 * kPi), Pen::thin);
    drawing.text(at(0.5 * (low + high), 2 * kPi) - Vector2(0, 0.5 * kFlap + 1), "flap", Align::middle, 2.8);
    for (int quarter = 0; quarter <= 4; ++quarter) {
        const double angle = 0.5 * kPi * quarter;
        drawing.text(at(low, angle) + Vector2(-2, -1.2), degrees(angle), Align::right);
        if (quarter % 4 != 0) drawing.line(at(low, angle), at(high, angle), Pen::center);
    }
    for (std::size_t i = 0; i < layout.rings.size(); ++i) {
        const double x = layout.rings[i].x_mm;
        drawing.line(at(x, 0), at(x, 2 * kPi));
        drawing.text(at(x, 0) + Vector2(0, 1.5), fmt::format("{}", i + 1), Align::middle, 2.8);
    }
    // The helix, a straight line from edge to edge.
    const CorkscrewHelix& helix = layout.helix;
    const double sense = helix.handedness == Handedness::right ? 1 : -1;
    std::vector<double> cuts{0, 1};
    const double from = helix.phase_rad / (2 * kPi), to = from + sense * helix.turns;
    for (double turn = std::ceil(std::min(from, to)); turn <= std::max(from, to); ++turn) {
        const double t = (turn - from) / (to - from);
        if (t > 1e-9 && t < 1 - 1e-9) cuts.push_back(t);
    }
    std::sort(cuts.begin(), cuts.end());
    for (std::size_t i = 0; i + 1 < cuts.size(); ++i) {
        const double whole = std::floor(from + (to - from) * 0.5 * (cuts[i] + cuts[i + 1]));
        const auto point = [&](double t) {
            return at(helix.x_start_mm + t * (helix.x_end_mm - helix.x_start_mm),
                      2 * kPi * (from + (to - from) * t - whole));
        };
        drawing.line(point(cuts[i]), point(cuts[i + 1]));
        if (i == 0) drawing.circle(point(0), helix.wire_radius_mm);
        if (i + 2 == cuts.size()) drawing.circle(point(1), helix.wire_radius_mm);
    }
    for (std::size_t i = 0; i < layout.beads.size(); ++i) {
        const CorkscrewBead& bead = layout.beads[i];
        double angle = std::atan2(bead.center_mm.z(), bead.center_mm.y());
        if (angle < 0) angle += 2 * kPi;
        const Vector2 place = at(bead.center_mm.x(), angle);
        drawing.circle(place, bead.radius_mm);
        drawing.centerMark(place, 2 * bead.radius_mm);
        drawing.text(place + Vector2(-2 * bead.radius_mm - 0.5, 1), fmt::format("B{}", i + 1), Align::right, 2.8);
    }
    drawing.dimensionY(at(high, 2 * kPi), at(high, 0), at(high, 0).x() + 10,
                       millimetres(std::round(around * 100) / 100));
    drawing.frame({"Corkscrew: paper template", "1:1", "paper", "check the 50 mm bar", notes});
    // Left of the title block: a check of the print.
    const Vector2 bar(left, Drawing::kBorderMm + title - 4);
    drawing.line(bar, bar + Vector2(50, 0));
    for (const double x : {0.0, 10.0, 20.0, 30.0, 40.0, 50.0})
        drawing.line(bar + Vector2(x, -1), bar + Vector2(x, 1));
    drawing.text(bar + Vector2(53, -1.2), "50 mm", Align::left, 2.8);
    return drawing;
}

}  // namespace fluorocut
