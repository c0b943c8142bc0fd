#include "ui/spreadsheet/view_marks.h"

#include <QObject>
#include <QPainter>
#include <algorithm>
#include <cmath>

namespace fluorocut::ui {
namespace {

constexpr QColor kText(225, 232, 238);

void paintLetter(QPainter& painter, const QRect& area, int alignment, const QString& letter) {
    if (letter.isEmpty()) return;
    painter.save();
    QFont font = painter.font();
    font.setBold(true);
    font.setPointSizeF(font.pointSizeF() * 1.3);
    painter.setFont(font);
    paintPlate(painter, area, alignment, letter);
    painter.restore();
}

void paintScale(QPainter& painter, const QRect& area, double screen_px_per_mm, const QString& plane) {
    const double mm = scaleBarLength(screen_px_per_mm, std::min(0.4 * area.width(), 160.0));
    const int length = static_cast<int>(std::lround(mm * screen_px_per_mm));
    const QString text =
        plane.isEmpty() ? QObject::tr("%1 mm").arg(mm) : QObject::tr("%1 mm %2").arg(QString::number(mm), plane);
    const int line = painter.fontMetrics().height() + 4;
    const QRect place(area.left(), area.bottom() - 2 * line - 8, area.width(), line);
    const int y = place.bottom() + 4, x = area.left() + 2;
    for (const auto& [color, off] : {std::pair(QColor(0, 0, 0, 160), 1), std::pair(kText, 0)}) {
        painter.setPen(color);
        painter.drawLine(x + off, y + off, x + length + off, y + off);
        painter.drawLine(x + off, y - 4 + off, x + off, y + 4 + off);
        painter.drawLine(x + length + off, y - 4 + off, x + length + off, y + 4 + off);
    }
    paintPlate(painter, place, Qt::AlignLeft | Qt::AlignVCenter, text);
}

}  // namespace

double scaleBarLength(double screen_px_per_mm, double most_px) {
    if (!(screen_px_per_mm > 0) || !(most_px > 0)) return 0;
    const double most_mm = most_px / screen_px_per_mm;
    const double power = std::pow(10, std::floor(std::log10(most_mm)));
    for (const double step : {5.0, 2.0, 1.0})
        if (step * power <= most_mm * (1 + 1e-12)) return step * power;
    return power;
}

void paintPlate(QPainter& painter, const QRect& area, int alignment, const QString& text) {
    if (text.isEmpty()) return;
    const QRect plate = painter.boundingRect(area, alignment, text).adjusted(-5, -2, 5, 2);
    painter.fillRect(plate, QColor(12, 15, 18, 170));
    painter.setPen(kText);
    painter.drawText(area, alignment, text);
}

void paintMarks(QPainter& painter, const QRect& area, const ViewMarks& marks, std::optional<double> screen_px_per_mm,
                bool flipped, int lines_above) {
    const QString& left = flipped ? marks.right : marks.left;
    const QString& right = flipped ? marks.left : marks.right;
    paintLetter(painter, area, Qt::AlignLeft | Qt::AlignVCenter, left);
    paintLetter(painter, area, Qt::AlignRight | Qt::AlignVCenter, right);
    paintLetter(painter, area, Qt::AlignHCenter | Qt::AlignTop, marks.top);
    paintLetter(painter, area, Qt::AlignHCenter | Qt::AlignBottom, marks.bottom);
    if (screen_px_per_mm) paintScale(painter, area, *screen_px_per_mm, marks.plane);

    const int line = painter.fontMetrics().height() + 4;
    QRect row(area.left(), area.top() + lines_above * line, area.width(), line);
    const auto next = [&](const QString& text) {
        paintPlate(painter, row, Qt::AlignLeft | Qt::AlignTop, text);
        row.translate(0, line);
    };
    for (const QString& text : marks.header)
        next(text);
    if (flipped) next(QObject::tr("Mirrored left to right"));
    if (!marks.stale.isEmpty()) {
        painter.setPen(QColor(230, 159, 0));
        const QRect band(0, area.bottom() - 4 * line, area.right() + area.left(), line + 6);
        painter.fillRect(band, QColor(60, 40, 0, 215));
        painter.drawText(band, Qt::AlignCenter, QObject::tr("Out of date: %1").arg(marks.stale));
    }
}

}  // namespace fluorocut::ui
