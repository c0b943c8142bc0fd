// SceneView: the case of a session in three dimensions, with buttons for what of it is shown and from where. Follows
// the session: while something is previewed, only what moves is moved.
#pragma once

#include <QPointer>
#include <QWidget>
#include <array>

#include "ui/scene/scene_canvas.h"
#include "ui/scene/scene_content.h"
#include "ui/session/job_runner.h"
#include "ui/session/session.h"

class QToolButton;

namespace fluorocut::ui {

class SceneView : public QWidget {
    Q_OBJECT

  public:
    // The session must outlive the view, or go before it is used again.
    explicit SceneView(Session& session, QWidget* parent = nullptr, SceneBackend backend = SceneBackend::automatic);
    ~SceneView() override;

    SceneCanvas& canvas() { return *canvas_; }
    // The button of a kind; checked: it is shown.
    QToolButton* button(SceneKind kind) const { return buttons_[static_cast<std::size_t>(kind)]; }
    // The bone's surface is being made from the CT.
    bool isPreparing() const { return jobs_.isBusy(); }
    QImage snapshot(const QSize& size) { return canvas_->snapshot(size); }

  signals:
    void prepared();  // nothing is being prepared any longer

  protected:
    void showEvent(QShowEvent* event) override;

  private:
    void follow();
    void prepareBone();

    QPointer<Session> session_;
    SceneCanvas* canvas_;
    std::array<QToolButton*, kSceneKinds> buttons_{};
    SceneBuilder builder_;
    std::shared_ptr<const Volume> wanted_;  // the CT whose surface is being made
    JobRunner jobs_;
};

}  // namespace fluorocut::ui
