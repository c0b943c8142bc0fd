// SceneCanvas: a scene in a window, with the hand movements of every 3D viewer.
//
//   left drag     walks round the patient, and over; the head stays up
//   middle drag   pans (or left drag with Shift held)
//   wheel         zooms; so does a right drag: up is larger
//   double click  brings what is under the cursor to the middle (what is opaque first, through what is translucent)
//   A L S         from the front, from the operated side, from above; F: the bone and the plan fit, once more:
//                 everything does
//
// Nothing is drawn, and no OpenGL begun, before the widget is first painted. While the hand moves, pictures that would
// take too long are drawn at half the size; once it rests they are drawn at twice the size and smoothed.
#pragma once

#include <QTimer>
#include <QWidget>
#include <array>
#include <optional>

#include "ui/scene/scene_renderer.h"

namespace fluorocut::ui {

class SceneCanvas : public QWidget {
    Q_OBJECT

  public:
    explicit SceneCanvas(SceneBackend backend = SceneBackend::automatic, QWidget* parent = nullptr);
    ~SceneCanvas() override;

    // `moving`: more of the kind will follow soon.
    void setScene(Scene scene, bool moving = false);
    const Scene& scene() const { return scene_; }
    bool isShown(SceneKind kind) const { return shown_[static_cast<std::size_t>(kind)]; }
    void setShown(SceneKind kind, bool shown);
    // What stands in the corner while something is being prepared; empty: nothing is.
    void setNote(const QString& note);
    // Where L looks from.
    void setOperatedSide(LookFrom side) { operated_side_ = side; }

    const SceneCamera& camera() const { return camera_; }
    void setCamera(const SceneCamera& camera);
    void lookFrom(LookFrom side);
    void lookFromOperatedSide() { lookFrom(operated_side_); }
    // Bone and plan, without C-arms and robot; where that has just been done, everything.
    void fit();

    // The picture without the widget, of this size; smoothed.
    QImage snapshot(const QSize& size);
    // Empty while OpenGL draws, or nothing has been drawn yet.
    const QString& whyNoOpenGL() const { return why_no_opengl_; }
    bool hasStarted() const { return renderer_ != nullptr; }

    QSize sizeHint() const override { return {520, 420}; }
    QSize minimumSizeHint() const override { return {160, 120}; }

  protected:
    void paintEvent(QPaintEvent* event) override;
    void resizeEvent(QResizeEvent* event) override;
    void mousePressEvent(QMouseEvent* event) override;
    void mouseMoveEvent(QMouseEvent* event) override;
    void mouseReleaseEvent(QMouseEvent* event) override;
    void mouseDoubleClickEvent(QMouseEvent* event) override;
    void wheelEvent(QWheelEvent* event) override;
    void keyPressEvent(QKeyEvent* event) override;

  private:
    enum class Drag { none, orbit, pan, zoom };

    SceneRenderer& renderer();
    // With lines so many times as wide.
    std::vector<SceneItem> shownItems(double pixels) const;
    void refit();
    void refresh();  // the picture is out of date
    void moved();    // and more movement is likely
    void draw();
    std::optional<Vector3> pointUnder(const QPointF& place) const;
    void paintOver(QPainter& painter, const QSizeF& size, const QFont& font) const;

    SceneBackend backend_;
    std::unique_ptr<SceneRenderer> renderer_;
    QString why_no_opengl_;
    Scene scene_;
    std::array<bool, kSceneKinds> shown_;
    QString note_;
    SceneCamera camera_;
    LookFrom operated_side_ = LookFrom::left;
    bool fitted_ = true;  // a resize, and another scene, keep it so
    bool fit_everything_ = false;

    QImage picture_;
    bool stale_ = true;
    bool moving_ = false;
    double full_ms_ = 0;  // what a picture of full size takes
    QTimer rest_;
    Drag drag_ = Drag::none;
    QPointF last_;
};

}  // namespace fluorocut::ui
