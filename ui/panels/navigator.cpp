#include "ui/panels/navigator.h"

#include <QApplication>
#include <QPainter>
#include <QPainterPath>
#include <QStyledItemDelegate>
#include <algorithm>
#include <array>

namespace fluorocut::ui {
namespace {

constexpr int kMark = Qt::UserRole, kDetail = Qt::UserRole + 1;
constexpr int kMargin = 8;

// Okabe and Ito's colours; the shapes differ too.
QColor colorOf(StepMark mark, const QPalette& palette) {
    switch (mark) {
        case StepMark::ready:
        case StepMark::running:
            return {0x56, 0xb4, 0xe9};
        case StepMark::done:
        case StepMark::accepted:
            return {0x00, 0x9e, 0x73};
        case StepMark::refused:
            return {0xd5, 0x5e, 0x00};
        case StepMark::stale:
            return {0xe6, 0x9f, 0x00};
        case StepMark::waiting:
            break;
    }
    return palette.color(QPalette::PlaceholderText);
}

}  // namespace

void paintMark(QPainter& painter, const QRectF& box, StepMark mark, const QPalette& palette) {
    const QColor color = colorOf(mark, palette);
    const double s = box.width();
    const auto at = [&](double x, double y) { return box.topLeft() + QPointF(x * s, y * s); };
    const QPen on_color(palette.color(QPalette::Base), s / 9, Qt::SolidLine, Qt::RoundCap, Qt::RoundJoin);
    painter.save();
    painter.setRenderHint(QPainter::Antialiasing);
    painter.setPen(QPen(color, s / 12));
    painter.setBrush(Qt::NoBrush);
    const QRectF ring = box.adjusted(s / 16, s / 16, -s / 16, -s / 16);
    switch (mark) {
        case StepMark::waiting:
            painter.drawEllipse(ring);
            break;
        case StepMark::ready:
            painter.drawEllipse(ring);
            painter.setBrush(color);
            painter.drawPolygon(QPolygonF({at(0.38, 0.28), at(0.74, 0.5), at(0.38, 0.72)}));
            break;
        case StepMark::running:
            painter.drawEllipse(ring);
            painter.setBrush(color);
            painter.drawPie(ring, 90 * 16, -180 * 16);
            break;
        case StepMark::done:
        case StepMark::accepted:
        case StepMark::refused:
            painter.setBrush(color);
            painter.drawEllipse(ring);
            painter.setPen(on_color);
            if (mark == StepMark::accepted)
                painter.drawPolyline(QPolygonF({at(0.28, 0.52), at(0.45, 0.68), at(0.73, 0.34)}));
            if (mark == StepMark::refused) {
                painter.drawLine(at(0.33, 0.33), at(0.67, 0.67));
                painter.drawLine(at(0.67, 0.33), at(0.33, 0.67));
            }
            break;
        case StepMark::stale:
            painter.setBrush(color);
            painter.drawPolygon(QPolygonF({at(0.5, 0.06), at(0.98, 0.92), at(0.02, 0.92)}));
            painter.setPen(on_color);
            painter.drawLine(at(0.5, 0.38), at(0.5, 0.62));
            painter.drawPoint(at(0.5, 0.8));
            break;
    }
    painter.restore();
}

namespace {

QFont smaller(QFont font) {
    font.setPointSizeF(0.9 * font.pointSizeF());
    return font;
}

class StepDelegate : public QStyledItemDelegate {
  public:
    using QStyledItemDelegate::QStyledItemDelegate;

    QSize sizeHint(const QStyleOptionViewItem& option, const QModelIndex& index) const override {
        const int detail = index.data(kDetail).toString().isEmpty() ? 0 : QFontMetrics(smaller(option.font)).height();
        return {160, 2 * option.fontMetrics.height() + detail + 2 * kMargin};
    }

    void paint(QPainter* painter, const QStyleOptionViewItem& option, const QModelIndex& index) const override {
        painter->save();
        const QPalette& palette = option.palette;
        const bool selected = option.state & QStyle::State_Selected;
        painter->fillRect(option.rect, palette.color(selected ? QPalette::Button : QPalette::Base));
        if (selected)
            painter->fillRect(QRect(option.rect.topLeft(), QSize(3, option.rect.height())), palette.highlight());
        const auto mark = static_cast<StepMark>(index.data(kMark).toInt());
        const QRect inside = option.rect.adjusted(kMargin + 3, kMargin, -kMargin, -kMargin);
        const int line = option.fontMetrics.height();
        const int icon = line * 5 / 4;
        paintMark(*painter, QRectF(inside.left(), inside.top() + line / 8.0, icon, icon), mark, palette);

        const int left = inside.left() + icon + kMargin;
        const auto write = [&](int top, int height, const QString& text, const QColor& color, const QFont& font) {
            painter->setFont(font);
            painter->setPen(color);
            const QRect area(left, top, inside.right() - left, height);
            painter->drawText(area, Qt::AlignLeft | Qt::AlignVCenter,
                              QFontMetrics(font).elidedText(text, Qt::ElideRight, area.width()));
        };
        QFont bold = option.font;
        bold.setBold(mark == StepMark::ready || mark == StepMark::running);
        const QColor text = palette.color(mark == StepMark::waiting ? QPalette::PlaceholderText : QPalette::Text);
        write(inside.top(), line, QString("%1  %2").arg(index.row() + 1).arg(index.data().toString()), text, bold);
        write(inside.top() + line, line, wordOf(mark), colorOf(mark, palette), smaller(option.font));
        const QString detail = index.data(kDetail).toString();
        const QFont small = smaller(option.font);
        if (!detail.isEmpty())
            write(inside.top() + 2 * line, QFontMetrics(small).height(), detail,
                  palette.color(QPalette::PlaceholderText), small);
        painter->restore();
    }
};

}  // namespace

QString wordOf(StepMark mark) {
    switch (mark) {
        case StepMark::waiting:
            return Navigator::tr("waiting");
        case StepMark::ready:
            return Navigator::tr("ready");
        case StepMark::running:
            return Navigator::tr("running");
        case StepMark::done:
            return Navigator::tr("done, not yet accepted");
        case StepMark::accepted:
            return Navigator::tr("accepted");
        case StepMark::refused:
            return Navigator::tr("refused");
        case StepMark::stale:
            return Navigator::tr("stale");
    }
    return {};
}

Navigator::Navigator(QWidget* parent) : QListWidget(parent) {
    setObjectName("navigator");
    setItemDelegate(new StepDelegate(this));
    setFrameShape(QFrame::NoFrame);
    setHorizontalScrollBarPolicy(Qt::ScrollBarAlwaysOff);
    setVerticalScrollMode(QAbstractItemView::ScrollPerPixel);
    setAccessibleName(tr("Steps of the procedure"));
    connect(this, &QListWidget::currentRowChanged, this, [this](int row) {
        if (row >= 0) emit stepChosen(row);
    });
}

void Navigator::setRows(const std::vector<NavigatorRow>& rows) {
    if (rows == rows_) return;
    rows_ = rows;
    const QSignalBlocker quiet(this);
    while (count() > static_cast<int>(rows.size()))
        delete takeItem(count() - 1);
    while (count() < static_cast<int>(rows.size()))
        addItem(QString());
    for (int i = 0; i < count(); ++i) {
        const NavigatorRow& row = rows[static_cast<std::size_t>(i)];
        item(i)->setText(row.name);
        item(i)->setData(kMark, static_cast<int>(row.mark));
        item(i)->setData(kDetail, row.detail);
        item(i)->setToolTip(row.detail);
        item(i)->setData(Qt::AccessibleTextRole,
                         QString("%1 %2, %3. %4").arg(i + 1).arg(row.name, wordOf(row.mark), row.detail));
    }
}

}  // namespace fluorocut::ui
