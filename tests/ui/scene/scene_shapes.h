// Scenes of simple things, and pictures compared.
#pragma once

#include <QImage>
#include <algorithm>
#include <cstdlib>

#include "core/geometry/primitives.h"
#include "ui/scene/scene_renderer.h"

namespace fluorocut::test {

using ui::SceneItem;

inline SceneItem thing(const TriangleMesh& mesh, const QColor& color, const Rigid3& place = {}) {
    SceneItem item;
    item.surface = std::make_shared<const ShadedMesh>(shadedMesh(mesh));
    item.color = color;
    item.femur_from_item = place;
    measure(item);
    return item;
}

// Across the beam of a viewer in front, its lower left corner at the origin; seen from that side.
inline SceneItem square(double side_mm, const QColor& color, const Rigid3& place = {}) {
    const double s = side_mm;
    return thing({{{0, 0, 0}, {s, 0, 0}, {s, 0, s}, {0, 0, s}}, {{0, 1, 2}, {0, 2, 3}}}, color, place);
}

inline int difference(QRgb a, QRgb b) {
    return std::max({std::abs(qRed(a) - qRed(b)), std::abs(qGreen(a) - qGreen(b)), std::abs(qBlue(a) - qBlue(b))});
}

// The pixels that differ from those of the empty scene.
class Covered {
  public:
    Covered(const QImage& picture, const QImage& empty) : picture_(picture), empty_(empty) {}
    bool operator()(int x, int y) const { return difference(picture_.pixel(x, y), empty_.pixel(x, y)) > 6; }

  private:
    QImage picture_, empty_;
};

}  // namespace fluorocut::test
