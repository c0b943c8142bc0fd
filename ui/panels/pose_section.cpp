#include <QCoreApplication>
#include <QDoubleSpinBox>
#include <QHBoxLayout>
#include <QLabel>
#include <QPushButton>
#include <QVBoxLayout>
#include <cmath>

#include "core/base/units.h"
#include "ui/panels/plan_sections.h"

namespace fluorocut::ui {
namespace {

// What is edited, where it is usually to be, and how an edit is called.
struct Kind {
    const char *name, *step;
    const char* object;
    double StemNumbers::*value;
    bool angle;
    double reach, usual;
    const char* doubt;
};
constexpr Kind kKinds[] = {
    {QT_TRANSLATE_NOOP("PoseSection", "Varus (\u2212 valgus)"), QT_TRANSLATE_NOOP("PoseSection", "Change varus"),
     "varus", &StemNumbers::varus_rad, true, 30, 5,
     QT_TRANSLATE_NOOP("PoseSection", "More than 5\u00b0 off the canal's axis")},
    {QT_TRANSLATE_NOOP("PoseSection", "Flexion (\u2212 extension)"), QT_TRANSLATE_NOOP("PoseSection", "Change flexion"),
     "flexion", &StemNumbers::flexion_rad, true, 30, 5,
     QT_TRANSLATE_NOOP("PoseSection", "More than 5\u00b0 off the canal's axis")},
    {QT_TRANSLATE_NOOP("PoseSection", "Version (\u2212 retro)"), QT_TRANSLATE_NOOP("PoseSection", "Change version"),
     "version", &StemNumbers::version_rad, true, 90, 40,
     QT_TRANSLATE_NOOP("PoseSection", "More than 40\u00b0 of version")},
    {QT_TRANSLATE_NOOP("PoseSection", "Height"), QT_TRANSLATE_NOOP("PoseSection", "Change height"), "height",
     &StemNumbers::height_mm, false, 100, 1e9, ""},
    {QT_TRANSLATE_NOOP("PoseSection", "Medial (\u2212 lateral)"), QT_TRANSLATE_NOOP("PoseSection", "Shift medially"),
     "medial", &StemNumbers::medial_mm, false, 60, 15,
     QT_TRANSLATE_NOOP("PoseSection", "More than 15 mm beside the canal's axis")},
    {QT_TRANSLATE_NOOP("PoseSection", "Anterior (\u2212 posterior)"), QT_TRANSLATE_NOOP("PoseSection", "Shift forward"),
     "anterior", &StemNumbers::anterior_mm, false, 60, 15,
     QT_TRANSLATE_NOOP("PoseSection", "More than 15 mm beside the canal's axis")}};

QString translated(const char* text) {
    return *text ? QCoreApplication::translate("PoseSection", text) : QString();
}

double shown(const Kind& kind, double value) {
    // Rounded as it is shown, so that an edit of one number does not move another.
    const double in_unit = kind.angle ? degreesFromRadians(value) : value;
    return std::round(100 * in_unit) / 100;
}

}  // namespace

PoseSection::PoseSection(Session& session, PlanStudy& study, QWidget* parent)
    : Section(tr("Position"), parent), session_(session), study_(study) {
    for (const Kind& kind : kKinds) {
        auto* field = new NumberField(translated(kind.name), this);
        field->setObjectName(kind.object);
        const std::size_t index = fields_.size();
        connect(field, &NumberField::edited, this, [this, index](double value) { edit(index, value); });
        body()->addWidget(field);
        fields_.push_back(field);
    }
    auto* buttons = new QHBoxLayout;
    snap_ = new QPushButton(tr("Snap to canal"), this);
    snap_->setObjectName("snap");
    snap_->setToolTip(tr("The stem's axis onto the canal's, at the height it has (S in a view)"));
    canal_ = new QPushButton(tr("Take the CT's canal"), this);
    canal_->setObjectName("canal");
    canal_->setToolTip(tr("The canal's axis as it was found in the CT"));
    buttons->addWidget(snap_, 1);
    buttons->addWidget(canal_, 1);
    body()->addLayout(buttons);
    connect(snap_, &QPushButton::clicked, this, &PoseSection::snap);
    connect(canal_, &QPushButton::clicked, this, &PoseSection::takeCanal);
    refresh();
}

void PoseSection::refresh() {
    const CaseState& state = *session_.state();
    const bool known = state.plan.mesh != nullptr;
    for (NumberField* field : fields_)
        field->setVisible(known);
    snap_->setVisible(known);
    snap_->setEnabled(known && state.canal && !state.plan.locked);
    canal_->setVisible(!state.canal && study_.femur() != nullptr);
    canal_->setEnabled(!state.plan.locked);
    if (!known) {
        setState(tr("Nothing is placed yet."));
        return;
    }
    const SeatKnown reference = seatOf(state);
    setState(reference.of);
    const StemNumbers numbers = stemNumbers(reference.seat, state.plan.femur_from_implant, resectionOf(state.plan));
    for (std::size_t i = 0; i < fields_.size(); ++i) {
        const Kind& kind = kKinds[i];
        NumberState number;
        number.value = shown(kind, numbers.*kind.value);
        number.low = -kind.reach;
        number.high = kind.reach;
        number.step = 0.1;
        number.decimals = 2;
        number.unit = kind.angle ? QStringLiteral("\u00b0") : tr(" mm");
        if (state.canal && std::abs(number.value) > kind.usual) number.problem = translated(kind.doubt);
        number.fixed = state.plan.locked;
        fields_[i]->show(number);
    }
}

void PoseSection::edit(std::size_t field, double value) {
    const CaseState& state = *session_.committed();
    const Kind& kind = kKinds[field];
    if (!state.plan.mesh || state.plan.locked) return;
    const SeatKnown reference = seatOf(state);
    const double resection = resectionOf(state.plan);
    StemNumbers numbers = stemNumbers(reference.seat, state.plan.femur_from_implant, resection);
    if (shown(kind, numbers.*kind.value) == value) return;
    numbers.*kind.value = kind.angle ? radiansFromDegrees(value) : value;
    session_.commit(translated(kind.step), withPose(state, femurFromCavity(reference.seat, numbers, resection)));
}

void PoseSection::snap() {
    const CaseState& state = *session_.committed();
    if (!state.plan.mesh || !state.canal) return;
    session_.commit(tr("Snap implant to the canal"),
                    withPose(state, snappedTo({state.canal->distal, state.canal->proximal},
                                              state.plan.femur_from_implant, gripOf(state.plan).shoulder)));
}

void PoseSection::takeCanal() {
    const auto femur = study_.femur();
    if (!femur) return;
    CaseState next = *session_.committed();
    next.canal = CanalAxis{femur->shaft.axis.distal, femur->shaft.axis.proximal};
    session_.commit(tr("Take the canal's axis from the CT"), std::move(next));
}

}  // namespace fluorocut::ui
