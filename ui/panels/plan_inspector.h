// PlanInspector: the plan in words and numbers, beside the images: implant, position, measures, fill and wall, stages.
// It scrolls up and down, never sideways: it is as wide as its widest line at the font it is given.
//
//     auto* inspector = new PlanInspector(session, measuring, this);  // `measuring` is the tools' too
#pragma once

#include <QWidget>

#include "ui/panels/plan_sections.h"

class QScrollArea;

namespace fluorocut::ui {

class PlanInspector final : public QWidget {
    Q_OBJECT

  public:
    PlanInspector(Session& session, MeasureChoice& measuring, QWidget* parent = nullptr);

    PlanStudy& study() { return study_; }
    PlanJobs& jobs() { return jobs_; }
    // What other sizes leave in place: for the tools in the views.
    KeptPoint keptPoint() const { return implant_->keptPoint(); }

  signals:
    void keptPointChanged();

  protected:
    bool event(QEvent* event) override;
    void showEvent(QShowEvent* event) override;

  private:
    void refresh();
    void showJob();
    void fitWidth();

    PlanStudy study_;
    PlanJobs jobs_;
    QScrollArea* area_;
    ImplantSection* implant_;
    PoseSection* pose_;
    MeasuresSection* measures_;
    FillSection* fill_;
    StagesSection* stages_;
    QWidget* job_;
    QLabel* job_name_;
    QProgressBar* job_bar_;
    QLabel* notes_;
};

}  // namespace fluorocut::ui
