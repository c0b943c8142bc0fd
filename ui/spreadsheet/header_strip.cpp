#include "ui/spreadsheet/header_strip.h"

#include <QHelpEvent>
#include <QMouseEvent>
#include <QPainter>
#include <QToolTip>
#include <cstdlib>
#include <utility>

#include "ui/spreadsheet/overlay.h"

namespace fluorocut::ui {
namespace {
constexpr int kReach = 4;   // screen pixels from a border to take it
constexpr int kArrow = 18;  // the place of a menu's arrow
}  // namespace

HeaderStrip::HeaderStrip(Qt::Orientation orientation, bool menus, QWidget* parent)
    : QWidget(parent), orientation_(orientation), menus_(menus) {
    setMouseTracking(true);
}

void HeaderStrip::setTexts(std::vector<HeaderText> texts) {
    if (texts == texts_) return;
    texts_ = std::move(texts);
    update();
}

void HeaderStrip::setSpans(std::vector<Span> spans) {
    spans_ = std::move(spans);
    update();
}

int HeaderStrip::borderAt(int place) const {
    // The last border has nothing behind it to take from.
    for (std::size_t i = 0; i + 1 < spans_.size(); ++i)
        if (std::abs(place - spans_[i].end) <= kReach) return static_cast<int>(i);
    return -1;
}

int HeaderStrip::sectionAt(int place) const {
    for (std::size_t i = 0; i < spans_.size(); ++i)
        if (place >= spans_[i].begin && place < spans_[i].end) return static_cast<int>(i);
    return -1;
}

QRect HeaderStrip::areaOf(std::size_t index) const {
    const Span& span = spans_[index];
    return orientation_ == Qt::Horizontal ? QRect(span.begin, 0, span.end - span.begin, height())
                                          : QRect(0, span.begin, width(), span.end - span.begin);
}

void HeaderStrip::paintEvent(QPaintEvent*) {
    QPainter painter(this);
    painter.fillRect(rect(), palette().window());
    QFont bold = font();
    bold.setBold(true);
    for (std::size_t i = 0; i < std::min(spans_.size(), texts_.size()); ++i) {
        const QRect area = areaOf(i);
        painter.fillRect(area.adjusted(0, 0, -1, -1), palette().button());
        QRect inside = area.adjusted(8, 4, -8, -4);
        if (menus_) {
            painter.setPen(palette().color(QPalette::PlaceholderText));
            painter.drawText(inside, Qt::AlignRight | Qt::AlignVCenter, QStringLiteral("\u25be"));
            inside.adjust(0, 0, -kArrow, 0);
        }
        painter.setFont(bold);
        painter.setPen(palette().color(QPalette::ButtonText));
        const int line = QFontMetrics(bold).height();
        const bool single = orientation_ == Qt::Horizontal && texts_[i].lines.isEmpty();
        painter.drawText(inside, (single ? Qt::AlignVCenter : Qt::AlignTop) | Qt::AlignLeft,
                         QFontMetrics(bold).elidedText(texts_[i].title, Qt::ElideRight, inside.width()));
        painter.setFont(font());
        inside.adjust(0, line + 3, 0, 0);
        for (const QString& text : texts_[i].lines) {
            const bool last = &text == &texts_[i].lines.back();
            painter.setPen(texts_[i].warning && last ? colorOf(Ink::found)
                                                     : palette().color(QPalette::PlaceholderText).lighter(130));
            const QRect used = painter.boundingRect(inside, Qt::AlignTop | Qt::AlignLeft | Qt::TextWordWrap, text);
            if (used.bottom() > inside.bottom() + 2) break;
            painter.drawText(inside, Qt::AlignTop | Qt::AlignLeft | Qt::TextWordWrap, text);
            inside.setTop(used.bottom() + 4);
        }
    }
}

void HeaderStrip::mousePressEvent(QMouseEvent* event) {
    last_ = along(event->pos());
    dragged_ = event->button() == Qt::LeftButton ? borderAt(last_) : -1;
    if (dragged_ >= 0 || !menus_) return;
    const int section = sectionAt(last_);
    if (section >= 0) emit menuRequested(section, mapToGlobal(areaOf(static_cast<std::size_t>(section)).bottomLeft()));
}

void HeaderStrip::mouseMoveEvent(QMouseEvent* event) {
    const int place = along(event->pos());
    if (dragged_ >= 0) {
        const int by = place - std::exchange(last_, place);
        if (by != 0) emit borderDragged(dragged_, by);
        return;
    }
    const bool border = borderAt(place) >= 0;
    setCursor(!border ? Qt::ArrowCursor : orientation_ == Qt::Horizontal ? Qt::SplitHCursor : Qt::SplitVCursor);
}

void HeaderStrip::mouseReleaseEvent(QMouseEvent*) {
    dragged_ = -1;
}

bool HeaderStrip::event(QEvent* event) {
    if (event->type() == QEvent::ToolTip) {
        const auto* help = static_cast<QHelpEvent*>(event);
        const int section = sectionAt(along(help->pos()));
        if (section >= 0 && static_cast<std::size_t>(section) < texts_.size())
            QToolTip::showText(help->globalPos(), texts_[static_cast<std::size_t>(section)].tip, this);
        return true;
    }
    return QWidget::event(event);
}

}  // namespace fluorocut::ui
