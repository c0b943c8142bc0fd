// What stands in a report, and in which order, without saying how it is drawn: the pages of HTML and of PDF are made of
// it, so that both tell the same. Text is UTF-8. Refers to the report, which outlives it.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "core/procedure/report_html.h"

namespace fluorocut {

using ReportColor = std::array<std::uint8_t, 3>;

// Blue and orange differ with every kind of colour blindness (Okabe and Ito 2008).
inline constexpr ReportColor kReportInk{0x1f, 0x29, 0x33}, kReportFaint{0x5c, 0x67, 0x72},
    kReportLine{0xd5, 0xdb, 0xe1}, kReportBlue{0x00, 0x72, 0xb2}, kReportRed{0xd5, 0x5e, 0x00},
    kReportGood{0x1b, 0x7f, 0x4d}, kReportBad{0xb3, 0x26, 0x1e};

struct CurveLook {
    const char* name;   // "planned"
    const char* label;  // in the key
    ReportColor color;
    bool dashed;
};
const CurveLook& lookOf(ReportCurve::Kind kind);

struct ReportText {
    enum class Style { plain, conclusion, doubt };
    std::string text;
    Style style = Style::plain;
    bool good = true;  // of a conclusion
};

struct ReportFacts {
    std::vector<std::pair<std::string, std::string>> rows;
};

struct ReportCell {
    enum class Tone { plain, good, bad };
    std::string text;
    Tone tone = Tone::plain;
    std::optional<double> bar = std::nullopt;  // instead of text: from 0 to 1
};

struct ReportTable {
    struct Column {
        std::string title;
        bool number = false;  // set to the right
    };
    std::vector<Column> columns;  // without any title: no head
    std::vector<std::vector<ReportCell>> rows;
};

struct ReportKey {
    struct Entry {
        std::string label;
        ReportColor color;
        bool dashed = false;
    };
    std::vector<Entry> entries;
};

// A drawing of simple shapes; y down.
struct ReportDrawing {
    struct Shape {
        enum class Kind { line, rectangle, circle, cross, text };
        enum class Anchor { middle, end };
        Kind kind = Kind::line;
        double x = 0, y = 0;    // a line's beginning, a rectangle's corner, a middle, a text's baseline
        double dx = 0, dy = 0;  // to a line's end, to the opposite corner; dx: a radius, a text's size
        ReportColor color = kReportInk;
        double opacity = 1, width = 1;
        std::string text = {};
        Anchor anchor = Anchor::middle;
    };
    std::string label;
    double width = 0, height = 0;
    std::vector<Shape> shapes;
};

struct ReportPictures {
    const std::vector<ReportPicture>* pictures = nullptr;
};

using ReportBlock = std::variant<ReportText, ReportFacts, ReportTable, ReportKey, ReportDrawing, ReportPictures>;

struct ReportSection {
    std::string title;  // of the first: empty
    std::vector<ReportBlock> blocks;
};

struct ReportDocument {
    std::string title, notice, footer;
    std::vector<ReportSection> sections;
};

ReportDocument documentOf(const ProcedureReport& report);

}  // namespace fluorocut
