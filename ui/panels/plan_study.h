// PlanStudy: what follows from the CT and the plan and takes longer than a frame: the femur's canal and walls, once for
// a CT; fill and least wall, for every pose the implant comes to. Worked out behind the scenes, always for the latest
// state; while it lags behind, what is there is stale and says so.
#pragma once

#include <QObject>
#include <memory>

#include "core/planning/femur_study.h"
#include "ui/session/job_runner.h"
#include "ui/session/session.h"

namespace fluorocut::ui {

class PlanStudy final : public QObject {
    Q_OBJECT

  public:
    explicit PlanStudy(Session& session, QObject* parent = nullptr);

    // Of the CT in session.state(); null: not (yet) known.
    std::shared_ptr<const FemurStudy> femur() const;
    // Null: none; stale: of another pose, implant or CT than session.state() has.
    const StemInBone* fit() const { return fit_.get(); }
    bool fitIsStale() const;
    // Why there is nothing, or how far it is; empty: all is known and fresh.
    QString message() const;
    bool isFailure() const { return !problem_.isEmpty(); }

  signals:
    void changed();

  private:
    // What a fit was worked out of.
    struct Basis {
        std::shared_ptr<const FemurStudy> femur;
        std::shared_ptr<const Implant> implant;
        Rigid3 pose;
        bool is(const Basis& other) const {
            return femur == other.femur && implant == other.implant &&
                   (pose.matrix() - other.pose.matrix()).cwiseAbs().maxCoeff() == 0;
        }
    };

    Basis wanted() const;
    void follow();
    void studyFemurOf(const std::shared_ptr<const Volume>& ct);
    void workOutFit();

    Session& session_;
    std::shared_ptr<const Volume> ct_;  // that femur_ or problem_ is about
    std::shared_ptr<const FemurStudy> femur_;
    QString problem_;
    double fraction_ = 0;
    std::unique_ptr<StemInBone> fit_;
    Basis fit_of_;
    QString fit_problem_;
    JobRunner femur_job_, fit_job_;
};

}  // namespace fluorocut::ui
