// PlanJobs: the long work that ends in an edit of the plan: planning automatically (core/planning/templating.h) and
// working out the stages' cavities (core/planning/cavity.h). One at a time, on a thread of its own, to be cancelled at
// any time. A result is committed as one step, unless what it was worked out of has changed meanwhile.
#pragma once

#include <QObject>

#include "ui/panels/plan_study.h"

namespace fluorocut::ui {

class PlanJobs final : public QObject {
    Q_OBJECT

  public:
    PlanJobs(Session& session, PlanStudy& study, QObject* parent = nullptr);

    enum class Job { none, automatic, cavities };
    Job running() const { return running_; }
    // What is against starting it, as a sentence; empty: nothing.
    QString whyNot(Job job) const;

    // Size and place of a stem of the plan's family ("straight" when none is chosen) from the CT.
    void planAutomatically();
    // Of every stage, for the implant, insets and cutter of the plan.
    void workOutCavities();
    void cancel() { runner_.cancel(); }

  signals:
    void progressed(double fraction, const QString& label);
    void changed();  // running() is another one
    // `notes`: what the work has to say of its result; or why there is none.
    void finished(bool ok, const QString& notes);

  private:
    struct Proposed {
        Implant implant;
        Rigid3 femur_from_cavity;
        StemSeat seat;
        AxisLine canal;
        QString notes;
    };

    void begin(Job job);
    void end(bool ok, const QString& notes);

    Session& session_;
    PlanStudy& study_;
    Job running_ = Job::none;
    JobRunner runner_;
};

}  // namespace fluorocut::ui
