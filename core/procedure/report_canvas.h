// What reports are drawn on: pages of a PDF, or pixels. Lines, pictures, and text that is set by Pango: any script,
// wrapped. Used by this folder only. Coordinates in points (1/72 inch) of a page, or in pixels; y down.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "core/base/result.h"
#include "core/procedure/report_document.h"

namespace fluorocut {

struct TextLook {
    double size = 9;
    bool bold = false;
    ReportColor color = kReportInk;
    bool right = false;  // set to the right of its width
};

struct TextSize {
    double width = 0, height = 0, baseline = 0;  // baseline: of the first line, from the top
};

class ReportCanvas {
  public:
    static ReportCanvas pages(double width, double height);  // a PDF
    static ReportCanvas pixels(int width, int height);
    ~ReportCanvas();
    ReportCanvas(ReportCanvas&&) noexcept;

    // Wrapped at `width`; 0: one line.
    TextSize sizeOf(const std::string& text, const TextLook& look, double width = 0) const;
    double widestWord(const std::string& text, const TextLook& look) const;
    TextSize text(const std::string& text, const TextLook& look, double x, double y, double width = 0);
    void line(double x1, double y1, double x2, double y2, const ReportColor& color, double width, bool dashed = false);
    void rectangle(double x, double y, double width, double height, const ReportColor& color, double opacity = 1);
    void circle(double x, double y, double radius, const ReportColor& color);
    // grey: 0 to 255; curves in its pixels, pixel centres at integers. Lines are `line_width` wide.
    void picture(const Image& grey, const std::vector<ReportCurve>& curves, double x, double y, double width,
                 double line_width);

    // Of a PDF.
    void nextPage();
    void bookmark(const std::string& title, int page);  // pages from 1
    void describe(const std::string& title, const std::string& author);
    Result<std::string> finishPdf();

    ColorImage image() const;  // of pixels

  private:
    struct Inside;
    explicit ReportCanvas(std::unique_ptr<Inside> inside);
    std::unique_ptr<Inside> inside_;
};

}  // namespace fluorocut
