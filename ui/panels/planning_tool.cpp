#include "ui/panels/planning_tool.h"

#include "ui/spreadsheet/image_view.h"

namespace fluorocut::ui {

PlanningTool::PlanningTool(Session& session, MeasureChoice& measuring, const ImagePlace& place, QObject* parent)
    : QObject(parent),
      implant_(session, place),
      measure_(session, measuring, place.view),
      measures_(!place.after.has_value()) {
    connect(&implant_, &ImplantTool::refused, this, &PlanningTool::refused);
}

bool PlanningTool::press(ImageView& view, const Touch& touch) {
    active_ = nullptr;
    if (measures_ && measure_.press(view, touch))
        active_ = &measure_;
    else if (implant_.press(view, touch))
        active_ = &implant_;
    return active_ != nullptr;
}

void PlanningTool::drag(ImageView& view, const Touch& touch) {
    if (active_) active_->drag(view, touch);
}

void PlanningTool::release(ImageView& view, const Touch& touch) {
    if (active_) active_->release(view, touch);
    active_ = nullptr;
}

Qt::CursorShape PlanningTool::hover(ImageView& view, const Touch& touch) {
    if (measures_ && measure_.wants(touch)) return measure_.hover(view, touch);
    return implant_.hover(view, touch);
}

bool PlanningTool::key(ImageView& view, int key, Qt::KeyboardModifiers modifiers) {
    return (measures_ && measure_.key(view, key, modifiers)) || implant_.key(view, key, modifiers);
}

Overlay PlanningTool::overlay(const ImageView& view) const {
    Overlay drawn = implant_.overlay(view);
    if (!measures_) return drawn;
    Overlay measured = measure_.overlay(view);
    drawn.curves.insert(drawn.curves.end(), measured.curves.begin(), measured.curves.end());
    drawn.marks.insert(drawn.marks.end(), measured.marks.begin(), measured.marks.end());
    return drawn;
}

}  // namespace fluorocut::ui
