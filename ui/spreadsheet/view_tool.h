// ViewTool: what the left mouse button does in an image view when it does not change the window: drag an implant, set
// a point, measure. One small class per tool; a view has at most one.
//
// Places are in image pixels (centres at integers); `reach_px` is how far from a thing the hand may be to take it, a
// fixed distance on the screen.
#pragma once

#include <Qt>

#include "core/geometry/rigid3.h"
#include "ui/spreadsheet/overlay.h"

namespace fluorocut::ui {

class ImageView;

struct Touch {
    Vector2 at_px = Vector2::Zero();
    double reach_px = 0;
    Qt::KeyboardModifiers modifiers;
};

class ViewTool {
  public:
    virtual ~ViewTool() = default;

    // False: not mine, the view goes on with window and level.
    virtual bool press(ImageView& view, const Touch& touch) = 0;
    virtual void drag(ImageView& view, const Touch& touch) = 0;
    virtual void release(ImageView& view, const Touch& touch) = 0;
    // No button is pressed; what the cursor should look like.
    virtual Qt::CursorShape hover(ImageView& view, const Touch& touch) = 0;
    // A key while the view has the focus (a Qt::Key); Escape during a drag ends it. False: not mine.
    virtual bool key(ImageView& view, int key, Qt::KeyboardModifiers modifiers);
    // What the hand may take hold of, drawn above the view's own overlay. Asked for with every painting: quick.
    virtual Overlay overlay(const ImageView& view) const;
};

inline bool ViewTool::key(ImageView&, int, Qt::KeyboardModifiers) {
    return false;
}

inline Overlay ViewTool::overlay(const ImageView&) const {
    return {};
}

}  // namespace fluorocut::ui
