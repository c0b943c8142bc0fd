#include "ui/scene/scene_marks.h"

#include <QCoreApplication>
#include <QPainter>
#include <algorithm>
#include <array>

#include "ui/spreadsheet/overlay.h"

namespace fluorocut::ui {
namespace {

constexpr double kArm = 34;  // of the body's axes, screen pixels
constexpr double kCorner = 54;
constexpr QColor kPlate(0, 0, 0, 130);

struct Arm {
    const char* letter;
    Vector3 direction;
    Ink ink;
};

}  // namespace

void paintSceneLabel(QPainter& painter, const SceneCamera& camera, const QSizeF& picture, const SceneLabel& label) {
    if (!(camera.seen(label.at).z() > 1)) return;
    const QPointF at = camera.project(label.at, picture);
    QRectF text = painter.fontMetrics().boundingRect(label.text);
    text.moveCenter(at - QPointF(0, 12));
    painter.save();
    painter.setRenderHint(QPainter::Antialiasing);
    painter.setPen(Qt::NoPen);
    painter.setBrush(kPlate);
    painter.drawRoundedRect(text.adjusted(-5, -1, 5, 1), 3, 3);
    painter.setPen(colorOf(Ink::axis));
    painter.drawText(text.adjusted(-5, 0, 5, 0), Qt::AlignCenter, label.text);
    painter.restore();
}

void paintBodyAxes(QPainter& painter, const SceneCamera& camera, const QSizeF& picture) {
    const auto tr = [](const char* text) { return QCoreApplication::translate("SceneMarks", text); };
    std::array<Arm, 6> arms{Arm{QT_TRANSLATE_NOOP("SceneMarks", "L"), {1, 0, 0}, Ink::found},
                            {QT_TRANSLATE_NOOP("SceneMarks", "R"), {-1, 0, 0}, Ink::found},
                            {QT_TRANSLATE_NOOP("SceneMarks", "P"), {0, 1, 0}, Ink::corkscrew},
                            {QT_TRANSLATE_NOOP("SceneMarks", "A"), {0, -1, 0}, Ink::corkscrew},
                            {QT_TRANSLATE_NOOP("SceneMarks", "H"), {0, 0, 1}, Ink::implant},
                            {QT_TRANSLATE_NOOP("SceneMarks", "F"), {0, 0, -1}, Ink::implant}};
    const auto toward = [&](const Arm& arm) { return arm.direction.dot(camera.towardViewer()); };
    std::sort(arms.begin(), arms.end(), [&](const Arm& a, const Arm& b) { return toward(a) < toward(b); });

    painter.save();
    painter.setRenderHint(QPainter::Antialiasing);
    const QPointF middle(kCorner, picture.height() - kCorner);
    QFont font = painter.font();
    font.setBold(true);
    painter.setFont(font);
    for (const Arm& arm : arms) {
        const QPointF direction(arm.direction.dot(camera.right()), -arm.direction.dot(camera.up()));
        QColor color = colorOf(arm.ink);
        if (toward(arm) < -1e-3) color.setAlpha(110);
        const QPointF end = middle + kArm * direction;
        const bool away = std::hypot(direction.x(), direction.y()) < 0.25;  // its letter would lie on the middle
        painter.setPen(QPen(color, 2));
        painter.drawLine(middle, end);
        if (away) continue;
        QRectF letter(0, 0, 18, 18);
        letter.moveCenter(end + 9 * direction);
        painter.drawText(letter, Qt::AlignCenter, tr(arm.letter));
    }
    painter.restore();
}

}  // namespace fluorocut::ui
