// ImplantTool: the planned stem under the hand, in one image.
//
//   drag the stem         moves it parallel to the image plane; what is held stays under the cursor
//   ring at the tip       turns it about the view's axis through its shoulder (the reference point at the resection)
//   ring at the shoulder  turns it about the view's axis through its tip
//   dot beyond the tip    tilts it about the line across the stem in the image plane, through its shoulder: toward the
//                         shoulder brings the tip nearer to the detector, 1 mm of hand is 1 mm of tip
//   dot beside the stem   turns it about its own axis: 1 mm of hand is 1 degree, as if one rolled its near side
//   arrows                0.1 mm on the screen, with Shift 1 mm; with Ctrl: tilt (up, down) and own axis by 0.1 degree
//   [ ] or , .            turn by 0.1 degree on the screen, with Shift by 1 degree
//   PageUp, PageDown      next size, next smaller one
//   S                     onto the canal's axis
//   Escape                lets go and puts it back where it was
//
// A drag is a preview until it ends, then one step to undo. Whatever cannot be done is said by refused() and beside the
// cursor, never silently ignored.
#pragma once

#include <QObject>

#include "ui/panels/plan_edits.h"
#include "ui/spreadsheet/view_tool.h"

namespace fluorocut::ui {

class ImplantTool final : public QObject, public ViewTool {
    Q_OBJECT

  public:
    ImplantTool(Session& session, const ImagePlace& place, QObject* parent = nullptr);

    bool press(ImageView& view, const Touch& touch) override;
    void drag(ImageView& view, const Touch& touch) override;
    void release(ImageView& view, const Touch& touch) override;
    Qt::CursorShape hover(ImageView& view, const Touch& touch) override;
    bool key(ImageView& view, int key, Qt::KeyboardModifiers modifiers) override;
    Overlay overlay(const ImageView& view) const override;

    bool isHolding() const { return held_.has_value(); }
    // What other sizes leave in place.
    void setKeptPoint(KeptPoint kept) { kept_ = kept; }

  signals:
    void refused(const QString& sentence);

  private:
    enum class Part { none, body, tip, shoulder, tilt, roll };
    struct Held {
        Part part = Part::none;
        Session::State start;
        Vector3 place = Vector3::Zero();  // of the body, in the implant's frame
        Vector2 from_px = Vector2::Zero();
    };
    struct Handles;

    std::optional<Handles> handles(const CaseState& state) const;
    Part partAt(const CaseState& state, const Touch& touch, Vector3* place) const;
    std::optional<Rigid3> moved(const Held& held, const Vector2& to_px) const;
    bool nudge(bool mirrored, int key, Qt::KeyboardModifiers modifiers);
    void commit(const QString& what, const Rigid3& pose);
    void refuse(const QString& sentence, const std::optional<Vector2>& at_px = {});
    QString refusalToTake(const CaseState& state, const Touch& touch) const;

    Session& session_;
    ImagePlace place_;
    KeptPoint kept_ = KeptPoint::resection;
    std::optional<Held> held_;
    Part near_ = Part::none;  // under the cursor
    QString refusal_;
    Vector2 refused_at_ = Vector2::Zero();
};

}  // namespace fluorocut::ui
