#include "ui/scene/scene_renderer.h"

#include <QCoreApplication>

namespace fluorocut::ui {

ChosenRenderer makeSceneRenderer(SceneBackend backend) {
    ChosenRenderer chosen;
    if (backend == SceneBackend::automatic && qgetenv("FLUOROCUT_SCENE") == "cpu") {
        chosen.why_no_opengl = QCoreApplication::translate("SceneRenderer", "switched off by FLUOROCUT_SCENE");
        backend = SceneBackend::cpu;
    }
    if (backend != SceneBackend::cpu) chosen.renderer = makeOpenGLRenderer(&chosen.why_no_opengl);
    if (!chosen.renderer && backend != SceneBackend::openGL) chosen.renderer = makeCpuRenderer();
    return chosen;
}

}  // namespace fluorocut::ui
