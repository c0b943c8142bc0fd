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
constexpr double kDragPerNotch = 20;  // screen pixels of a right drag that zoom as much as a notch of the wheel
constexpr double kReach = 9;          // screen pixels within which the hand takes hold of something
constexpr int kMargin = 10;

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
    const bool same_size = image && image_ && image->width() == image_->width() && image->height() == image_->height();
    image_ = std::move(image);
    title_ = title;
    message_.clear();
    progress_.reset();
    levels_ = image_ ? GrayLevels(*image_) : GrayLevels();
    resetDisplayWindow();
    if (!same_size) {
        mirrored_ = false;
        showFitted();
    }
    update();
}

void ImageView::replaceImage(std::shared_ptr<const Image> image) {
    if (!image_ || !image || image->width() != image_->width() || image->height() != image_->height()) {
        setImage(std::move(image), title_);
        return;
    }
    image_ = std::move(image);
    message_.clear();
    progress_.reset();
    levels_ = GrayLevels(*image_);
    render();
}

void ImageView::setTitle(const QString& title) {
    if (title == title_) return;
    title_ = title;
    update();
}

void ImageView::setMessage(const QString& message, std::optional<double> progress) {
    message_ = message;
    progress_ = progress;
    update();
}

void ImageView::setMarks(const ViewMarks& marks) {
    marks_ = marks;
    update();
}

void ImageView::setOverlay(Overlay overlay) {
    overlay_ = std::move(overlay);
    update();
}

void ImageView::setPassingOverlay(Overlay overlay) {
    if (overlay.empty() && passing_.empty()) return;
    passing_ = std::move(overlay);
    update();
}

void ImageView::setDisplayWindow(const DisplayWindow& window) {
    window_ = window;
    // Narrower than a 10,000th of the image's range there is nothing left to see.
    window_.width = std::max(window_.width, 1e-4 * levels_.range());
    render();
    emit displayWindowChanged();
}

void ImageView::setPreset(WindowPreset preset) {
    const DisplayWindow all = levels_.fittingWindow();
    const double dark = all.center - 0.5 * all.width;
    switch (preset) {
        case WindowPreset::everything:
            setDisplayWindow(all);
            break;
        // Bone lets through less than half of what its surroundings do, metal next to nothing.
        case WindowPreset::bone:
            setDisplayWindow({dark + 0.25 * all.width, 0.5 * all.width});
            break;
        case WindowPreset::metal:
            setDisplayWindow({dark + 0.075 * all.width, 0.15 * all.width});
            break;
    }
}

void ImageView::setInverted(bool inverted) {
    inverted_ = inverted;
    render();
}

void ImageView::setMirrored(bool mirrored) {
    if (mirrored == mirrored_) return;
    const QPointF middle = imageFromWidget(QRectF(rect()).center());
    mirrored_ = mirrored;
    if (image_) corner_ += QRectF(rect()).center() - widgetFromImage(middle);
    if (fitted_) showFitted();
    update();
}

void ImageView::render() {
    shown_ = levels_.render(window_);
    if (inverted_) shown_.invertPixels();
    update();
}

double ImageView::fittingZoom() const {
    if (!image_ || image_->empty()) return 1;
    return std::min(width() / static_cast<double>(image_->width()), height() / static_cast<double>(image_->height()));
}

void ImageView::showFitted() {
    fitted_ = true;
    if (!image_) return;
    zoom_ = std::max(fittingZoom(), 1e-3);
    const double side = mirrored_ ? 1 : -1;
    corner_ = QPointF(0.5 * (width() + side * zoom_ * image_->width()), 0.5 * (height() - zoom_ * image_->height()));
}

void ImageView::fit() {
    showFitted();
    update();
    emit viewChanged();
}

ImageView::Glance ImageView::glance() const {
    return {imageFromWidget(QRectF(rect()).center()), zoom_ / std::max(fittingZoom(), 1e-3)};
}

void ImageView::setGlance(const Glance& glance) {
    if (!image_) return;
    zoom_ = glance.relative_zoom * std::max(fittingZoom(), 1e-3);
    fitted_ = false;
    corner_ += QRectF(rect()).center() - widgetFromImage(glance.middle);
    update();
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
    const QPointF from_corner = (point - corner_) / zoom_;
    return QPointF(mirrored_ ? -from_corner.x() : from_corner.x(), from_corner.y()) - QPointF(0.5, 0.5);
}

QPointF ImageView::widgetFromImage(const QPointF& point) const {
    const QPointF from_corner = (point + QPointF(0.5, 0.5)) * zoom_;
    return corner_ + QPointF(mirrored_ ? -from_corner.x() : from_corner.x(), from_corner.y());
}

QTransform ImageView::widgetFromImage() const {
    const QPointF origin = widgetFromImage(QPointF(0, 0));
    return {mirrored_ ? -zoom_ : zoom_, 0, 0, zoom_, origin.x(), origin.y()};
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
        painter.save();
        painter.setTransform(widgetFromImage());
        painter.drawImage(QRectF(-0.5, -0.5, image_->width(), image_->height()), shown_);
        painter.restore();
        paintOverlay(painter, overlay_, widgetFromImage());
        if (tool_) paintOverlay(painter, tool_->overlay(*this), widgetFromImage());
        paintOverlay(painter, passing_, widgetFromImage());
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
    paintPlate(painter, area, Qt::AlignTop | Qt::AlignLeft, title_);
    painter.setFont(font());
    paintPlate(painter, area, Qt::AlignTop | Qt::AlignRight, QStringLiteral("%1 %").arg(100 * zoom_, 0, 'f', 0));
    paintPlate(painter, area, Qt::AlignBottom | Qt::AlignRight,
               QStringLiteral("W %1  L %2").arg(number(window_.width), number(window_.center)));
    if (cursor_) paintPlate(painter, area, Qt::AlignBottom | Qt::AlignLeft, readOut(*cursor_));
    std::optional<double> screen_px_per_mm;
    if (marks_.px_per_mm) screen_px_per_mm = zoom_ * *marks_.px_per_mm;
    paintMarks(painter, area, marks_, screen_px_per_mm, mirrored_, title_.isEmpty() ? 0 : 1);
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
    if (fitted_) showFitted();
}

Touch ImageView::touchAt(const QPointF& point, Qt::KeyboardModifiers modifiers) const {
    const QPointF pixel = imageFromWidget(point);
    return {{pixel.x(), pixel.y()}, kReach / zoom_, modifiers};
}

void ImageView::stopPointing() {
    if (!pointing_) return;
    pointing_ = false;
    emit pointedAt(std::nullopt);
}

void ImageView::mousePressEvent(QMouseEvent* event) {
    if (drag_ != Drag::none) return;  // one button at a time
    last_ = pressed_ = positionOf(*event);
    const bool shift = event->modifiers() & Qt::ShiftModifier;
    if (event->button() == Qt::MiddleButton || (event->button() == Qt::LeftButton && shift)) {
        drag_ = Drag::pan;
        setCursor(Qt::ClosedHandCursor);
    } else if (event->button() == Qt::RightButton) {
        drag_ = Drag::zoom;
    } else if (event->button() == Qt::LeftButton) {
        const bool taken = tool_ && image_ && tool_->press(*this, touchAt(last_, event->modifiers()));
        drag_ = taken ? Drag::tool : Drag::window;
    }
    if (drag_ != Drag::none) stopPointing();
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
    } else if (drag_ == Drag::zoom) {
        zoomAbout(pressed_, std::pow(kZoomPerNotch, -moved.y() / kDragPerNotch));
    } else if (drag_ == Drag::tool) {
        tool_->drag(*this, touchAt(here, event->modifiers()));
    } else if (drag_ == Drag::window && image_) {
        // A drag across 400 screen pixels spans the image's whole range. Down brightens: the level falls.
        const double per_pixel = levels_.range() / 400;
        setDisplayWindow({window_.center - moved.y() * per_pixel, window_.width + moved.x() * per_pixel});
    } else if (drag_ == Drag::none && image_) {
        if (event->modifiers() & Qt::ShiftModifier) {
            pointing_ = true;
            emit pointedAt(imageFromWidget(here));
        } else {
            stopPointing();
        }
        setCursor(tool_ ? tool_->hover(*this, touchAt(here, event->modifiers())) : Qt::CrossCursor);
    }
    update();
}

void ImageView::mouseReleaseEvent(QMouseEvent* event) {
    if (event->buttons() != Qt::NoButton) return;  // another one is still held
    if (drag_ == Drag::tool) tool_->release(*this, touchAt(positionOf(*event), event->modifiers()));
    drag_ = Drag::none;
    setCursor(Qt::CrossCursor);
}

void ImageView::mouseDoubleClickEvent(QMouseEvent* event) {
    if (event->button() == Qt::LeftButton) emit maximiseRequested();
}

void ImageView::leaveEvent(QEvent*) {
    cursor_.reset();
    stopPointing();
    update();
}

void ImageView::wheelEvent(QWheelEvent* event) {
    zoomAbout(event->position(), std::pow(kZoomPerNotch, event->angleDelta().y() / 120.0));
    cursor_ = event->position();
    event->accept();
}

void ImageView::keyPressEvent(QKeyEvent* event) {
    if (image_ && tool_ && tool_->key(*this, event->key(), event->modifiers())) {
        update();
        return;
    }
    if (!image_ || event->modifiers() != Qt::NoModifier) {
        QWidget::keyPressEvent(event);
        return;
    }
    switch (event->key()) {
        case Qt::Key_F:
            fit();
            break;
        case Qt::Key_R:
            resetDisplayWindow();
            break;
        case Qt::Key_I:
            setInverted(!inverted_);
            break;
        case Qt::Key_M:
            setMirrored(!mirrored_);
            break;
        case Qt::Key_1:
            setPreset(WindowPreset::everything);
            break;
        case Qt::Key_2:
            setPreset(WindowPreset::bone);
            break;
        case Qt::Key_3:
            setPreset(WindowPreset::metal);
            break;
        default:
            QWidget::keyPressEvent(event);
    }
}

}  // namespace fluorocut::ui
