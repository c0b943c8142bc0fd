// SceneCamera: from where a scene is looked at. The head is always up: the viewer walks round the patient (azimuth) and
// rises above (elevation), so that nobody gets lost.
//
//     toward the viewer = (sin(azimuth) cos(elevation), -cos(azimuth) cos(elevation), sin(elevation))
//
// in the frame `femur` (DICOM LPS): at zero the viewer stands in front, positive azimuth is toward the patient's left.
// A pinhole picture with square pixels, its middle the focus; pixel (0, 0) has its upper left corner at (0, 0).
#pragma once

#include <QPointF>
#include <QSizeF>

#include "core/base/units.h"
#include "core/geometry/rigid3.h"
#include "ui/scene/scene.h"

namespace fluorocut::ui {

enum class LookFrom { anterior, posterior, left, right, superior };

struct SceneCamera {
    Vector3 focus = Vector3::Zero();
    double azimuth_rad = 0;
    double elevation_rad = 0;
    double distance_mm = 1000;                                  // of the viewer from the focus
    double view_angle_rad = fluorocut::radiansFromDegrees(25);  // from the picture's upper to its lower edge

    Vector3 towardViewer() const;
    Vector3 right() const;
    Vector3 up() const;
    Vector3 position() const { return focus + distance_mm * towardViewer(); }

    // Right, up, and how far in front of the viewer.
    Vector3 seen(const Vector3& point) const;
    // Pixels for a millimetre, one millimetre in front of the viewer.
    double focalLengthPx(const QSizeF& picture) const;
    // Where a point in front of the viewer appears.
    QPointF project(const Vector3& point, const QSizeF& picture) const;
    // From position() through a place in the picture; as long as its depth is 1 mm.
    Vector3 rayThrough(const QPointF& place, const QSizeF& picture) const;
    // Depths between which all of the ball lies, positive.
    struct Depths {
        double near_mm, far_mm;
    };
    Depths depths(const SceneBall& ball) const;

    // The hand: the scene follows it.
    void orbit(const QPointF& moved, const QSizeF& picture);
    void pan(const QPointF& moved, const QSizeF& picture);  // in the plane of the focus
    void zoom(double factor);
    void lookFrom(LookFrom side);
    // All of the ball is seen; the direction stays.
    void fit(const SceneBall& ball, const QSizeF& picture);
};

}  // namespace fluorocut::ui
