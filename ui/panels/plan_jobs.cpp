#include "ui/panels/plan_jobs.h"

#include <utility>

#include "core/planning/cavity.h"
#include "core/planning/implant_file.h"
#include "ui/panels/plan_edits.h"

namespace fluorocut::ui {
namespace {

constexpr const char* kUsualFamily = "straight";

QString listed(const std::vector<std::string>& sentences) {
    QString text;
    for (const std::string& sentence : sentences)
        text += (text.isEmpty() ? "" : "\n") + QString::fromStdString(sentence);
    return text;
}

using Meshes = std::vector<std::shared_ptr<const TriangleMesh>>;

struct Staged {
    Meshes cavities;
    std::vector<std::string> warnings;
};

Result<Staged> cavitiesOf(const ImplantPlan& plan, Progress& progress) {
    CavityOptions options;
    options.cutter_radius_mm = plan.cutter_radius_mm;
    options.top_mm = resectionOf(plan);
    SubProgress whole(progress, 0, 0.5);
    const Result<Cavity> final = planCavity(plan.implant ? plan.implant->in_bone : *plan.mesh, options, whole);
    if (!final) return final.error();
    Staged staged{{}, final->warnings};
    const double share = 0.5 / static_cast<double>(plan.insets_mm.size());
    for (const double inset : plan.insets_mm) {
        const double from = 0.5 + share * static_cast<double>(staged.cavities.size());
        SubProgress part(progress, from, from + share);
        Result<Cavity> stage = insetCavity(*final, inset, part);
        if (!stage) return stage.error();
        staged.cavities.push_back(std::make_shared<const TriangleMesh>(std::move(stage->mesh)));
    }
    return staged;
}

}  // namespace

PlanJobs::PlanJobs(Session& session, PlanStudy& study, QObject* parent)
    : QObject(parent), session_(session), study_(study) {
    connect(&runner_, &JobRunner::progressed, this, &PlanJobs::progressed);
    connect(&runner_, &JobRunner::crashed, this, [this](const QString& what) {
        end(false, tr("A fault of FluoroCut's own (%1); please report it.").arg(what));
    });
}

QString PlanJobs::whyNot(Job job) const {
    const CaseState& state = *session_.state();
    if (state.plan.locked) return tr("The plan is locked.");
    if (running_ != Job::none) return tr("Something else is being worked out.");
    if (job == Job::automatic && !state.ct) return tr("Planning automatically needs a CT.");
    if (job == Job::cavities && !state.plan.mesh) return tr("Cavities need an implant.");
    if (job == Job::cavities && state.plan.insets_mm.empty()) return tr("Cavities need at least one stage.");
    return {};
}

void PlanJobs::begin(Job job) {
    running_ = job;
    emit changed();
}

void PlanJobs::end(bool ok, const QString& notes) {
    running_ = Job::none;
    emit changed();
    emit finished(ok, notes);
}

void PlanJobs::planAutomatically() {
    if (!whyNot(Job::automatic).isEmpty()) return;
    const Session::State start = session_.committed();
    const auto known = study_.femur();
    begin(Job::automatic);
    runner_.run<Proposed>(
        [start, known](Progress& progress) -> Result<Proposed> {
            SubProgress studying(progress, 0, known ? 0 : 0.6), trying(progress, known ? 0 : 0.6, 1);
            std::shared_ptr<const FemurStudy> femur = known;
            if (!femur) {
                FemurShaftOptions options;
                if (!start->side.empty()) options.side = sideOf(*start);
                Result<FemurStudy> found = studyFemur(*start->ct, options, studying);
                if (!found) return found.error();
                femur = std::make_shared<const FemurStudy>(std::move(*found));
            }
            const ImplantPlan& plan = start->plan;
            const Result<std::vector<Implant>> sizes = loadSizes(plan.family.empty() ? kUsualFamily : plan.family,
                                                                 {{}, femur->seat.side, plan.head_mm, plan.neck_mm});
            if (!sizes) return sizes.error();
            const Result<TemplateProposal> proposal = proposeStem(*sizes, femur->walls, femur->seat, {}, trying);
            if (!proposal) return proposal.error();
            std::vector<std::string> notes = proposal->warnings;
            if (!proposal->next_size_reason.empty()) notes.push_back(proposal->next_size_reason);
            for (const Implant& implant : *sizes)
                if (implant.size == proposal->size)
                    return Proposed{implant, proposal->femur_from_cavity, femur->seat, femur->shaft.axis,
                                    listed(notes)};
            throw std::logic_error("planAutomatically: a size that was not offered");
        },
        [this, start](Result<Proposed> proposed) {
            if (!proposed) return end(false, QString::fromStdString(proposed.error().message()));
            const CaseState& now = *session_.committed();
            if (now.ct != start->ct || now.plan.locked || now.plan.family != start->plan.family ||
                now.plan.head_mm != start->plan.head_mm || now.plan.neck_mm != start->plan.neck_mm)
                return end(false, tr("The plan has changed meanwhile; plan again."));
            CaseState next = withImplant(now, std::move(proposed->implant), proposed->femur_from_cavity);
            if (next.side.empty()) next.side = name(proposed->seat.side);
            if (!next.canal) next.canal = CanalAxis{proposed->canal.distal, proposed->canal.proximal};
            session_.commit(tr("Plan automatically"), std::move(next));
            end(true, proposed->notes);
        });
}

void PlanJobs::workOutCavities() {
    if (!whyNot(Job::cavities).isEmpty()) return;
    const Session::State start = session_.committed();
    begin(Job::cavities);
    runner_.run<Staged>([start](Progress& progress) { return cavitiesOf(start->plan, progress); },
                        [this, start](Result<Staged> staged) {
                            if (!staged) return end(false, QString::fromStdString(staged.error().message()));
                            CaseState next = *session_.committed();
                            if (next.plan.mesh != start->plan.mesh || next.plan.locked ||
                                next.plan.insets_mm != start->plan.insets_mm ||
                                next.plan.cutter_radius_mm != start->plan.cutter_radius_mm)
                                return end(false, tr("The plan has changed meanwhile; work the cavities out again."));
                            next.plan.cavities = std::move(staged->cavities);
                            session_.commit(tr("Work out cavities"), std::move(next));
                            end(true, listed(staged->warnings));
                        });
}

}  // namespace fluorocut::ui
