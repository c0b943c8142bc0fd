#include <QDoubleSpinBox>
#include <QLabel>
#include <QPushButton>
#include <QVBoxLayout>
#include <algorithm>

#include "core/planning/cavity.h"
#include "ui/panels/plan_sections.h"

namespace fluorocut::ui {
namespace {

constexpr int kMostStages = 8;
constexpr double kUsualLayerMm = 0.5;

}  // namespace

StagesSection::StagesSection(Session& session, PlanJobs& jobs, QWidget* parent)
    : Section(tr("Stages"), parent), session_(session), jobs_(jobs) {
    count_ = new NumberField(tr("Number"), this);
    count_->setObjectName("stages");
    cutter_ = new NumberField(tr("Cutter's radius"), this);
    cutter_->setObjectName("cutter");
    body()->addWidget(cutter_);
    body()->addWidget(count_);
    inset_rows_ = new QVBoxLayout;
    body()->addLayout(inset_rows_);
    cavities_ = new QPushButton(tr("Work out cavities"), this);
    cavities_->setObjectName("cavities");
    body()->addWidget(cavities_);
    connect(count_, &NumberField::edited, this, [this](double number) {
        const ImplantPlan& plan = session_.committed()->plan;
        const int stages = static_cast<int>(number);
        const double first = plan.insets_mm.size() > 1 ? plan.insets_mm.front() : kUsualLayerMm * (stages - 1);
        edit(stageInsets(stages, first), plan.cutter_radius_mm);
    });
    connect(cutter_, &NumberField::edited, this,
            [this](double radius) { edit(session_.committed()->plan.insets_mm, radius); });
    connect(cavities_, &QPushButton::clicked, &jobs_, &PlanJobs::workOutCavities);
    refresh();
}

void StagesSection::refresh() {
    const ImplantPlan& plan = session_.state()->plan;
    const std::size_t n = plan.insets_mm.size();
    cutter_->show({plan.cutter_radius_mm, 1, 10, 0.5, 1, tr(" mm"), {}, plan.locked});
    count_->show({static_cast<double>(n),
                  1,
                  kMostStages,
                  1,
                  0,
                  {},
                  n == 0 ? tr("None yet: choose how many") : QString(),
                  plan.locked});
    while (insets_.size() > n) {
        insets_.back()->deleteLater();
        insets_.pop_back();
    }
    while (insets_.size() < n) {
        const std::size_t stage = insets_.size();
        auto* field = new NumberField(tr("Stage %1 inside the last by").arg(stage + 1), this);
        field->setObjectName(QStringLiteral("inset%1").arg(stage));
        connect(field, &NumberField::edited, this, [this, stage](double inset) {
            const ImplantPlan& now = session_.committed()->plan;
            if (stage >= now.insets_mm.size()) return;
            std::vector<double> insets = now.insets_mm;
            insets[stage] = inset;
            edit(insets, now.cutter_radius_mm);
        });
        inset_rows_->addWidget(field);
        insets_.push_back(field);
    }
    for (std::size_t i = 0; i < n; ++i) {
        const bool last = i + 1 == n;
        insets_[i]->setVisible(!last);  // the final cavity itself: 0
        // Between its neighbours: a stage lies inside the next one.
        const double low = last ? 0 : plan.insets_mm[i + 1], high = i == 0 ? kMostInset_mm : plan.insets_mm[i - 1];
        insets_[i]->show({plan.insets_mm[i], low, high, 0.1, 2, tr(" mm"), {}, plan.locked || last});
    }
    const QString why = jobs_.whyNot(PlanJobs::Job::cavities);
    cavities_->setEnabled(why.isEmpty());
    cavities_->setToolTip(why);
    if (n == 0 || !plan.mesh)
        setState({});
    else if (plan.cavities.size() == n)
        setState(tr("Cavities are worked out for this implant, these insets and this cutter."));
    else
        setState(tr("Cavities are not worked out for this plan yet."), Tone::warning);
}

void StagesSection::edit(const std::vector<double>& insets_mm, double cutter_radius_mm) {
    CaseState next = *session_.committed();
    if (next.plan.locked || (next.plan.insets_mm == insets_mm && next.plan.cutter_radius_mm == cutter_radius_mm))
        return;
    next.plan.insets_mm = insets_mm;
    next.plan.cutter_radius_mm = cutter_radius_mm;
    next.plan.cavities.clear();
    session_.commit(tr("Change stages"), std::move(next));
}

}  // namespace fluorocut::ui
