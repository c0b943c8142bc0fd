#include "core/fabrication/drawing.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <stdexcept>

#include <fmt/format.h>

#include "core/base/units.h"

namespace fluorocut {
namespace {

constexpr double kArrowMm = 3, kArrowHalfWidthMm = 0.5;
constexpr double kGapMm = 1, kOverhangMm = 1.5;  // of an extension line at the object and beyond the dimension line
constexpr double kTailMm = 7;                    // of arrows that stand outside

struct PenStyle {
    const char* name;   // of the SVG class and of the DXF layer
    const char* style;  // SVG
    const char* line_type;
    int color;  // DXF: 7 black, others tell pens apart on a screen
};
constexpr PenStyle kPens[] = {{"OUTLINE", "stroke-width:0.5", "CONTINUOUS", 7},
                              {"THIN", "stroke-width:0.2", "CONTINUOUS", 3},
                              {"HIDDEN", "stroke-width:0.25;stroke-dasharray:2.5 1.2", "DASHED", 5},
                              {"CENTER", "stroke-width:0.2;stroke-dasharray:7 1.2 1.2 1.2", "CENTER", 1},
                              {"TEXT", "stroke-width:0.25", "CONTINUOUS", 2}};
const PenStyle& styleOf(Pen pen) {
    return kPens[static_cast<std::size_t>(pen)];
}

std::string xmlEscaped(const std::string& text) {
    std::string out;
    for (const char c : text) {
        switch (c) {
            case '&':
                out += "&amp;";
                break;
            case '<':
                out += "&lt;";
                break;
            case '>':
                out += "&gt;";
                break;
            case '"':
                out += "&quot;";
                break;
            default:
                out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
        }
    }
    return out;
}

std::string dxfEscaped(const std::string& text) {
    static const std::pair<const char*, const char*> kSigns[] = {
        {"\xE2\x8C\x80", "%%c"}, {"\xC3\x98", "%%c"}, {"\xC2\xB0", "%%d"}, {"\xC2\xB1", "%%p"}};
    std::string out;
    for (std::size_t i = 0; i < text.size();) {
        const auto sign = std::find_if(std::begin(kSigns), std::end(kSigns), [&](const auto& known) {
            return text.compare(i, std::char_traits<char>::length(known.first), known.first) == 0;
        });
        const auto c = static_cast<unsigned char>(text[i]);
        if (sign != std::end(kSigns)) {
            out += sign->second;
            i += std::char_traits<char>::length(sign->first);
        } else {
            if (c >= 0x20 && c < 0x7F) {
                out += text[i];
            } else if (c < 0x80 || c >= 0xC0) {  // one sign for the whole of a character
                out += '?';
            }
            ++i;
        }
    }
    return out;
}

// Without exponents, which R12 readers need not know.
std::string number(double value) {
    std::string text = fmt::format("{:.6f}", value);
    text.erase(text.find_last_not_of('0') + 1);
    if (text.back() == '.') text.pop_back();
    return text == "-0" ? "0" : text;
}

}  // namespace

std::string millimetres(double mm) {
    std::string text = fmt::format("{:.4f}", mm);
    text.erase(text.find_last_not_of('0') + 1);
    if (text.back() == '.') text.pop_back();
    return text == "-0" ? "0" : text;
}

bool isWholeInches64(double mm) {
    const double parts = mm / 25.4 * 64;
    return std::abs(parts) >= 0.5 && std::abs(parts - std::round(parts)) < 1e-6;
}

std::string millimetresAndInches(double mm) {
    std::string text = millimetres(mm);
    if (!isWholeInches64(mm)) return text;
    const auto parts = static_cast<long>(std::lround(mm / 25.4 * 64));
    const long whole = parts / 64, rest = parts % 64;
    std::string inches = whole != 0 || rest == 0 ? std::to_string(whole) : std::string();
    if (rest != 0) {
        const long common = std::gcd(rest, 64L);
        inches += fmt::format("{}{}/{}", inches.empty() ? "" : " ", rest / common, 64 / common);
    }
    return text + " [" + inches + "\"]";
}

Drawing::Drawing(const Vector2& needed_mm) : Drawing([&](double) { return needed_mm; }) {}

Drawing::Drawing(const std::function<Vector2(double)>& needed_mm) {
    const Vector2 borders = Vector2::Constant(2 * kBorderMm);
    for (const Vector2& sheet :
         {Vector2(297, 210), Vector2(420, 297), Vector2(594, 420), Vector2(841, 594), Vector2(1189, 841)}) {
        const Vector2 needed = needed_mm(sheet.y() - borders.y()) + borders;
        if (!(needed.allFinite() && (needed.array() > 0).all() && (needed.array() < 1e5).all()))
            throw std::logic_error("Drawing: a size that is not one");
        size_ = sheet.cwiseMax(needed);
        if (size_ == sheet) return;
    }
}

void Drawing::line(const Vector2& from, const Vector2& to, Pen pen) {
    lines_.push_back({from, to, pen});
}

void Drawing::polyline(const std::vector<Vector2>& points, bool closed, Pen pen) {
    for (std::size_t i = 0; i + 1 < points.size(); ++i)
        line(points[i], points[i + 1], pen);
    if (closed && points.size() > 2) line(points.back(), points.front(), pen);
}

void Drawing::rectangle(const Vector2& low, const Vector2& high, Pen pen) {
    polyline({low, {high.x(), low.y()}, high, {low.x(), high.y()}}, true, pen);
}

void Drawing::circle(const Vector2& center, double radius, Pen pen) {
    circles_.push_back({center, radius, pen});
}

void Drawing::arc(const Vector2& center, double radius, double from_rad, double to_rad, Pen pen) {
    arcs_.push_back({center, radius, from_rad, to_rad, pen});
}

void Drawing::text(const Vector2& at, const std::string& words, Align align, double height, double rotation_rad) {
    texts_.push_back({at, words, align, height, rotation_rad});
}

double Drawing::textWidth(const std::string& text, double height) {
    const auto characters = std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; });
    return 0.6 * height * static_cast<double>(characters);
}

void Drawing::arrow(const Vector2& tip, const Vector2& direction) {
    const Vector2 back = tip - kArrowMm * direction, side(-direction.y(), direction.x());
    arrows_.push_back({tip, back + kArrowHalfWidthMm * side, back - kArrowHalfWidthMm * side});
}

// The dimension line runs from on_a to on_b.
void Drawing::dimension(const Vector2& a, const Vector2& b, const Vector2& on_a, const Vector2& on_b,
                        const std::string& words) {
    for (const auto& [point, end] : {std::pair(a, on_a), std::pair(b, on_b)}) {
        const Vector2 away = end - point;
        if (away.norm() < 2 * kGapMm) continue;
        const Vector2 unit = away.normalized();
        line(point + kGapMm * unit, end + kOverhangMm * unit, Pen::thin);
    }
    const double length = (on_b - on_a).norm(), wide = textWidth(words);
    const Vector2 along = length > 0 ? Vector2((on_b - on_a) / length) : Vector2(1, 0);
    const bool vertical = std::abs(along.y()) > std::abs(along.x());
    const double turn = vertical ? radiansFromDegrees(90) : 0;
    const Vector2 above = vertical ? Vector2(-kGapMm, 0) : Vector2(0, kGapMm);
    if (length > wide + 2 * kArrowMm) {
        line(on_a, on_b, Pen::thin);
        arrow(on_a, -along);
        arrow(on_b, along);
        text(0.5 * (on_a + on_b) + above, words, Align::middle, kTextMm, turn);
        return;
    }
    const bool room_for_arrows = length > 3 * kArrowMm;
    line(on_a - (room_for_arrows ? 0 : kTailMm) * along, on_b + (kArrowMm + kGapMm + wide) * along, Pen::thin);
    arrow(on_a, room_for_arrows ? Vector2(-along) : along);
    arrow(on_b, room_for_arrows ? along : Vector2(-along));
    // A turned text reads upward: it begins at the lower end.
    const bool reads_backward = vertical ? along.y() < 0 : along.x() < 0;
    text(on_b + (kArrowMm + kGapMm) * along + above, words, reads_backward ? Align::right : Align::left, kTextMm, turn);
}

void Drawing::dimensionX(const Vector2& a, const Vector2& b, double y, const std::string& words) {
    dimension(a, b, {a.x(), y}, {b.x(), y}, words);
}

void Drawing::dimensionY(const Vector2& a, const Vector2& b, double x, const std::string& words) {
    dimension(a, b, {x, a.y()}, {x, b.y()}, words);
}

void Drawing::leader(const Vector2& point, const Vector2& elbow, const std::string& words) {
    line(point, elbow, Pen::thin);
    arrow(point, (point - elbow).normalized());
    const bool right = elbow.x() >= point.x();
    const double shelf = (right ? 1 : -1) * (textWidth(words) + 2 * kGapMm);
    line(elbow, elbow + Vector2(shelf, 0), Pen::thin);
    text(elbow + Vector2(right ? kGapMm : -kGapMm, kGapMm), words, right ? Align::left : Align::right);
}

void Drawing::centerMark(const Vector2& center, double reach) {
    line(center - Vector2(reach, 0), center + Vector2(reach, 0), Pen::center);
    line(center - Vector2(0, reach), center + Vector2(0, reach), Pen::center);
}

void Drawing::frame(const TitleBlock& block) {
    const Vector2 low(kBorderMm, kBorderMm), high = size_ - low;
    rectangle(low, high);
    const Vector2 corner(high.x() - kTitleWidthMm, low.y());
    rectangle(corner, {high.x(), low.y() + kTitleHeightMm});
    const auto field = [&](double x, double y, const char* label, const std::string& value, double height) {
        text(corner + Vector2(x + 2, y + 7), label, Align::left, 2);
        text(corner + Vector2(x + 2, y + 2), value, Align::left, height);
    };
    for (const double y : {10.0, 20.0, 30.0})
        line(corner + Vector2(0, y), corner + Vector2(kTitleWidthMm, y), Pen::thin);
    for (const double x : {60.0, 90.0, 130.0})
        line(corner + Vector2(x, 0), corner + Vector2(x, 10), Pen::thin);
    field(0, 30, "TITLE", block.title, 4);
    field(0, 20, "MATERIAL", block.material, kTextMm);
    field(0, 10, "TOLERANCES", block.tolerance, 2.8);
    field(0, 0, "MADE WITH", "FluoroCut, research software", 2.8);
    field(60, 0, "UNITS", "mm", kTextMm);
    field(90, 0, "SCALE", block.scale, kTextMm);
    // First angle: the truncated cone's side view, then the view from its left.
    text(corner + Vector2(132, 7), "PROJECTION", Align::left, 2);
    const Vector2 cone = corner + Vector2(155, 5);
    polyline({cone + Vector2(0, -1.5), cone + Vector2(7, -3), cone + Vector2(7, 3), cone + Vector2(0, 1.5)}, true,
             Pen::thin);
    line(cone + Vector2(-1.5, 0), cone + Vector2(8.5, 0), Pen::center);
    circle(cone + Vector2(14, 0), 3, Pen::thin);
    circle(cone + Vector2(14, 0), 1.5, Pen::thin);
    centerMark(cone + Vector2(14, 0), 4);
    double y = corner.y() + kTitleHeightMm + 3;
    for (auto note = block.notes.rbegin(); note != block.notes.rend(); ++note) {
        text({corner.x(), y}, *note, Align::left, 2.8);
        y += kNoteMm;
    }
}

std::string Drawing::svg() const {
    const auto y = [&](double up) { return number(size_.y() - up); };
    std::string out = fmt::format(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}mm\" height=\"{1}mm\" viewBox=\"0 0 {0} {1}\">\n<style>"
        "path,circle{{fill:none;stroke:#000;stroke-linecap:round}}\n"
        "text{{font-family:'DejaVu Sans',Arial,sans-serif;fill:#000}}\n.ARROW{{fill:#000;stroke:none}}",
        number(size_.x()), number(size_.y()));
    for (const PenStyle& pen : kPens)
        out += fmt::format("\n.{}{{{}}}", pen.name, pen.style);
    out += fmt::format("</style>\n<rect width=\"{}\" height=\"{}\" fill=\"#fff\"/>\n", number(size_.x()),
                       number(size_.y()));
    for (const Line& l : lines_)
        out += fmt::format("<path class=\"{}\" d=\"M{} {}L{} {}\"/>\n", styleOf(l.pen).name, number(l.from.x()),
                           y(l.from.y()), number(l.to.x()), y(l.to.y()));
    for (const Circle& c : circles_)
        out += fmt::format("<circle class=\"{}\" cx=\"{}\" cy=\"{}\" r=\"{}\"/>\n", styleOf(c.pen).name,
                           number(c.center.x()), y(c.center.y()), number(c.radius));
    for (const Arc& a : arcs_) {
        const auto at = [&](double angle) {
            return Vector2(a.center + a.radius * Vector2(std::cos(angle), std::sin(angle)));
        };
        const Vector2 from = at(a.from_rad), to = at(a.to_rad);
        const bool large = std::remainder(a.to_rad - a.from_rad, 2 * std::numbers::pi) < 0;
        out +=
            fmt::format("<path class=\"{}\" d=\"M{} {}A{} {} 0 {} 0 {} {}\"/>\n", styleOf(a.pen).name, number(from.x()),
                        y(from.y()), number(a.radius), number(a.radius), large ? 1 : 0, number(to.x()), y(to.y()));
    }
    for (const Arrow& a : arrows_)
        out += fmt::format("<path class=\"ARROW\" d=\"M{} {}L{} {}L{} {}Z\"/>\n", number(a[0].x()), y(a[0].y()),
                           number(a[1].x()), y(a[1].y()), number(a[2].x()), y(a[2].y()));
    static constexpr const char* kAnchors[] = {"start", "middle", "end"};
    for (const Text& t : texts_) {
        // A font's size is about 1.38 times the height of its capitals.
        const std::string turn = t.rotation_rad == 0 ? std::string()
                                                     : fmt::format(" transform=\"rotate({} {} {})\"",
                                                                   number(-degreesFromRadians(t.rotation_rad)),
                                                                   number(t.at.x()), y(t.at.y()));
        out +=
            fmt::format("<text x=\"{}\" y=\"{}\" font-size=\"{}\" text-anchor=\"{}\"{}>{}</text>\n", number(t.at.x()),
                        y(t.at.y()), number(t.height), kAnchors[static_cast<int>(t.align)], turn, xmlEscaped(t.text));
    }
    return out + "</svg>\n";
}

std::string Drawing::dxf() const {
    std::string out;
    const auto group = [&](int code, const std::string& value) { out += fmt::format("{:3d}\n{}\n", code, value); };
    const auto point = [&](int code, const Vector2& p) {
        group(code, number(p.x()));
        group(code + 10, number(p.y()));
        group(code + 20, "0");
    };
    const auto entity = [&](const char* kind, Pen pen) {
        group(0, kind);
        group(8, styleOf(pen).name);
    };
    group(999, "FluoroCut: drawing units are mm, true size");
    group(0, "SECTION");
    group(2, "HEADER");
    group(9, "$ACADVER");
    group(1, "AC1009");
    group(9, "$EXTMIN");
    point(10, Vector2::Zero());
    group(9, "$EXTMAX");
    point(10, size_);
    group(9, "$LIMMIN");
    group(10, "0");
    group(20, "0");
    group(9, "$LIMMAX");
    group(10, number(size_.x()));
    group(20, number(size_.y()));
    group(0, "ENDSEC");
    group(0, "SECTION");
    group(2, "TABLES");
    struct LineType {
        const char *name, *looks;
        std::vector<double> dashes;
    };
    const std::vector<LineType> types{{"CONTINUOUS", "Solid line", {}},
                                      {"DASHED", "__ __ __", {2.5, -1.2}},
                                      {"CENTER", "____ _ ____", {7, -1.2, 1.2, -1.2}}};
    group(0, "TABLE");
    group(2, "LTYPE");
    group(70, std::to_string(types.size()));
    for (const LineType& type : types) {
        group(0, "LTYPE");
        group(2, type.name);
        group(70, "0");
        group(3, type.looks);
        group(72, "65");
        group(73, std::to_string(type.dashes.size()));
        double total = 0;
        for (const double dash : type.dashes)
            total += std::abs(dash);
        group(40, number(total));
        for (const double dash : type.dashes)
            group(49, number(dash));
    }
    group(0, "ENDTAB");
    group(0, "TABLE");
    group(2, "LAYER");
    group(70, std::to_string(std::size(kPens)));
    for (const PenStyle& pen : kPens) {
        group(0, "LAYER");
        group(2, pen.name);
        group(70, "0");
        group(62, std::to_string(pen.color));
        group(6, pen.line_type);
    }
    group(0, "ENDTAB");
    group(0, "TABLE");
    group(2, "STYLE");
    group(70, "1");
    group(0, "STYLE");
    group(2, "STANDARD");
    group(70, "0");
    group(40, "0");
    group(41, "1");
    group(50, "0");
    group(71, "0");
    group(42, "3.5");
    group(3, "txt");
    group(4, "");
    group(0, "ENDTAB");
    group(0, "ENDSEC");
    group(0, "SECTION");
    group(2, "ENTITIES");
    for (const Line& l : lines_) {
        entity("LINE", l.pen);
        point(10, l.from);
        point(11, l.to);
    }
    for (const Circle& c : circles_) {
        entity("CIRCLE", c.pen);
        point(10, c.center);
        group(40, number(c.radius));
    }
    for (const Arc& a : arcs_) {
        entity("ARC", a.pen);
        point(10, a.center);
        group(40, number(a.radius));
        group(50, number(degreesFromRadians(a.from_rad)));
        group(51, number(degreesFromRadians(a.to_rad)));
    }
    for (const Arrow& a : arrows_) {
        entity("SOLID", Pen::thin);
        point(10, a[0]);
        point(11, a[1]);
        point(12, a[2]);
        point(13, a[2]);
    }
    for (const Text& t : texts_) {
        entity("TEXT", Pen::text);
        point(10, t.at);
        group(40, number(0.72 * t.height));  // height of capitals
        group(1, dxfEscaped(t.text));
        if (t.rotation_rad != 0) group(50, number(degreesFromRadians(t.rotation_rad)));
        if (t.align != Align::left) {
            group(72, std::to_string(static_cast<int>(t.align)));
            point(11, t.at);
        }
    }
    group(0, "ENDSEC");
    group(0, "EOF");
    return out;
}

}  // namespace fluorocut
