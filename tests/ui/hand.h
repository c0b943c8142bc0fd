// A hand on the mouse: events sent straight to a widget, with the pressed button recorded, which works on every
// platform (QTest::mouseMove delivers nothing to a widget on the offscreen one).
#pragma once

#include <QApplication>
#include <QMouseEvent>
#include <QWheelEvent>
#include <QWidget>

namespace fluorocut::test {

inline void sendMouse(QWidget& widget, QEvent::Type type, QPointF at, Qt::MouseButton button, Qt::MouseButtons pressed,
                      Qt::KeyboardModifiers modifiers = {}) {
    QMouseEvent event(type, at, widget.mapTo(widget.window(), at.toPoint()), widget.mapToGlobal(at.toPoint()), button,
                      pressed, modifiers);
    QApplication::sendEvent(&widget, &event);
}

inline void drag(QWidget& widget, QPointF from, QPointF to, Qt::MouseButton button = Qt::LeftButton,
                 Qt::KeyboardModifiers modifiers = {}) {
    constexpr int kSteps = 8;
    sendMouse(widget, QEvent::MouseButtonPress, from, button, button, modifiers);
    for (int i = 1; i <= kSteps; ++i) {
        sendMouse(widget, QEvent::MouseMove, from + (to - from) * i / kSteps, Qt::NoButton, button, modifiers);
    }
    sendMouse(widget, QEvent::MouseButtonRelease, to, button, Qt::NoButton, modifiers);
}

inline void turnWheel(QWidget& widget, QPointF at, int notches) {
    QWheelEvent event(at, widget.mapToGlobal(at.toPoint()), {}, {0, 120 * notches}, Qt::NoButton, Qt::NoModifier,
                      Qt::NoScrollPhase, false);
    QApplication::sendEvent(&widget, &event);
}

}  // namespace fluorocut::test
