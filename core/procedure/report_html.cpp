#include "core/procedure/report_html.h"

#include <algorithm>
#include <cstdint>
#include <string_view>

#include <fmt/format.h>

#include "core/io/image_file.h"
#include "core/procedure/content.h"
#include "core/procedure/report_document.h"
#include "core/procedure/report_picture.h"

namespace fluorocut {
namespace {

constexpr const char* kStyle = R"css(
:root { --ink: #1f2933; --faint: #66717c; --line: #d5dbe1; --paper: #ffffff; --soft: #f4f6f8; --planned: #0072b2;
        --found: #d55e00; --good: #1b7f4d; --bad: #b3261e; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--soft); color: var(--ink); font: 16px/1.5 system-ui, "DejaVu Sans", sans-serif; }
main { max-width: 1080px; margin: 0 auto; padding: 24px; background: var(--paper); }
h1 { margin: 0; font-size: 28px; } h2 { margin: 36px 0 10px; font-size: 21px; border-bottom: 1px solid var(--line); }
.notice { color: var(--faint); margin: 2px 0 18px; }
.conclusion { padding: 14px 18px; border-left: 6px solid var(--good); background: #eaf5ef; font-size: 18px; }
.conclusion.open { border-color: var(--bad); background: #fbecea; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 4px 22px; margin: 14px 0; }
dt { color: var(--faint); } dd { margin: 0; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; margin: 10px 0; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: 6px 10px; border-bottom: 1px solid var(--line); vertical-align: top; }
th { color: var(--faint); font-weight: 600; } td.n, th.n { text-align: right; }
.yes { color: var(--good); } .no { color: var(--bad); font-weight: 600; }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(300px, 1fr)); gap: 16px; margin: 12px 0; }
figure { margin: 0; } figure div { position: relative; line-height: 0; background: #000; }
figure img { width: 100%; } figure svg { position: absolute; inset: 0; width: 100%; height: 100%; }
figcaption { color: var(--faint); padding-top: 6px; }
.curve { fill: none; stroke-width: 1.6px; vector-effect: non-scaling-stroke; }
.planned { stroke: #56b4e9; stroke-dasharray: 6 4; } .first { stroke: #f0e442; stroke-dasharray: 2 3; }
.found { stroke: #e69f00; }
.key { display: inline-block; width: 26px; border-top: 3px solid; vertical-align: middle; margin: 0 6px 0 14px; }
.bar { background: var(--planned); height: 14px; border-radius: 2px; }
.doubt { padding: 8px 14px; border-left: 5px solid var(--bad); background: #fbecea; margin: 8px 0; }
footer { color: var(--faint); margin-top: 40px; font-size: 13px; overflow-wrap: anywhere; }
@media print { body { background: none; } main { max-width: none; padding: 0; } tr, figure, dl { break-inside: avoid; } h2 { break-after: avoid; } }
)css";

std::string escaped(std::string_view text) {
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
                out += c;
        }
    }
    return out;
}

std::string base64(std::string_view bytes) {
    static constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    out.reserve((bytes.size() + 2) / 3 * 4);
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        std::uint32_t group = 0;
        for (std::size_t k = 0; k < 3; ++k)
            group = group << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
        for (std::size_t k = 0; k < 4; ++k)
            out += i + k > bytes.size() ? '=' : kDigits[group >> (18 - 6 * k) & 63U];
    }
    return out;
}

Result<std::string> pngOf(const ReportPicture& picture) {
    const Result<Image> grey = reportGrey(picture);
    if (!grey) return grey.error();
    ImageWriteOptions options;
    options.type = PixelType::uint8;
    options.window = std::pair(0.F, 255.F);
    return bytesOf("picture.png", [&](const std::filesystem::path& path) { return writeImage(path, *grey, options); });
}

Result<std::string> figure(const ReportPicture& picture) {
    const Result<std::string> png = pngOf(picture);
    if (!png) return png.error();
    std::string curves;
    for (const ReportCurve& curve : picture.curves) {
        std::string points;
        // Pixel centres are at integers, the picture's corner at (-0.5, -0.5).
        for (const Vector2& p : curve.points)
            points += fmt::format("{:.2f},{:.2f} ", p.x() + 0.5, p.y() + 0.5);
        curves += fmt::format(R"(<polyline class="curve {}" points="{}"/>)", lookOf(curve.kind).name, points);
    }
    return fmt::format(
        R"(<figure><div><img alt="{0}" src="data:image/png;base64,{1}"><svg viewBox="0 0 {2} {3}">{4}</svg></div>)"
        "<figcaption>{0}</figcaption></figure>\n",
        escaped(picture.title), base64(*png), picture.image.width(), picture.image.height(), curves);
}

std::string css(const ReportColor& color) {
    return fmt::format("#{:02x}{:02x}{:02x}", color[0], color[1], color[2]);
}

// One overload for each kind of block; fails where a picture cannot be encoded.

Result<std::string> block(const ReportText& text) {
    const bool conclusion = text.style == ReportText::Style::conclusion;
    const char* look = conclusion ? text.good ? " class=\"conclusion\"" : " class=\"conclusion open\""
                       : text.style == ReportText::Style::doubt ? " class=\"doubt\""
                                                                : "";
    return fmt::format("<p{}>{}</p>\n", look, escaped(text.text));
}

Result<std::string> block(const ReportFacts& facts) {
    std::string out = "<dl>";
    for (const auto& [what, value] : facts.rows)
        out += fmt::format("<dt>{}</dt><dd>{}</dd>", escaped(what), escaped(value));
    return out + "</dl>\n";
}

std::string cell(const ReportCell& cell, bool number) {
    if (cell.bar)
        return fmt::format(R"(<td style="width:50%"><div class="bar" style="width:{:.1f}%"></div></td>)",
                           100 * *cell.bar);
    const char* look = cell.tone == ReportCell::Tone::good  ? " class=\"yes\""
                       : cell.tone == ReportCell::Tone::bad ? " class=\"no\""
                       : number                             ? " class=\"n\""
                                                            : "";
    return fmt::format("<td{}>{}</td>", look, escaped(cell.text));
}

Result<std::string> block(const ReportTable& table) {
    std::string out = "<div class=\"wide\"><table>";
    if (std::any_of(table.columns.begin(), table.columns.end(), [](const auto& c) { return !c.title.empty(); })) {
        out += "<thead><tr>";
        for (const ReportTable::Column& column : table.columns)
            out += fmt::format("<th{}>{}</th>", column.number ? " class=\"n\"" : "", escaped(column.title));
        out += "</tr></thead>";
    }
    out += "<tbody>";
    for (const std::vector<ReportCell>& row : table.rows) {
        out += "<tr>";
        for (std::size_t i = 0; i < row.size(); ++i)
            out += cell(row[i], table.columns[i].number);
        out += "</tr>";
    }
    return out + "</tbody></table></div>\n";
}

Result<std::string> block(const ReportKey& key) {
    std::string out = "<p>";
    for (const ReportKey::Entry& entry : key.entries)
        out += fmt::format(R"(<span class="key" style="border-color:{}{}"></span>{})", css(entry.color),
                           entry.dashed ? ";border-top-style:dashed" : "", escaped(entry.label));
    return out + "</p>\n";
}

std::string shape(const ReportDrawing::Shape& s) {
    using Kind = ReportDrawing::Shape::Kind;
    const std::string color = css(s.color);
    switch (s.kind) {
        case Kind::line:
            return fmt::format(R"(<line x1="{}" y1="{}" x2="{}" y2="{}" stroke="{}" stroke-width="{}"/>)", s.x, s.y,
                               s.x + s.dx, s.y + s.dy, color, s.width);
        case Kind::rectangle:
            return fmt::format(R"(<rect x="{}" y="{}" width="{}" height="{}" fill="{}" opacity="{}"/>)", s.x, s.y, s.dx,
                               s.dy, color, s.opacity);
        case Kind::circle:
            return fmt::format(R"(<circle cx="{}" cy="{}" r="{}" fill="{}"/>)", s.x, s.y, s.dx, color);
        case Kind::cross:
            return fmt::format(
                R"(<path d="M {0} {1} l {2} {2} m 0 -{2} l -{2} {2}" stroke="{3}" stroke-width="{4}" fill="none"/>)",
                s.x - s.dx, s.y - s.dx, 2 * s.dx, color, s.width);
        case Kind::text:
            return fmt::format(R"(<text x="{}" y="{}" text-anchor="{}" font-size="{}" fill="{}">{}</text>)", s.x, s.y,
                               s.anchor == ReportDrawing::Shape::Anchor::end ? "end" : "middle", s.dx, color,
                               escaped(s.text));
    }
    return {};
}

Result<std::string> block(const ReportDrawing& drawing) {
    std::string out = fmt::format(R"(<svg viewBox="0 0 {0} {1}" width="{0}" height="{1}" role="img" aria-label="{2}">)",
                                  drawing.width, drawing.height, escaped(drawing.label));
    for (const ReportDrawing::Shape& s : drawing.shapes)
        out += shape(s);
    return out + "</svg>\n";
}

Result<std::string> block(const ReportPictures& pictures) {
    std::string out = "<div class=\"pictures\">";
    for (const ReportPicture& picture : *pictures.pictures) {
        Result<std::string> drawn = figure(picture);
        if (!drawn) return drawn.error();
        out += *drawn;
    }
    return out + "</div>\n";
}

}  // namespace

Result<std::string> html(const ProcedureReport& report) {
    const ReportDocument document = documentOf(report);
    std::string out = fmt::format(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
        "content=\"width=device-width\"><title>{0}</title><style>{1}</style></head><body><main>\n<h1>{0}</h1>"
        "<p class=\"notice\">{2}</p>\n",
        escaped(document.title), kStyle, escaped(document.notice));
    for (const ReportSection& section : document.sections) {
        out += "<section>";
        if (!section.title.empty()) out += fmt::format("<h2>{}</h2>\n", escaped(section.title));
        for (const ReportBlock& content : section.blocks) {
            Result<std::string> drawn = std::visit([](const auto& b) { return block(b); }, content);
            if (!drawn) return drawn.error();
            out += *drawn;
        }
        out += "</section>\n";
    }
    out += fmt::format("<footer>{}</footer>\n</main></body></html>\n", escaped(document.footer));
    return out;
}

}  // namespace fluorocut
