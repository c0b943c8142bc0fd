// What there is to be seen in three dimensions, as values: surfaces, lines and names, each in its place. Made from a
// case by scene_content.h, drawn by a SceneRenderer. Frame `femur`, mm.
#pragma once

#include <QColor>
#include <QImage>
#include <QString>
#include <memory>
#include <vector>

#include "core/geometry/shaded_mesh.h"

namespace fluorocut::ui {

enum class SceneKind { bone, implant, cavities, views, path, robot };
inline constexpr int kSceneKinds = 6;

// A picture that lies on a surface.
struct ScenePicture {
    QImage image;
    std::vector<Vector2>
        places;  // of the surface's vertices in it: (0, 0) its upper left corner, (1, 1) the lower right
};

using SceneLines = std::vector<std::vector<Vector3>>;

struct SceneItem {
    SceneKind kind = SceneKind::bone;
    Rigid3 femur_from_item;
    std::shared_ptr<const ShadedMesh> surface;  // or lines
    std::shared_ptr<const SceneLines> lines;
    std::shared_ptr<const ScenePicture> picture;  // on the surface, which then has neither colour nor shade

    QColor color = Qt::white;
    double opacity = 1;      // where the surface is seen face on,
    double rim_opacity = 1;  // and edge on; both 1: opaque
    double shine = 0;        // of metal
    double ambient = 0.22;   // share of the light that comes from everywhere: glass needs more
    double width_px = 1;     // of lines
    bool one_sided = false;  // not seen from behind

    // A ball around it, in its own frame.
    Vector3 middle = Vector3::Zero();
    double radius_mm = 0;

    bool isOpaque() const { return opacity >= 1 && rim_opacity >= 1; }
};

struct SceneLabel {
    SceneKind kind = SceneKind::views;
    Vector3 at = Vector3::Zero();
    QString text;
};

// Of a translucent item only the nearest layer is drawn, over what is behind it. Translucent items are drawn in their
// order here: nested ones belong in it from the inside out.
struct Scene {
    std::vector<SceneItem> items;
    std::vector<SceneLabel> labels;
};

// A ball around all items: its middle, and its radius (0: there is nothing).
struct SceneBall {
    Vector3 middle = Vector3::Zero();
    double radius_mm = 0;
};
SceneBall ballAround(const std::vector<SceneItem>& items);
// Sets the item's own ball from its surface or lines.
void measure(SceneItem& item);

// The colours behind a scene, at the picture's upper and lower edge.
inline constexpr QColor kSceneAbove(38, 45, 53), kSceneBelow(10, 12, 15);

}  // namespace fluorocut::ui
