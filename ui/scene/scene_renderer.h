// SceneRenderer: makes a picture of a scene. There are two, which agree on where everything is (edges within a pixel):
//
//   OpenGL  VTK, on an EGL display that belongs to no screen: the same with an X server, without one and on Qt's
//           offscreen platform
//   CPU     a z-buffer in plain C++, where EGL is missing or fails
#pragma once

#include <QImage>
#include <QSize>
#include <QString>
#include <memory>

#include "ui/scene/scene.h"
#include "ui/scene/scene_camera.h"

namespace fluorocut::ui {

class SceneRenderer {
  public:
    virtual ~SceneRenderer() = default;
    // Opaque, of the size asked for (in device pixels); empty for an empty size. Keeps what it has prepared for the
    // scene's surfaces: the next picture of the same ones, elsewhere, costs no more than drawing them.
    virtual QImage render(const std::vector<SceneItem>& items, const SceneCamera& camera, const QSize& size) = 0;
    virtual bool usesOpenGL() const = 0;
};

// Null when there is no OpenGL to be had; `why_not` then says so.
std::unique_ptr<SceneRenderer> makeOpenGLRenderer(QString* why_not);
std::unique_ptr<SceneRenderer> makeCpuRenderer();

enum class SceneBackend { automatic, openGL, cpu };

struct ChosenRenderer {
    std::unique_ptr<SceneRenderer> renderer;  // null only where OpenGL alone was asked for
    QString why_no_opengl;
};

// automatic: OpenGL, or else the CPU. The environment variable FLUOROCUT_SCENE=cpu makes it the CPU.
ChosenRenderer makeSceneRenderer(SceneBackend backend);

}  // namespace fluorocut::ui
