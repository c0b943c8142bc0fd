#include "core/procedure/report_html.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string_view>

#include <fmt/format.h>

#include "core/io/image_file.h"
#include "core/procedure/content.h"

namespace fluorocut {
namespace {

// Blue and orange differ with every kind of colour blindness (Okabe and Ito 2008).
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
table { border-collapse: collapse; width: 100%; margin: 10px 0; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: 6px 10px; border-bottom: 1px solid var(--line); vertical-align: top; }
th { color: var(--faint); font-weight: 600; } td.n, th.n { text-align: right; }
.yes { color: var(--good); } .no { color: var(--bad); font-weight: 600; }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(300px, 1fr)); gap: 16px; margin: 12px 0; }
figure { margin: 0; } figure div { position: relative; line-height: 0; background: #000; }
figure img { width: 100%; } figure svg { position: absolute; inset: 0; width: 100%; height: 100%; }
figcaption { color: var(--faint); padding-top: 6px; }
.curve { fill: none; stroke-width: 1.6px; vector-effect: non-scaling-stroke; }
.planned { stroke: #56b4e9; stroke-dasharray: 6 4; } .found { stroke: #e69f00; }
.key { display: inline-block; width: 26px; border-top: 3px solid; vertical-align: middle; margin: 0 6px 0 14px; }
.bar { background: var(--planned); height: 14px; border-radius: 2px; }
.doubt { padding: 8px 14px; border-left: 5px solid var(--bad); background: #fbecea; margin: 8px 0; }
footer { color: var(--faint); margin-top: 40px; font-size: 13px; overflow-wrap: anywhere; }
@media print { body { background: none; } main { max-width: none; padding: 0; } section { break-inside: avoid; } }
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

std::string length(double mm) {
    return std::isfinite(mm) ? fmt::format("{:.2f} mm", mm) : std::string("not known");
}

std::string angle(double degrees) {
    return std::isfinite(degrees) ? fmt::format("{:.2f}&deg;", degrees) : std::string("not known");
}

// Levels to grey as the eye takes them, by logarithm: equal thicknesses are equal steps.
Result<std::string> pngOf(const Image& image) {
    Image gray(image.width(), image.height());
    std::vector<float> sorted(image.pixels().begin(), image.pixels().end());
    if (sorted.empty()) return invalidInput("report", "a picture without pixels", "a picture");
    std::sort(sorted.begin(), sorted.end());
    const auto at = [&](double part) {
        return sorted[static_cast<std::size_t>(part * static_cast<double>(sorted.size() - 1))];
    };
    const float high = std::max(at(0.999), 1e-20F), low = std::max(at(0.001), 1e-4F * high);
    const float scale = 255 / std::max(std::log(high / low), 1e-6F);
    for (std::size_t i = 0; i < gray.pixels().size(); ++i)
        gray.pixels()[i] = scale * std::log(std::clamp(image.pixels()[i], low, high) / low);
    ImageWriteOptions options;
    options.type = PixelType::uint8;
    options.window = std::pair(0.F, 255.F);
    return bytesOf("picture.png", [&](const std::filesystem::path& path) { return writeImage(path, gray, options); });
}

Result<std::string> figure(const ReportPicture& picture) {
    const Result<std::string> png = pngOf(picture.image);
    if (!png) return png.error();
    std::string curves;
    for (const ReportCurve& curve : picture.curves) {
        std::string points;
        // Pixel centres are at integers, the picture's corner at (-0.5, -0.5).
        for (const Vector2& p : curve.points)
            points += fmt::format("{:.2f},{:.2f} ", p.x() + 0.5, p.y() + 0.5);
        curves += fmt::format(R"(<polyline class="curve {}" points="{}"/>)",
                              curve.kind == ReportCurve::Kind::planned ? "planned" : "found", points);
    }
    return fmt::format(
        R"(<figure><div><img alt="{0}" src="data:image/png;base64,{1}"><svg viewBox="0 0 {2} {3}">{4}</svg></div>)"
        "<figcaption>{0}</figcaption></figure>\n",
        escaped(picture.title), base64(*png), picture.image.width(), picture.image.height(), curves);
}

std::string list(const std::vector<std::pair<std::string, std::string>>& facts) {
    std::string out = "<dl>";
    for (const auto& [what, value] : facts)
        out += fmt::format("<dt>{}</dt><dd>{}</dd>", escaped(what), escaped(value));
    return out + "</dl>\n";
}

// Offsets from cut to cut on a logarithmic scale, with what was announced before each.
std::string chart(const std::vector<ReportStage>& stages) {
    constexpr double kLeft = 76, kTop = 14, kHeight = 220, kStep = 150;
    constexpr double kLeast = 0.01, kMost = 10;
    const double width = kLeft + kStep * static_cast<double>(std::max<std::size_t>(stages.size(), 1)) + 10;
    const auto y = [&](double mm) {
        return kTop + kHeight * std::log(kMost / std::clamp(mm, kLeast, kMost)) / std::log(kMost / kLeast);
    };
    std::string out = fmt::format(
        R"(<svg viewBox="0 0 {0} {1}" width="{0}" height="{1}" role="img" aria-label="Offset after each cut">)", width,
        kTop + kHeight + 34);
    for (const double mm : {0.01, 0.1, 1.0, 10.0}) {
        out += fmt::format(
            R"(<line x1="{0}" x2="{1}" y1="{2}" y2="{2}" stroke="#d5dbe1"/><text x="{3}" y="{4}" text-anchor="end" )"
            R"(font-size="14" fill="#66717c">{5:g} mm</text>)",
            kLeft, width, y(mm), kLeft - 8, y(mm) + 5, mm);
    }
    for (std::size_t i = 0; i < stages.size(); ++i) {
        const ReportStage& stage = stages[i];
        const double x = kLeft + kStep * (static_cast<double>(i) + 0.5);
        if (std::isfinite(stage.announced_mm)) {
            out += fmt::format(R"(<rect x="{}" y="{}" width="56" height="{}" fill="#0072b2" opacity="0.16"/>)"
                               R"(<line x1="{}" x2="{}" y1="{}" y2="{}" stroke="#0072b2" stroke-width="2"/>)",
                               x - 28, y(stage.announced_mm), kTop + kHeight - y(stage.announced_mm), x - 28, x + 28,
                               y(stage.announced_mm), y(stage.announced_mm));
        }
        if (std::isfinite(stage.measured.mm))
            out += fmt::format(R"(<circle cx="{}" cy="{}" r="6" fill="#d55e00"/>)", x, y(stage.measured.mm));
        if (stage.truth && std::isfinite(stage.truth->mm)) {
            out += fmt::format(
                R"(<path d="M {0} {1} l 8 8 m 0 -8 l -8 8" stroke="#1f2933" stroke-width="2.5" fill="none"/>)", x - 4,
                y(stage.truth->mm) - 4);
        }
        out += fmt::format(R"(<text x="{}" y="{}" text-anchor="middle" font-size="14">{}</text>)", x,
                           kTop + kHeight + 24, escaped(stage.name));
    }
    return out + "</svg>\n";
}

std::string stageTable(const std::vector<ReportStage>& stages) {
    const bool simulated =
        std::any_of(stages.begin(), stages.end(), [](const ReportStage& stage) { return stage.truth.has_value(); });
    std::string out =
        "<table><thead><tr><th>Cut</th><th class=\"n\">announced before it, 95 %</th><th class=\"n\">found off the "
        "plan</th><th class=\"n\">known to, 95 %</th>";
    if (simulated) out += "<th class=\"n\">truly off the plan (simulation)</th>";
    out += "</tr></thead><tbody>";
    for (const ReportStage& stage : stages) {
        out += fmt::format("<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}, {}</td><td class=\"n\">{}</td>",
                           escaped(stage.name), length(stage.announced_mm), length(stage.measured.mm),
                           angle(stage.measured.degrees), length(stage.measured_bound_mm));
        if (stage.truth)
            out += fmt::format("<td class=\"n\">{}, {}</td>", length(stage.truth->mm), angle(stage.truth->degrees));
        else if (simulated)
            out += "<td class=\"n\">not known</td>";
        out += "</tr>";
    }
    return out + "</tbody></table>\n";
}

Result<std::string> stageSection(const ReportStage& stage) {
    std::string out = fmt::format("<section><h2>{}</h2>", escaped(stage.name));
    for (const std::string& doubt : stage.doubts)
        out += fmt::format("<p class=\"doubt\">{}</p>", escaped(doubt));
    out += list(stage.facts);
    if (!stage.acceptance.empty()) {
        out += "<table><tbody>";
        for (const Judgement& judgement : stage.acceptance) {
            out += fmt::format("<tr><td class=\"{}\">{}</td><td>{}</td></tr>", judgement.accepted() ? "yes" : "no",
                               judgement.accepted() ? "good" : "not good", escaped(judgement.sentence()));
        }
        out += "</tbody></table>";
    }
    if (!stage.pictures.empty()) {
        out +=
            "<p><span class=\"key\" style=\"border-color:#56b4e9;border-top-style:dashed\"></span>planned"
            "<span class=\"key\" style=\"border-color:#e69f00\"></span>found</p><div class=\"pictures\">";
        for (const ReportPicture& picture : stage.pictures) {
            Result<std::string> drawn = figure(picture);
            if (!drawn) return drawn.error();
            out += *drawn;
        }
        out += "</div>";
    }
    return out + "</section>\n";
}

std::string budgetSection(const ProcedureReport& report) {
    if (report.budget.empty()) return {};
    std::string out = fmt::format("<section><h2>Where the first registration's error comes from</h2><p>{}</p><table>",
                                  escaped(report.budget_at));
    for (const ReportTerm& term : report.budget) {
        out += fmt::format(
            "<tr><td>{}</td><td class=\"n\">{:.0f} %</td><td style=\"width:50%\"><div class=\"bar\" "
            "style=\"width:{:.1f}%\"></div></td></tr>",
            escaped(term.name), 100 * term.share, 100 * std::clamp(term.share, 0.0, 1.0));
    }
    return out + "</table></section>\n";
}

std::string decisionSection(const std::vector<ReportDecision>& decisions) {
    if (decisions.empty()) return {};
    std::string out =
        "<section><h2>Decisions</h2><table><thead><tr><th>when (UTC)</th><th>step</th><th>decision</th><th>who</th>"
        "<th>why</th></tr></thead><tbody>";
    for (const ReportDecision& decision : decisions) {
        out += fmt::format("<tr><td>{}</td><td>{}</td><td class=\"{}\">{}</td><td>{}</td><td>{}</td></tr>",
                           escaped(decision.when), escaped(decision.step), decision.accepted ? "yes" : "no",
                           decision.accepted ? "accepted" : "refused", escaped(decision.who), escaped(decision.why));
    }
    return out + "</tbody></table></section>\n";
}

}  // namespace

Result<std::string> html(const ProcedureReport& report) {
    const std::string title = escaped(report.title);
    std::string out = fmt::format(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
        "content=\"width=device-width\"><title>{0}</title><style>{1}</style></head><body><main>\n<h1>{0}</h1>"
        "<p class=\"notice\">FluoroCut: research software, not a medical device</p>\n"
        "<p class=\"conclusion{2}\">{3}</p>\n",
        title, kStyle, report.finished ? "" : " open", escaped(report.conclusion));
    out += list(report.facts);
    if (!report.stages.empty()) {
        const bool simulated = std::any_of(report.stages.begin(), report.stages.end(),
                                           [](const ReportStage& stage) { return stage.truth.has_value(); });
        out += "<section><h2>From cut to cut</h2>" + chart(report.stages) +
               "<p><span class=\"key\" style=\"border-color:#0072b2\"></span>announced before the cut (95 %)"
               "<span class=\"key\" style=\"border-color:#d55e00\"></span>found after it" +
               (simulated ? "<span class=\"key\" style=\"border-color:#1f2933\"></span>truth of the simulation" : "") +
               "</p>" + stageTable(report.stages) + "</section>\n";
    }
    out += budgetSection(report);
    for (const ReportStage& stage : report.stages) {
        Result<std::string> section = stageSection(stage);
        if (!section) return section.error();
        out += *section;
    }
    out += decisionSection(report.decisions);
    out += fmt::format("<footer>{}. Case {}, newest record {}.</footer>\n</main></body></html>\n",
                       escaped(report.software), escaped(report.case_id), escaped(report.newest_hash));
    return out;
}

}  // namespace fluorocut
