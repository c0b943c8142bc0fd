#include "ui/shell/case_steps.h"

#include <QCoreApplication>
#include <algorithm>

namespace fluorocut::ui {
namespace {

struct CaseSteps {
    Q_DECLARE_TR_FUNCTIONS(CaseSteps)
};

NavigatorRow calibration(const CaseState& state) {
    if (state.calibrated_utc.empty())
        return {CaseSteps::tr("Calibrate C-arm"), StepMark::ready, CaseSteps::tr("not calibrated")};
    return {CaseSteps::tr("Calibrate C-arm"), StepMark::accepted,
            QString::fromStdString(state.calibrated_utc).left(10)};
}

NavigatorRow images(const CaseState& state) {
    const auto taken = std::count_if(state.views.begin(), state.views.end(),
                                     [](const CaseView& view) { return view.before.image != nullptr; });
    return {CaseSteps::tr("Images before"), taken > 0 ? StepMark::accepted : StepMark::ready,
            CaseSteps::tr("%n view(s)", nullptr, static_cast<int>(taken))};
}

NavigatorRow registration(const CaseState& state) {
    std::size_t found = 0;
    double worst_mm = 0;
    for (const CaseView& view : state.views) {
        if (!view.before.imager_from_femur) continue;
        ++found;
        worst_mm = std::max(worst_mm, view.before.registration_mm);
    }
    const QString name = CaseSteps::tr("Registration");
    if (state.views.empty()) return {name, StepMark::waiting, CaseSteps::tr("needs images")};
    if (found == 0) return {name, StepMark::ready, CaseSteps::tr("no view is registered")};
    const QString detail =
        CaseSteps::tr("%1 of %2 views, worst %3 mm").arg(found).arg(state.views.size()).arg(worst_mm, 0, 'f', 2);
    return {name, found == state.views.size() ? StepMark::accepted : StepMark::done, detail};
}

NavigatorRow plan(const CaseState& state) {
    const ImplantPlan& plan = state.plan;
    const QString name = CaseSteps::tr("Plan");
    if (!plan.mesh)
        return {name, state.views.empty() ? StepMark::waiting : StepMark::ready, CaseSteps::tr("no implant is chosen")};
    const QString implant = QString::fromStdString(plan.family + " " + plan.size);
    if (plan.cavities.empty() && !plan.insets_mm.empty())
        return {name, StepMark::stale, CaseSteps::tr("%1: the cavities are to be worked out").arg(implant)};
    return {name, plan.locked ? StepMark::accepted : StepMark::done, implant};
}

}  // namespace

std::vector<NavigatorRow> stepsOf(const CaseState& state) {
    std::vector<NavigatorRow> rows{calibration(state), images(state), registration(state), plan(state)};
    const bool planned = rows.back().mark == StepMark::accepted;
    std::size_t cuts = 0;
    for (const CaseView& view : state.views)
        cuts = std::max(cuts, view.after.size());
    const std::size_t stages = std::max(state.plan.insets_mm.size(), cuts);
    for (std::size_t k = 1; k <= stages; ++k) {
        const bool is_cut = k <= cuts, is_next = planned && k == cuts + 1 && state.found_cavities.size() == cuts;
        const bool is_found = k <= state.found_cavities.size();
        QString inset;
        if (k <= state.plan.insets_mm.size() && state.plan.insets_mm[k - 1] > 0)
            inset = CaseSteps::tr("%1 mm inside the final cavity").arg(state.plan.insets_mm[k - 1], 0, 'f', 2);
        else if (k <= state.plan.insets_mm.size())
            inset = CaseSteps::tr("the final cavity");
        rows.push_back({CaseSteps::tr("Cut %1").arg(k),
                        is_cut    ? StepMark::accepted
                        : is_next ? StepMark::ready
                                  : StepMark::waiting,
                        inset});
        rows.push_back(
            {CaseSteps::tr("Images after cut %1").arg(k), is_cut ? StepMark::accepted : StepMark::waiting, {}});
        rows.push_back({CaseSteps::tr("Locate cavity %1").arg(k),
                        is_found ? StepMark::accepted
                        : is_cut ? StepMark::ready
                                 : StepMark::waiting,
                        {}});
    }
    return rows;
}

}  // namespace fluorocut::ui
