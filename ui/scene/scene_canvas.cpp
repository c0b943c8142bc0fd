#include "ui/scene/scene_canvas.h"

#include <QKeyEvent>
#include <QMouseEvent>
#include <QPainter>
#include <QWheelEvent>
#include <cmath>

#include "core/base/stopwatch.h"
#include "ui/scene/scene_marks.h"
#include "ui/spreadsheet/view_marks.h"

namespace fluorocut::ui {
namespace {

constexpr double kZoomPerNotch = 1.2;
constexpr double kDragPerNotch = 20;  // screen pixels of a right drag that zoom as much as a notch of the wheel
constexpr double kSmooth_ms = 33;     // a picture while the hand moves
constexpr double kFast_ms = 60;       // of full size: then one of twice the size is not too long for a rest
constexpr int kRest_ms = 200;
constexpr int kMargin = 10;

QPointF positionOf(const QMouseEvent& event) {
#if QT_VERSION >= QT_VERSION_CHECK(6, 0, 0)
    return event.position();
#else
    return event.localPos();
#endif
}

// Means of 2 x 2 pixels: the smooth edges of a picture of twice the size.
QImage halved(const QImage& image) {
    return image.scaled(image.size() / 2, Qt::IgnoreAspectRatio, Qt::SmoothTransformation);
}

}  // namespace

SceneCanvas::SceneCanvas(SceneBackend backend, QWidget* parent) : QWidget(parent), backend_(backend) {
    shown_.fill(true);
    setFocusPolicy(Qt::StrongFocus);
    setAttribute(Qt::WA_OpaquePaintEvent);
    setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Expanding);
    rest_.setSingleShot(true);
    rest_.setInterval(kRest_ms);
    connect(&rest_, &QTimer::timeout, this, [this] {
        moving_ = false;
        refresh();
    });
}

SceneCanvas::~SceneCanvas() = default;

void SceneCanvas::setScene(Scene scene, bool moving) {
    // What is only moved does not move the viewer.
    const bool others = scene.items.size() != scene_.items.size();
    scene_ = std::move(scene);
    if (fitted_ && others) refit();
    if (moving)
        moved();
    else
        refresh();
}

void SceneCanvas::setShown(SceneKind kind, bool shown) {
    shown_[static_cast<std::size_t>(kind)] = shown;
    refresh();
}

void SceneCanvas::setNote(const QString& note) {
    if (note == note_) return;
    note_ = note;
    update();
}

void SceneCanvas::setCamera(const SceneCamera& camera) {
    camera_ = camera;
    fitted_ = false;
    refresh();
}

void SceneCanvas::lookFrom(LookFrom side) {
    camera_.lookFrom(side);
    refresh();
}

void SceneCanvas::fit() {
    fit_everything_ = fitted_ && !fit_everything_;
    refit();
}

void SceneCanvas::refit() {
    fitted_ = true;
    const std::vector<SceneItem> everything = shownItems(1);
    std::vector<SceneItem> body = everything;
    std::erase_if(body,
                  [](const SceneItem& item) { return item.kind == SceneKind::views || item.kind == SceneKind::robot; });
    camera_.fit(ballAround(fit_everything_ || body.empty() ? everything : body), size());
    refresh();
}

std::vector<SceneItem> SceneCanvas::shownItems(double pixels) const {
    std::vector<SceneItem> items;
    for (const SceneItem& item : scene_.items) {
        if (!isShown(item.kind)) continue;
        items.push_back(item);
        items.back().width_px *= pixels;
    }
    return items;
}

SceneRenderer& SceneCanvas::renderer() {
    if (!renderer_) {
        ChosenRenderer chosen = makeSceneRenderer(backend_);
        if (!chosen.renderer) chosen.renderer = makeCpuRenderer();
        renderer_ = std::move(chosen.renderer);
        why_no_opengl_ = renderer_->usesOpenGL() ? QString() : chosen.why_no_opengl;
    }
    return *renderer_;
}

void SceneCanvas::refresh() {
    stale_ = true;
    update();
}

void SceneCanvas::moved() {
    moving_ = true;
    rest_.start();
    refresh();
}

void SceneCanvas::draw() {
    const double ratio = devicePixelRatioF();
    const QSize full = (QSizeF(size()) * ratio).toSize().expandedTo(QSize(1, 1));
    SceneRenderer& drawing = renderer();
    const Stopwatch stopwatch;
    if (!moving_ && full_ms_ < kFast_ms) {
        picture_ = halved(drawing.render(shownItems(2 * ratio), camera_, 2 * full));
    } else if (moving_ && full_ms_ > kSmooth_ms) {
        picture_ = drawing.render(shownItems(0.5 * ratio), camera_, (full / 2).expandedTo(QSize(1, 1)));
        // A quarter of the pixels, all of the triangles: about half of the time.
        full_ms_ = 0.5 * (full_ms_ + 2 * stopwatch.ms());
    } else {
        picture_ = drawing.render(shownItems(ratio), camera_, full);
        full_ms_ = full_ms_ > 0 ? 0.5 * (full_ms_ + stopwatch.ms()) : stopwatch.ms();
    }
}

void SceneCanvas::paintEvent(QPaintEvent*) {
    if (stale_) draw();
    stale_ = false;
    QPainter painter(this);
    painter.setRenderHint(QPainter::SmoothPixmapTransform);
    painter.drawImage(rect(), picture_);
    paintOver(painter, size(), font());
    if (hasFocus()) {
        painter.setPen(palette().color(QPalette::Highlight));
        painter.setBrush(Qt::NoBrush);
        painter.drawRect(rect().adjusted(0, 0, -1, -1));
    }
}

void SceneCanvas::paintOver(QPainter& painter, const QSizeF& size, const QFont& font) const {
    painter.setFont(font);
    for (const SceneLabel& label : scene_.labels)
        if (isShown(label.kind)) paintSceneLabel(painter, camera_, size, label);
    paintBodyAxes(painter, camera_, size);
    const QRect area = QRectF(QPointF(), size).toRect().adjusted(kMargin, kMargin, -kMargin, -kMargin);
    QString corner = note_;
    if (!why_no_opengl_.isEmpty()) {
        const QString without = tr("Drawn without OpenGL: %1").arg(why_no_opengl_);
        corner = corner.isEmpty() ? without : corner + "\n" + without;
    }
    if (!corner.isEmpty()) paintPlate(painter, area, Qt::AlignBottom | Qt::AlignRight, corner);
    if (scene_.items.empty() && note_.isEmpty()) {
        painter.setPen(palette().color(QPalette::PlaceholderText));
        painter.drawText(area, Qt::AlignCenter | Qt::TextWordWrap,
                         tr("Nothing to show in 3D yet.\nIt needs a CT, a planned implant, or images whose pose is "
                            "known."));
    }
}

QImage SceneCanvas::snapshot(const QSize& size) {
    if (size.isEmpty()) return {};
    QImage picture = halved(renderer().render(shownItems(2), camera_, 2 * size));
    QPainter painter(&picture);
    paintOver(painter, size, font());
    return picture;
}

void SceneCanvas::resizeEvent(QResizeEvent*) {
    if (fitted_) refit();
    stale_ = true;
}

std::optional<Vector3> SceneCanvas::pointUnder(const QPointF& place) const {
    const Vector3 from = camera_.position(), along = camera_.rayThrough(place, size());
    std::optional<double> solid, glass;
    for (const SceneItem& item : shownItems(1)) {
        if (!item.surface) continue;
        const Rigid3 item_from_femur = item.femur_from_item.inverse();
        const auto hit = firstHit(*item.surface, item_from_femur * from, item_from_femur.rotate(along));
        std::optional<double>& nearest = item.isOpaque() ? solid : glass;
        if (hit && (!nearest || *hit < *nearest)) nearest = hit;
    }
    const std::optional<double> hit = solid ? solid : glass;
    if (!hit) return std::nullopt;
    return from + *hit * along;
}

void SceneCanvas::mousePressEvent(QMouseEvent* event) {
    if (drag_ != Drag::none) return;  // one button at a time
    last_ = positionOf(*event);
    const bool shift = event->modifiers() & Qt::ShiftModifier;
    if (event->button() == Qt::MiddleButton || (event->button() == Qt::LeftButton && shift)) {
        drag_ = Drag::pan;
        setCursor(Qt::ClosedHandCursor);
    } else if (event->button() == Qt::RightButton) {
        drag_ = Drag::zoom;
    } else if (event->button() == Qt::LeftButton) {
        drag_ = Drag::orbit;
    }
}

void SceneCanvas::mouseMoveEvent(QMouseEvent* event) {
    const QPointF here = positionOf(*event);
    const QPointF by = here - last_;
    last_ = here;
    if (drag_ == Drag::none) return;
    fitted_ = false;
    if (drag_ == Drag::orbit) camera_.orbit(by, size());
    if (drag_ == Drag::pan) camera_.pan(by, size());
    if (drag_ == Drag::zoom) camera_.zoom(std::pow(kZoomPerNotch, -by.y() / kDragPerNotch));
    moved();
}

void SceneCanvas::mouseReleaseEvent(QMouseEvent* event) {
    if (event->buttons() != Qt::NoButton) return;  // another one is still held
    drag_ = Drag::none;
    unsetCursor();
}

void SceneCanvas::mouseDoubleClickEvent(QMouseEvent* event) {
    if (event->button() != Qt::LeftButton) return;
    if (const auto point = pointUnder(positionOf(*event))) {
        camera_.focus = *point;
        fitted_ = false;
        refresh();
    }
}

void SceneCanvas::wheelEvent(QWheelEvent* event) {
    fitted_ = false;
    camera_.zoom(std::pow(kZoomPerNotch, event->angleDelta().y() / 120.0));
    moved();
    event->accept();
}

void SceneCanvas::keyPressEvent(QKeyEvent* event) {
    const int key = event->modifiers() == Qt::NoModifier ? event->key() : 0;
    if (key == Qt::Key_A) {
        lookFrom(LookFrom::anterior);
    } else if (key == Qt::Key_L) {
        lookFromOperatedSide();
    } else if (key == Qt::Key_S) {
        lookFrom(LookFrom::superior);
    } else if (key == Qt::Key_F) {
        fit();
    } else {
        QWidget::keyPressEvent(event);
    }
}

}  // namespace fluorocut::ui
