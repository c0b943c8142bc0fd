// Drawing: one sheet of a workshop drawing, in true size, written as SVG and as DXF.
//
// Coordinates: mm on the paper, x to the right, y up, (0, 0) the lower left corner. A view is drawn at the scale its
// author says; what a dimension says is text and does not follow the scale.
//
// SVG: width and height in mm, the viewBox in the same mm, so that it prints in true size. DXF: R12 ASCII (AC1009),
// which every CAD and CAM program reads: LINE, CIRCLE, ARC, TEXT, SOLID on one layer per pen, drawing units mm.
//
// Text is UTF-8. DXF R12 knows of it the diameter, degree and plus-minus signs; other characters beyond ASCII become ?.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/geometry/rigid3.h"

namespace fluorocut {

// ISO 128: visible edges, thin lines (dimensions), hidden edges, centre lines, lettering.
enum class Pen { outline, thin, hidden, center, text };

enum class Align { left, middle, right };

// Everything but the size; empty fields are left blank.
struct TitleBlock {
    std::string title;
    std::string scale = "1:1";
    std::string material;
    std::string tolerance;
    std::vector<std::string> notes;  // written above the block, one line of at most 100 characters each
};

class Drawing {
  public:
    // A landscape sheet, the smallest of A4 to A0 that has this much room inside its border, and larger when even A0
    // has not. The title block takes the lower right corner of that room, notes the place above it.
    explicit Drawing(const Vector2& needed_mm);
    // The same for contents that depend on the height inside the border, as tables do that run into further columns.
    explicit Drawing(const std::function<Vector2(double inner_height_mm)>& needed_mm);

    Vector2 size() const { return size_; }
    static constexpr double kBorderMm = 10;
    static constexpr double kTitleWidthMm = 180;
    static constexpr double kTitleHeightMm = 40;
    static constexpr double kTextMm = 3.5;
    static constexpr double kNoteMm = 5.2;  // a line of notes

    void line(const Vector2& from, const Vector2& to, Pen pen = Pen::outline);
    void polyline(const std::vector<Vector2>& points, bool closed, Pen pen = Pen::outline);
    void rectangle(const Vector2& low, const Vector2& high, Pen pen = Pen::outline);
    void circle(const Vector2& center, double radius, Pen pen = Pen::outline);
    // Counter-clockwise from one angle to the other, seen with y up.
    void arc(const Vector2& center, double radius, double from_rad, double to_rad, Pen pen = Pen::outline);
    // `at` is on the base line.
    void text(const Vector2& at, const std::string& text, Align align = Align::left, double height = kTextMm,
              double rotation_rad = 0);

    // Between two points, measured along x with its line at height y, or along y with its line at x. Where there is no
    // room between the arrows the text stands beyond the second point.
    void dimensionX(const Vector2& a, const Vector2& b, double y, const std::string& text);
    void dimensionY(const Vector2& a, const Vector2& b, double x, const std::string& text);
    // An arrow to a point and a text beside its other end.
    void leader(const Vector2& point, const Vector2& elbow, const std::string& text);
    // Two crossed centre lines that reach beyond a circle.
    void centerMark(const Vector2& center, double reach);
    // Border, title block with units and projection symbol (first angle), notes.
    void frame(const TitleBlock& block);

    // About how wide a text is.
    static double textWidth(const std::string& text, double height = kTextMm);

    std::string svg() const;
    std::string dxf() const;

    struct Line {
        Vector2 from, to;
        Pen pen;
    };
    struct Circle {
        Vector2 center;
        double radius;
        Pen pen;
    };
    struct Arc {
        Vector2 center;
        double radius, from_rad, to_rad;
        Pen pen;
    };
    struct Text {
        Vector2 at;
        std::string text;
        Align align;
        double height, rotation_rad;
    };
    using Arrow = std::vector<Vector2>;  // three corners, filled
    const std::vector<Line>& lines() const { return lines_; }
    const std::vector<Circle>& circles() const { return circles_; }
    const std::vector<Text>& texts() const { return texts_; }

  private:
    void arrow(const Vector2& tip, const Vector2& direction);
    void dimension(const Vector2& a, const Vector2& b, const Vector2& on_a, const Vector2& on_b,
                   const std::string& text);

    Vector2 size_;
    std::vector<Line> lines_;
    std::vector<Circle> circles_;
    std::vector<Arc> arcs_;
    std::vector<Text> texts_;
    std::vector<Arrow> arrows_;
};

// "6.35", "1.5875", "12": without trailing zeros, to a micron's tenth.
std::string millimetres(double mm);

// The same with inches in brackets, as "6.35 [1/4"]", when it is a whole number of 64ths of an inch.
std::string millimetresAndInches(double mm);
bool isWholeInches64(double mm);

}  // namespace fluorocut
