// PlanningTool: all that the hand does in one image while planning: measures first, where one is chosen or touched,
// then the implant.
//
//     view->setTool(new PlanningTool(session, measuring, {row}, view));  // and for every other view
#pragma once

#include "ui/panels/implant_tool.h"
#include "ui/panels/measure_tool.h"

namespace fluorocut::ui {

class PlanningTool final : public QObject, public ViewTool {
    Q_OBJECT

  public:
    // Measures belong to images before the cuts: an image after one shows the implant only.
    PlanningTool(Session& session, MeasureChoice& measuring, const ImagePlace& place, QObject* parent = nullptr);

    ImplantTool& implant() { return implant_; }

    bool press(ImageView& view, const Touch& touch) override;
    void drag(ImageView& view, const Touch& touch) override;
    void release(ImageView& view, const Touch& touch) override;
    Qt::CursorShape hover(ImageView& view, const Touch& touch) override;
    bool key(ImageView& view, int key, Qt::KeyboardModifiers modifiers) override;
    Overlay overlay(const ImageView& view) const override;

  signals:
    void refused(const QString& sentence);

  private:
    ImplantTool implant_;
    MeasureTool measure_;
    bool measures_;
    ViewTool* active_ = nullptr;  // whose drag it is
};

}  // namespace fluorocut::ui
