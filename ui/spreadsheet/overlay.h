// What is drawn over an image: contours, points and their names, in the image's own pixels (centres at integers), so
// that it stays with the image under zoom, pan and flips.
//
// What a line is (its ink) tells how it looks; nobody else chooses colours. Inks that can meet in one image differ in
// hue for every kind of colour blindness (Okabe and Ito 2008) and in pattern besides.
#pragma once

#include <QColor>
#include <QString>
#include <QTransform>
#include <vector>

#include "core/geometry/rigid3.h"

class QPainter;

namespace fluorocut::ui {

enum class Ink {
    implant,    // the stem that is being planned
    stage,      // a cavity to be cut
    found,      // what was detected in the image
    predicted,  // where the model has it
    axis,       // of canal or stem
    corkscrew,
    bead,
    uncertainty,  // 95 % ellipses
    epipolar,     // a line and a point of other views
    measure,
    handle,  // to be taken with the mouse
};

QColor colorOf(Ink ink);

struct OverlayCurve {
    Ink ink = Ink::implant;
    std::vector<Vector2> points_px;
    bool closed = false;
    bool hidden = false;  // behind something: thin and dashed
};

enum class MarkShape { cross, dot, ring };

struct OverlayMark {
    Ink ink = Ink::bead;
    Vector2 at_px = Vector2::Zero();
    MarkShape shape = MarkShape::cross;
    QString name = {};
};

struct Overlay {
    std::vector<OverlayCurve> curves;
    std::vector<OverlayMark> marks;

    bool empty() const { return curves.empty() && marks.empty(); }
};

// Curves where they are defined: a point that is not finite (outside a distortion map) interrupts its curve.
void paintOverlay(QPainter& painter, const Overlay& overlay, const QTransform& widget_from_image);

}  // namespace fluorocut::ui
