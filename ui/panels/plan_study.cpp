#include "ui/panels/plan_study.h"

#include <utility>

#include "ui/panels/plan_edits.h"

namespace fluorocut::ui {

PlanStudy::PlanStudy(Session& session, QObject* parent) : QObject(parent), session_(session) {
    connect(&session_, &Session::changed, this, &PlanStudy::follow);
    connect(&femur_job_, &JobRunner::progressed, this, [this](double fraction) {
        fraction_ = fraction;
        emit changed();
    });
    const auto crashed = [this](const QString& what) {
        problem_ = tr("A fault of FluoroCut's own (%1); please report it.").arg(what);
        emit changed();
    };
    connect(&femur_job_, &JobRunner::crashed, this, crashed);
    connect(&fit_job_, &JobRunner::crashed, this, crashed);
    follow();
}

std::shared_ptr<const FemurStudy> PlanStudy::femur() const {
    return session_.state()->ct == ct_ ? femur_ : nullptr;
}

PlanStudy::Basis PlanStudy::wanted() const {
    const ImplantPlan& plan = session_.state()->plan;
    return {femur(), plan.implant, plan.femur_from_implant};
}

bool PlanStudy::fitIsStale() const {
    return fit_ && !fit_of_.is(wanted());
}

QString PlanStudy::message() const {
    const CaseState& state = *session_.state();
    if (!state.ct) return tr("Needs a CT: without one, only the images show how the stem fills the bone.");
    if (!problem_.isEmpty() && state.ct == ct_) return problem_;
    if (!femur()) return tr("Finding canal and walls in the CT: %1 %").arg(100 * fraction_, 0, 'f', 0);
    if (!state.plan.implant) return tr("Needs an implant.");
    if (!fit_problem_.isEmpty() && fit_of_.is(wanted())) return fit_problem_;
    if (!fit_) return tr("Working it out.");
    if (fitIsStale()) return tr("Out of date: working it out again.");
    return {};
}

void PlanStudy::follow() {
    const std::shared_ptr<const Volume>& ct = session_.state()->ct;
    if (ct != ct_) {
        if (femur_job_.isBusy()) {
            femur_job_.cancel();  // when it has stopped, follow() is called again
        } else {
            ct_ = ct;
            femur_.reset();
            problem_.clear();
            fraction_ = 0;
            if (ct) studyFemurOf(ct);
        }
    }
    workOutFit();
    emit changed();
}

void PlanStudy::studyFemurOf(const std::shared_ptr<const Volume>& ct) {
    FemurShaftOptions options;
    if (!session_.state()->side.empty()) options.side = sideOf(*session_.state());
    const std::optional<CanalAxis> canal = session_.state()->canal;
    femur_job_.run<FemurStudy>(
        [ct, options, canal](Progress& progress) -> Result<FemurStudy> {
            Result<FemurStudy> study = studyFemur(*ct, options, progress);
            if (study || study.error().isCancelled() || !canal) return study;
            // A femur whose neck is gone: the case's own axis leads.
            FemurShaftOptions along = options;
            along.axis = AxisLine{canal->distal, canal->proximal};
            return studyFemur(*ct, along, progress);
        },
        [this](Result<FemurStudy> study) {
            if (study)
                femur_ = std::make_shared<const FemurStudy>(std::move(*study));
            else if (!study.error().isCancelled())
                problem_ = QString::fromStdString(study.error().message());
            follow();
        });
}

void PlanStudy::workOutFit() {
    const Basis basis = wanted();
    if (!basis.femur || !basis.implant || fit_job_.isBusy() || fit_of_.is(basis)) return;
    fit_job_.run<StemInBone>([basis](Progress&) { return stemInBone(*basis.implant, basis.pose, *basis.femur); },
                             [this, basis](Result<StemInBone> fit) {
                                 fit_of_ = basis;
                                 fit_problem_ = fit ? QString() : QString::fromStdString(fit.error().message());
                                 fit_ = fit ? std::make_unique<StemInBone>(std::move(*fit)) : nullptr;
                                 follow();  // the hand may be elsewhere by now
                             });
}

}  // namespace fluorocut::ui
