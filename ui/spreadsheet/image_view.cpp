#include "ui/spreadsheet/image_view.h"

#include <QKeyEvent>
#include <QMouseEvent>
#include <QPainter>
#include <QWheelEvent>
#include <algorithm>
#include <cmath>

namespace fluorocut::ui {
namespace {

constexpr double kZoomPerNotch = 1.2;
constexpr double kMostZoom = 64;
constexpr int kMargin = 10;

// Text that can be read on black and on white: on a plate of its own.
void paintText(QPainter& painter, const QRect& area, int alignment, const QString& text) {
    if (text.isEmpty()) return;
    const QRect plate = painter.boundingRect(area, alignment, text).adjusted(-5, -2, 5, 2);
    painter.fillRect(plate, QColor(12, 15, 18, 170));
    painter.setPen(QColor(225, 232, 238));
    painter.drawText(area, alignment, text);
}

QString number(double value) {
    return QString::number(value, 'g', 4);
}

QPointF positionOf(const QMouseEvent& event) {
#if QT_VERSION >= QT_VERSION_CHECK(6, 0, 0)
    return event.position();
#else
    return event.localPos();
#endif
}

}  // namespace

ImageView::ImageView(QWidget* parent) : QWidget(parent) {
    setMouseTracking(true);
    setFocusPolicy(Qt::StrongFocus);
    setAttribute(Qt::WA_OpaquePaintEvent);
    setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Expanding);
    setCursor(Qt::CrossCursor);
}

void ImageView::setImage(std::shared_ptr<const Image> image, const QString& title) {
    image_ = std::move(image);
    title_ = title;
    message_.clear();
    progress_.reset();
    levels_ = image_ ? GrayLevels(*image_) : GrayLevels();
    resetDisplayWindow();
    fit();
}

void ImageView::setMessage(const QString& message, std::optional<double> progress) {
    message_ = message;
    progress_ = progress;
    update();
}

void ImageView::setDisplayWindow(const DisplayWindow& window) {
    window_ = window;
    // Narrower than a 10,000th of the image's range there is nothing left to see.
    window_.width = std::max(window_.width, 1e-4 * levels_.range());
    shown_ = levels_.render(window_);
    update();
    emit displayWindowChanged();
}

double ImageView::fittingZoom() const {
    if (!image_ || image_->empty()) return 1;
    return std::min(width() / static_cast<double>(image_->width()), height() / static_cast<double>(image_->height()));
}

void ImageView::fit() {
    fitted_ = true;
    if (image_) {
        zoom_ = std::max(fittingZoom(), 1e-3);
        corner_ = QPointF(0.5 * (width() - zoom_ * image_->width()), 0.5 * (height() - zoom_ * image_->height()));
    }
    update();
    emit viewChanged();
}

void ImageView::zoomAbout(const QPointF& anchor, double factor) {
    if (!image_) return;
    const QPointF kept = imageFromWidget(anchor);
    const double least = 0.25 * std::max(fittingZoom(), 1e-3);
    zoom_ = std::clamp(zoom_ * factor, least, std::max(kMostZoom, least));
    fitted_ = false;
    corner_ += anchor - widgetFromImage(kept);
    update();
    emit viewChanged();
}

QPointF ImageView::imageFromWidget(const QPointF& point) const {
    return (point - corner_) / zoom_ - QPointF(0.5, 0.5);
}

QPointF ImageView::widgetFromImage(const QPointF& point) const {
    return (point + QPointF(0.5, 0.5)) * zoom_ + corner_;
}

QString ImageView::readOut(const QPointF& point_in_widget) const {
    if (!image_) return {};
    const QPointF place = imageFromWidget(point_in_widget);
    const int x = static_cast<int>(std::lround(place.x()));
    const int y = static_cast<int>(std::lround(place.y()));
    if (x < 0 || y < 0 || x >= image_->width() || y >= image_->height()) return {};
    return QStringLiteral("x %1  y %2   %3").arg(x).arg(y).arg(number(static_cast<double>((*image_)(x, y))));
}

void ImageView::paintEvent(QPaintEvent*) {
    QPainter painter(this);
    painter.fillRect(rect(), QColor(8, 10, 12));
    if (image_) {
        // Shrunk images are smoothed; enlarged ones show their pixels.
        painter.setRenderHint(QPainter::SmoothPixmapTransform, zoom_ < 2);
        painter.drawImage(QRectF(corner_, QSizeF(zoom_ * image_->width(), zoom_ * image_->height())), shown_);
        paintCorners(painter);
    }
    if (!message_.isEmpty()) paintMessage(painter);
    if (hasFocus()) {
        painter.setPen(QColor(70, 130, 180));
        painter.drawRect(rect().adjusted(0, 0, -1, -1));
    }
}

void ImageView::paintCorners(QPainter& painter) const {
    const QRect area = rect().adjusted(kMargin, kMargin, -kMargin, -kMargin);
    QFont bold = font();
    bold.setBold(true);
    painter.setFont(bold);
    paintText(painter, area, Qt::AlignTop | Qt::AlignLeft, title_);
    painter.setFont(font());
    paintText(painter, area, Qt::AlignTop | Qt::AlignRight, QStringLiteral("%1 %").arg(100 * zoom_, 0, 'f', 0));
    paintText(painter, area, Qt::AlignBottom | Qt::AlignRight,
              QStringLiteral("W %1  L %2").arg(number(window_.width), number(window_.center)));
    if (cursor_) paintText(painter, area, Qt::AlignBottom | Qt::AlignLeft, readOut(*cursor_));
}

void ImageView::paintMessage(QPainter& painter) const {
    painter.setPen(QColor(150, 160, 170));
    const QRect area = rect().adjusted(kMargin, kMargin, -kMargin, -kMargin);
    painter.drawText(area, Qt::AlignCenter | Qt::TextWordWrap, message_);
    if (!progress_) return;
    QRect bar(0, 0, std::min(220, area.width()), 3);
    bar.moveCenter(area.center() + QPoint(0, 26));
    painter.fillRect(bar, QColor(40, 46, 52));
    bar.setWidth(static_cast<int>(bar.width() * std::clamp(*progress_, 0.0, 1.0)));
    painter.fillRect(bar, QColor(70, 130, 180));
}

void ImageView::resizeEvent(QResizeEvent*) {
    if (fitted_) fit();
}

void ImageView::mousePressEvent(QMouseEvent* event) {
    last_ = positionOf(*event);
    const bool shift = event->modifiers() & Qt::ShiftModifier;
    if (event->button() == Qt::MiddleButton || (event->button() == Qt::LeftButton && shift)) {
        drag_ = Drag::pan;
        setCursor(Qt::ClosedHandCursor);
    } else if (event->button() == Qt::LeftButton) {
        drag_ = Drag::window;
    }
}

void ImageView::mouseMoveEvent(QMouseEvent* event) {
    const QPointF here = positionOf(*event);
    const QPointF moved = here - last_;
    last_ = here;
    cursor_ = here;
    if (drag_ == Drag::pan) {
        corner_ += moved;
        fitted_ = false;
        emit viewChanged();
    } else if (drag_ == Drag::window && image_) {
        // A drag across 400 screen pixels spans the image's whole range. Down brightens: the level falls.
        const double per_pixel = levels_.range() / 400;
        setDisplayWindow({window_.center - moved.y() * per_pixel, window_.width + moved.x() * per_pixel});
    }
    update();
}

void ImageView::mouseReleaseEvent(QMouseEvent*) {
    drag_ = Drag::none;
    setCursor(Qt::CrossCursor);
}

void ImageView::mouseDoubleClickEvent(QMouseEvent* event) {
    if (event->button() == Qt::LeftButton) fit();
}

void ImageView::leaveEvent(QEvent*) {
    cursor_.reset();
    update();
}

void ImageView::wheelEvent(QWheelEvent* event) {
    zoomAbout(event->position(), std::pow(kZoomPerNotch, event->angleDelta().y() / 120.0));
    cursor_ = event->position();
    event->accept();
}

void ImageView::keyPressEvent(QKeyEvent* event) {
    if (event->key() == Qt::Key_R && image_) {
        resetDisplayWindow();
    } else {
        QWidget::keyPressEvent(event);
    }
}

}  // namespace fluorocut::ui
