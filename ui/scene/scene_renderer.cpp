#include "ui/scene/scene_renderer.h"

namespace fluorocut::ui {

ChosenRenderer makeSceneRenderer(SceneBackend backend) {
    ChosenRenderer chosen;
    // OpenGL does not draw what is translucent yet: it has to be asked for.
    if (backend == SceneBackend::automatic) {
        const bool wanted = qgetenv("FLUOROCUT_SCENE") == "opengl";
        if (!wanted) backend = SceneBackend::cpu;
    }
    if (backend != SceneBackend::cpu) chosen.renderer = makeOpenGLRenderer(&chosen.why_no_opengl);
    if (!chosen.renderer && backend != SceneBackend::openGL) chosen.renderer = makeCpuRenderer();
    return chosen;
}

}  // namespace fluorocut::ui
