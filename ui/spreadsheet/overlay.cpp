#include "ui/spreadsheet/overlay.h"

#include <QPainter>
#include <QPolygonF>

namespace fluorocut::ui {
namespace {

constexpr double kMark = 6;  // half a cross, radius of a ring
constexpr QColor kHalo(0, 0, 0, 150);

QPen penOf(Ink ink, bool hidden) {
    QPen pen(colorOf(ink), 1);
    switch (ink) {
        case Ink::stage:
        case Ink::predicted:
            pen.setStyle(Qt::DashLine);
            break;
        case Ink::axis:
            pen.setStyle(Qt::DashDotLine);
            break;
        case Ink::uncertainty:
            pen.setStyle(Qt::DotLine);
            break;
        default:
            break;
    }
    if (hidden) {
        pen.setStyle(Qt::DotLine);
        QColor faint = pen.color();
        faint.setAlpha(150);
        pen.setColor(faint);
    }
    return pen;
}

// A pen of width 2 takes nine times as long as two passes of width 1, half a pixel apart about the line.
void stroke(QPainter& painter, const QPolygonF& line, const QPen& pen, bool hidden) {
    painter.setPen(QPen(kHalo, 1));
    painter.drawPolyline(line.translated(1, 1));
    painter.setPen(pen);
    if (hidden) {
        painter.drawPolyline(line);
        return;
    }
    painter.drawPolyline(line.translated(-0.25, -0.25));
    painter.drawPolyline(line.translated(0.25, 0.25));
}

void paintCurve(QPainter& painter, const OverlayCurve& curve, const QTransform& widget_from_image) {
    const QPen pen = penOf(curve.ink, curve.hidden);
    QPolygonF run;
    const auto flush = [&] {
        if (run.size() > 1) stroke(painter, run, pen, curve.hidden);
        run.clear();
    };
    const std::size_t n = curve.points_px.size();
    for (std::size_t i = 0; i < n + (curve.closed && n > 2 ? 1 : 0); ++i) {
        const Vector2& p = curve.points_px[i % n];
        if (p.allFinite())
            run << widget_from_image.map(QPointF(p.x(), p.y()));
        else
            flush();
    }
    flush();
}

void paintMark(QPainter& painter, const OverlayMark& mark, const QTransform& widget_from_image) {
    if (!mark.at_px.allFinite()) return;
    const QPointF at = widget_from_image.map(QPointF(mark.at_px.x(), mark.at_px.y()));
    const auto draw = [&](const QPointF& p) {
        switch (mark.shape) {
            case MarkShape::cross:
                painter.drawLine(p - QPointF(kMark, 0), p + QPointF(kMark, 0));
                painter.drawLine(p - QPointF(0, kMark), p + QPointF(0, kMark));
                break;
            case MarkShape::dot:
                painter.drawEllipse(p, 3, 3);
                break;
            case MarkShape::ring:
                painter.drawEllipse(p, kMark, kMark);
                break;
        }
    };
    const QColor color = colorOf(mark.ink);
    painter.setBrush(Qt::NoBrush);
    painter.setPen(QPen(kHalo, 1));
    draw(at + QPointF(1, 1));
    if (mark.shape == MarkShape::dot) painter.setBrush(color);
    painter.setPen(QPen(color, 1));
    draw(at);
    painter.setBrush(Qt::NoBrush);
    if (mark.name.isEmpty()) return;
    painter.setPen(QPen(kHalo, 1));
    painter.drawText(at + QPointF(kMark + 4, -kMark + 1), mark.name);
    painter.setPen(QPen(color, 1));
    painter.drawText(at + QPointF(kMark + 3, -kMark), mark.name);
}

}  // namespace

QColor colorOf(Ink ink) {
    switch (ink) {
        case Ink::implant:
            return {86, 180, 233};
        case Ink::stage:
            return {240, 228, 66};
        case Ink::found:
            return {230, 159, 0};
        case Ink::predicted:
            return {86, 180, 233};
        case Ink::axis:
            return {235, 235, 235};
        case Ink::corkscrew:
            return {0, 190, 140};
        case Ink::bead:
            return {204, 121, 167};
        case Ink::uncertainty:
            return {230, 159, 0};
        case Ink::epipolar:
            return {0, 190, 140};
        case Ink::measure:
            return {255, 255, 255};
        case Ink::handle:
            return {255, 255, 255};
    }
    return {};
}

void paintOverlay(QPainter& painter, const Overlay& overlay, const QTransform& widget_from_image) {
    painter.save();
    painter.setRenderHint(QPainter::Antialiasing);
    for (const OverlayCurve& curve : overlay.curves)
        paintCurve(painter, curve, widget_from_image);
    for (const OverlayMark& mark : overlay.marks)
        paintMark(painter, mark, widget_from_image);
    painter.restore();
}

}  // namespace fluorocut::ui
