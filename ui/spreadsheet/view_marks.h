// What stands around an image: which way is which, how long is a millimetre and in which plane, what it is and how well
// its place is known. Painted by ImageView; all of it follows a flip.
#pragma once

#include <QRect>
#include <QString>
#include <QStringList>
#include <optional>

class QPainter;

namespace fluorocut::ui {

struct ViewMarks {
    // Letters at the image's own sides: R, L, A, P, H, F of the patient; empty: none.
    QString left, right, top, bottom;
    // Image pixels for a millimetre, and where that holds: "at the implant". Nothing: no scale bar.
    std::optional<double> px_per_mm;
    QString plane;
    // Lines below the title: pose, angles, error.
    QStringList header;
    // Why what is shown is no longer right; empty: it is.
    QString stale;
};

// The longest of 1, 2, 5 times a power of ten that is no longer than `most_px` on the screen.
double scaleBarLength(double screen_px_per_mm, double most_px);

// Text on a plate of its own, that can be read on black and on white.
void paintPlate(QPainter& painter, const QRect& area, int alignment, const QString& text);
// `area`: the view inside its margins; `screen_px_per_mm`: nothing without a scale.
void paintMarks(QPainter& painter, const QRect& area, const ViewMarks& marks, std::optional<double> screen_px_per_mm,
                bool flipped, int lines_above);

}  // namespace fluorocut::ui
