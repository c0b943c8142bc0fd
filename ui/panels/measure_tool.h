// MeasureTool: lengths and angles set and moved by hand in one image, and the centre of the femur's own head.
//
//   with a kind chosen    press, drag and let go: a line, from its first point to its second (or click both); a length
//                         is one line, an angle two. The head's centre is one click in each of two views
//   a point               may be dragged at any time; the one that was touched last is the chosen one
//   Delete                removes the measure of the chosen point
//   Escape                lets go, or forgets a measure that is not finished
//
// Every measure stands at its line with its error; the plane it is taken in is said in the inspector. One step to undo
// for each.
#pragma once

#include <QObject>

#include "ui/panels/plan_edits.h"
#include "ui/spreadsheet/view_tool.h"

namespace fluorocut::ui {

enum class MeasureMode { none, length, angle, head_center };

// What the hand is about to measure: one choice for all views.
class MeasureChoice final : public QObject {
    Q_OBJECT

  public:
    using QObject::QObject;
    MeasureMode mode() const { return mode_; }
    void setMode(MeasureMode mode) {
        if (mode == mode_) return;
        mode_ = mode;
        emit changed();
    }

  signals:
    void changed();

  private:
    MeasureMode mode_ = MeasureMode::none;
};

class MeasureTool final : public QObject, public ViewTool {
    Q_OBJECT

  public:
    MeasureTool(Session& session, MeasureChoice& choice, std::size_t view, QObject* parent = nullptr);

    bool press(ImageView& view, const Touch& touch) override;
    void drag(ImageView& view, const Touch& touch) override;
    void release(ImageView& view, const Touch& touch) override;
    Qt::CursorShape hover(ImageView& view, const Touch& touch) override;
    bool key(ImageView& view, int key, Qt::KeyboardModifiers modifiers) override;
    Overlay overlay(const ImageView& view) const override;

    // A measure is being set or moved, or is about to be.
    bool wants(const Touch& touch) const;

  private:
    // A point of the case's measures; the head's centre is measure == kHead.
    struct Point {
        std::size_t measure = 0, point = 0;
        friend bool operator==(const Point&, const Point&) = default;
    };
    static constexpr std::size_t kHead = static_cast<std::size_t>(-1);

    std::optional<Point> pointAt(const CaseState& state, const Touch& touch) const;
    std::size_t pointsNeeded() const;
    void finish();
    void setHeadCenter(const Vector2& at_px);

    Session& session_;
    MeasureChoice& choice_;
    std::size_t view_;
    std::optional<Point> held_, chosen_;
    Session::State start_;              // when the point was taken
    Vector2 offset_ = Vector2::Zero();  // of the point from the cursor that holds it
    std::vector<Vector2> pending_;      // of a measure that is being set
    bool pulling_ = false;              // the last of them follows the cursor
};

}  // namespace fluorocut::ui
