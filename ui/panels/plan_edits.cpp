#include "ui/panels/plan_edits.h"

#include <QCoreApplication>
#include <utility>

#include "core/io/resources.h"
#include "core/planning/implant_file.h"

namespace fluorocut::ui {
namespace {

QString tr(const char* text) {
    return QCoreApplication::translate("fluorocut::ui::PlanEdits", text);
}

}  // namespace

const TakenImage* takenImage(const CaseState& state, const ImagePlace& place) {
    if (place.view >= state.views.size()) return nullptr;
    const CaseView& view = state.views[place.view];
    if (!place.after) return &view.before;
    return *place.after < view.after.size() ? &view.after[*place.after] : nullptr;
}

std::optional<View> registeredView(const CaseState& state, const ImagePlace& place) {
    const TakenImage* taken = takenImage(state, place);
    if (!taken || !taken->imager_from_femur) return std::nullopt;
    const Pose& pose = *taken->imager_from_femur;
    return View{state.views[place.view].carm, pose.target_from_source, pose.covariance.value_or(Matrix6::Zero())};
}

QString whyFixed(const CaseState& state) {
    if (state.plan.locked) return tr("The plan is locked. Unlock it in the inspector before you change it.");
    if (!state.plan.mesh) return tr("No implant is chosen yet. Choose one in the inspector.");
    return {};
}

QString whyNotMovable(const CaseState& state, const ImagePlace& place) {
    if (const QString why = whyFixed(state); !why.isEmpty()) return why;
    const TakenImage* taken = takenImage(state, place);
    if (!taken) return tr("There is no image here.");
    if (taken->imager_from_femur) return {};
    const QString because = QString::fromStdString(taken->unregistered_because);
    return because.isEmpty() ? tr("This view is not registered: nothing can be placed in it.")
                             : tr("This view is not registered (%1): nothing can be placed in it.").arg(because);
}

double resectionOf(const ImplantPlan& plan) {
    return plan.implant ? plan.implant->resection_z_mm : 0;
}

StemGrip gripOf(const ImplantPlan& plan) {
    return gripOf(*plan.mesh, resectionOf(plan));
}

SeatKnown seatOf(const CaseState& state) {
    SeatKnown known;
    known.seat.side = sideOf(state);
    known.seat.axis = Vector3::UnitZ();
    // Patient coordinates: +x is the patient's left, and the head of a left femur lies toward the right.
    const Vector3 toward_head = known.seat.side == Side::left ? Vector3(-1, 0, 0) : Vector3(1, 0, 0);
    known.of = tr("against the patient's axes");
    if (state.canal) {
        known.seat.point = state.canal->proximal;
        known.seat.axis = (state.canal->proximal - state.canal->distal).normalized();
        known.of = tr("against the canal's axis");
    }
    known.seat.medial = (toward_head - toward_head.dot(known.seat.axis) * known.seat.axis).normalized();
    return known;
}

CaseState withPose(CaseState state, const Rigid3& femur_from_implant) {
    state.plan.femur_from_implant = femur_from_implant;
    return state;
}

CaseState withImplant(CaseState state, Implant implant, const Rigid3& femur_from_implant) {
    state.plan.family = implant.family;
    state.plan.size = implant.size;
    auto shared = std::make_shared<const Implant>(std::move(implant));
    state.plan.mesh = std::shared_ptr<const TriangleMesh>(shared, &shared->parts.front().mesh);
    state.plan.implant = std::move(shared);
    state.plan.femur_from_implant = femur_from_implant;
    state.plan.cavities.clear();
    return state;
}

Result<CaseState> withSize(const CaseState& state, const std::string& size, KeptPoint kept) {
    const ImplantPlan& plan = state.plan;
    ImplantChoice choice{size, sideOf(state), plan.head_mm, plan.neck_mm};
    Result<Implant> next = loadImplant(plan.family, choice);
    if (!next) return next.error();
    const Rigid3 pose =
        plan.implant ? resized(plan.femur_from_implant, *plan.implant, *next, kept) : plan.femur_from_implant;
    return withImplant(state, std::move(*next), pose);
}

Result<CaseState> withNextSize(const CaseState& state, int steps, KeptPoint kept) {
    const auto path = findResource("implants", state.plan.family);
    if (!path) return path.error();
    const Result<ImplantFamily> family = readImplantFamily(*path);
    if (!family) return family.error();
    const auto size = neighbourSize(*family, state.plan.size, steps);
    if (!size)
        return invalidOption("size", state.plan.size + (steps > 0 ? ", the largest" : ", the smallest"),
                             "a size between " + family->sizes.front().name + " and " + family->sizes.back().name);
    return withSize(state, *size, kept);
}

Side sideOf(const CaseState& state) {
    if (state.side == "right") return Side::right;
    return Side::left;
}

}  // namespace fluorocut::ui
