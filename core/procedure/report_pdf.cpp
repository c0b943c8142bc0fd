#include "core/procedure/report_pdf.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include <fmt/format.h>

#include "core/procedure/report_canvas.h"
#include "core/procedure/report_document.h"
#include "core/procedure/report_picture.h"

namespace fluorocut {
namespace {

constexpr double kWidth = 595.28, kHeight = 841.89;  // A4, points
constexpr double kLeft = 48, kTop = 56, kBottom = kHeight - 52, kAcross = kWidth - 2 * kLeft;
constexpr double kGap = 9;  // below a block
constexpr double kBodySize = 9;
constexpr TextLook kBody{kBodySize}, kFaintBody{kBodySize, false, kReportFaint}, kSmall{7, false, kReportFaint},
    kHead{7.5, true, kReportFaint}, kCell{8};

// Puts blocks below each other, from page to page.
class Pages {
  public:
    // `pages`: how many there will be; 0: not known yet.
    Pages(const ReportDocument& document, int pages)
        : document_(document), canvas_(ReportCanvas::pages(kWidth, kHeight)), pages_(pages) {}

    Result<void> write() {
        canvas_.describe(document_.title, document_.notice);
        y_ += canvas_.text(document_.title, {20, true}, kLeft, y_, kAcross).height + 3;
        y_ += canvas_.text(document_.notice, kFaintBody, kLeft, y_, kAcross).height + 14;
        for (const ReportSection& section : document_.sections) {
            if (!section.title.empty()) heading(section.title, section.blocks);
            for (const ReportBlock& content : section.blocks) {
                Result<void> drawn = std::visit([&](const auto& b) { return block(b); }, content);
                if (!drawn) return drawn;
            }
        }
        foot();
        return {};
    }
    int pagesUsed() const { return page_; }
    Result<std::string> finish() { return canvas_.finishPdf(); }

  private:
    void foot() {
        const double y = kHeight - 34;
        canvas_.line(kLeft, y - 6, kLeft + kAcross, y - 6, kReportLine, 0.6);
        canvas_.text(document_.footer, kSmall, kLeft, y, kAcross - 60);
        canvas_.text(pages_ > 0 ? fmt::format("{} of {}", page_, pages_) : fmt::format("{}", page_),
                     {8, false, kReportFaint, true}, kLeft + kAcross - 60, y, 60);
    }

    void turnPage() {
        foot();
        canvas_.nextPage();
        ++page_;
        y_ = kTop;
        canvas_.text(document_.title, kSmall, kLeft, 30);
        canvas_.text(document_.notice, {7, false, kReportFaint, true}, kLeft + kAcross / 2, 30, kAcross / 2);
    }

    // A new page where there is no room for so much.
    bool need(double height) {
        if (y_ + height <= kBottom || y_ <= kTop) return false;
        turnPage();
        return true;
    }

    // Never alone at a page's end: pictures and drawings are kept with it.
    void heading(const std::string& title, const std::vector<ReportBlock>& blocks) {
        double with = 70;
        for (const ReportBlock& next : blocks) {
            if (const auto* drawing = std::get_if<ReportDrawing>(&next))
                with = 40 + drawing->height * scaleOf(*drawing);
            if (const auto* pictures = std::get_if<ReportPictures>(&next); pictures && &next - blocks.data() < 2)
                with = 60 + rowHeight(*pictures->pictures, 0);
        }
        y_ += 8;
        need(with);
        canvas_.bookmark(title, page_);
        y_ += canvas_.text(title, {13, true}, kLeft, y_, kAcross).height + 3;
        canvas_.line(kLeft, y_, kLeft + kAcross, y_, kReportLine, 0.8);
        y_ += 8;
    }

    Result<void> block(const ReportText& text) {
        if (text.text.empty()) return {};
        if (text.style == ReportText::Style::plain) {
            need(canvas_.sizeOf(text.text, kBody, kAcross).height);
            y_ += canvas_.text(text.text, kBody, kLeft, y_, kAcross).height + kGap;
            return {};
        }
        const bool conclusion = text.style == ReportText::Style::conclusion;
        const bool good = conclusion && text.good;
        const TextLook look{conclusion ? 11.0 : kBodySize};
        const double height = canvas_.sizeOf(text.text, look, kAcross - 28).height + 16;
        need(height);
        canvas_.rectangle(kLeft, y_, kAcross, height,
                          good ? ReportColor{0xea, 0xf5, 0xef} : ReportColor{0xfb, 0xec, 0xea});
        canvas_.rectangle(kLeft, y_, 4, height, good ? kReportGood : kReportBad);
        canvas_.text(text.text, look, kLeft + 16, y_ + 8, kAcross - 28);
        y_ += height + kGap;
        return {};
    }

    Result<void> block(const ReportFacts& facts) {
        double left = 0;
        for (const auto& [what, value] : facts.rows)
            left = std::max(left, canvas_.sizeOf(what, kFaintBody).width);
        left = std::min(left, 0.45 * kAcross);
        const double right = kAcross - left - 16;
        for (const auto& [what, value] : facts.rows) {
            const double height =
                std::max(canvas_.sizeOf(what, kFaintBody, left + 1).height, canvas_.sizeOf(value, kBody, right).height);
            need(height);
            canvas_.text(what, kFaintBody, kLeft, y_, left + 1);
            canvas_.text(value, kBody, kLeft + left + 16, y_, right);
            y_ += height + 2.5;
        }
        y_ += kGap - 2.5;
        return {};
    }

    // As wide as their content asks for; where that is too wide, words are wrapped in the widest.
    std::vector<double> columnWidths(const ReportTable& table) const {
        constexpr double kPadding = 12, kBar = 180;
        const std::size_t count = table.columns.size();
        std::vector<double> least(count), wanted(count);
        for (std::size_t c = 0; c < count; ++c) {
            const std::string& title = table.columns[c].title;
            least[c] = canvas_.widestWord(title, kHead);
            wanted[c] = std::min(canvas_.sizeOf(title, kHead).width, std::max(90.0, least[c]));
            for (const std::vector<ReportCell>& row : table.rows) {
                if (c >= row.size()) continue;
                least[c] = std::max(least[c], row[c].bar ? kBar : canvas_.widestWord(row[c].text, kCell));
                wanted[c] = std::max({wanted[c], least[c], canvas_.sizeOf(row[c].text, kCell).width});
            }
            least[c] += kPadding;
            wanted[c] += kPadding;
        }
        const double least_sum = std::accumulate(least.begin(), least.end(), 0.0);
        const double wanted_sum = std::accumulate(wanted.begin(), wanted.end(), 0.0);
        std::vector<double> widths(count);
        for (std::size_t c = 0; c < count; ++c) {
            if (wanted_sum <= kAcross)
                widths[c] = wanted[c] + (kAcross - wanted_sum) / static_cast<double>(count);
            else if (least_sum >= kAcross)
                widths[c] = least[c] * kAcross / least_sum;
            else
                widths[c] = least[c] + (wanted[c] - least[c]) * (kAcross - least_sum) / (wanted_sum - least_sum);
        }
        return widths;
    }

    double rowOf(const std::vector<ReportCell>& cells, const ReportTable& table, const std::vector<double>& widths,
                 const std::optional<TextLook>& head, bool draw) {
        double x = kLeft, height = 0;
        for (std::size_t c = 0; c < cells.size() && c < widths.size(); ++c) {
            TextLook look = head.value_or(kCell);
            if (cells[c].tone == ReportCell::Tone::good) look.color = kReportGood;
            if (cells[c].tone == ReportCell::Tone::bad) look.color = kReportBad, look.bold = true;
            look.right = table.columns[c].number;
            const double width = widths[c] - 12;
            height = std::max(height, canvas_.sizeOf(cells[c].text, look, width).height);
            if (draw && cells[c].bar)
                canvas_.rectangle(x + 6, y_ + 4.5, std::max(0.5, *cells[c].bar * width), 8, kReportBlue);
            else if (draw)
                canvas_.text(cells[c].text, look, x + 6, y_ + 3, width);
            x += widths[c];
        }
        return height + 6;
    }

    Result<void> block(const ReportTable& table) {
        const std::vector<double> widths = columnWidths(table);
        std::vector<ReportCell> head;
        bool titled = false;
        for (const ReportTable::Column& column : table.columns) {
            head.push_back({column.title});
            titled = titled || !column.title.empty();
        }
        const auto put = [&](const std::vector<ReportCell>& cells, const std::optional<TextLook>& look) {
            y_ += rowOf(cells, table, widths, look, true);
            canvas_.line(kLeft, y_, kLeft + kAcross, y_, kReportLine, look ? 0.9 : 0.5);
        };
        bool begun = false;
        need(std::min<double>(3, static_cast<double>(table.rows.size())) * 16 + 24);  // no single row at a page's end
        for (const std::vector<ReportCell>& row : table.rows) {
            const double height = rowOf(row, table, widths, std::nullopt, false);
            const double with_head = titled && !begun ? rowOf(head, table, widths, kHead, false) : 0;
            const bool turned = need(height + with_head);
            if (titled && (turned || !begun)) put(head, kHead);
            put(row, std::nullopt);
            begun = true;
        }
        y_ += kGap + 2;
        return {};
    }

    Result<void> block(const ReportKey& key) {
        need(140);  // a key stays with what it is the key of
        double x = kLeft;
        for (const ReportKey::Entry& entry : key.entries) {
            const double width = canvas_.sizeOf(entry.label, kBody).width;
            if (x > kLeft && x + 26 + width > kLeft + kAcross) {
                x = kLeft;
                y_ += 14;
            }
            canvas_.line(x, y_ + 6, x + 20, y_ + 6, entry.color, 2.2, entry.dashed);
            canvas_.text(entry.label, kBody, x + 26, y_);
            x += 26 + width + 18;
        }
        y_ += 12 + kGap;
        return {};
    }

    static double scaleOf(const ReportDrawing& drawing) { return std::min(0.72, kAcross / drawing.width); }

    Result<void> block(const ReportDrawing& drawing) {
        using Kind = ReportDrawing::Shape::Kind;
        const double k = scaleOf(drawing);
        need(k * drawing.height);
        for (const ReportDrawing::Shape& s : drawing.shapes) {
            const double x = kLeft + k * s.x, y = y_ + k * s.y;
            switch (s.kind) {
                case Kind::line:
                    canvas_.line(x, y, x + k * s.dx, y + k * s.dy, s.color, k * s.width);
                    break;
                case Kind::rectangle:
                    canvas_.rectangle(x, y, k * s.dx, k * s.dy, s.color, s.opacity);
                    break;
                case Kind::circle:
                    canvas_.circle(x, y, k * s.dx, s.color);
                    break;
                case Kind::cross:
                    canvas_.line(x - k * s.dx, y - k * s.dx, x + k * s.dx, y + k * s.dx, s.color, k * s.width);
                    canvas_.line(x - k * s.dx, y + k * s.dx, x + k * s.dx, y - k * s.dx, s.color, k * s.width);
                    break;
                case Kind::text: {
                    const TextLook look{k * s.dx, false, s.color};
                    const TextSize size = canvas_.sizeOf(s.text, look);
                    const double part = s.anchor == ReportDrawing::Shape::Anchor::end ? 1 : 0.5;
                    canvas_.text(s.text, look, x - part * size.width, y - size.baseline);
                    break;
                }
            }
        }
        y_ += k * drawing.height + kGap;
        return {};
    }

    // Two beside each other.
    static constexpr double kBetween = 12, kPicture = (kAcross - kBetween) / 2;

    static double rowHeight(const std::vector<ReportPicture>& pictures, std::size_t first) {
        double height = 0;
        for (std::size_t i = first; i < std::min(first + 2, pictures.size()); ++i) {
            const Image& image = pictures[i].image;
            if (!image.empty()) height = std::max(height, kPicture * image.height() / image.width());
        }
        return height + 16;
    }

    Result<void> block(const ReportPictures& block) {
        const std::vector<ReportPicture>& pictures = *block.pictures;
        for (std::size_t first = 0; first < pictures.size(); first += 2) {
            const double height = rowHeight(pictures, first);
            need(height);
            for (std::size_t i = first; i < std::min(first + 2, pictures.size()); ++i) {
                const Result<Image> grey = reportGrey(pictures[i]);
                if (!grey) return grey.error();
                const double x = kLeft + static_cast<double>(i - first) * (kPicture + kBetween);
                canvas_.picture(*grey, pictures[i].curves, x, y_, kPicture, 0.9);
                canvas_.text(pictures[i].title, {8, false, kReportFaint}, x, y_ + height - 14, kPicture);
            }
            y_ += height + kGap;
        }
        return {};
    }

    const ReportDocument& document_;
    ReportCanvas canvas_;
    int pages_ = 0, page_ = 1;
    double y_ = kTop - 8;
};

}  // namespace

Result<std::string> pdf(const ProcedureReport& report) {
    const ReportDocument document = documentOf(report);
    Pages counting(document, 0);
    if (Result<void> written = counting.write(); !written) return written.error();
    Pages pages(document, counting.pagesUsed());
    if (Result<void> written = pages.write(); !written) return written.error();
    return pages.finish();
}

}  // namespace fluorocut
