// What is painted over a 3D picture: names of places, and which way the body lies.
#pragma once

#include "ui/scene/scene_camera.h"

class QPainter;

namespace fluorocut::ui {

// Nothing when the place is behind the viewer.
void paintSceneLabel(QPainter& painter, const SceneCamera& camera, const QSizeF& picture, const SceneLabel& label);

// Three axes in the lower left corner, with R L, A P, H F at their ends: those that point toward the viewer bright.
void paintBodyAxes(QPainter& painter, const SceneCamera& camera, const QSizeF& picture);

}  // namespace fluorocut::ui
