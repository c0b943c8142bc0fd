// The measures of a case, worked out from its state: what was placed in images and what the plan does to the hip. All
// numbers and their errors come from core/planning/measures.h; here only what goes into them is chosen, and said.
#pragma once

#include <QString>
#include <vector>

#include "core/planning/measures.h"
#include "ui/session/case_state.h"

namespace fluorocut::ui {

// Of a click, in u and in v: a hand is right to about a pixel.
inline constexpr double kClickSigmaPx = 1;
// How far from the stem's own depth what is measured there may lie: the bone around it.
inline constexpr double kDepthSigmaMm = 10;

// A length is taken in the plane of the implant's middle, parallel to the detector, where the view is registered and an
// implant is planned; otherwise in the detector's. NaN with a warning for points that are not (all) there.
Measure measureOf(const CaseState& state, const PlacedMeasure& placed);

struct NamedMeasure {
    QString name;
    Measure measure;
    std::optional<std::size_t> placed;  // which of CaseState::measures it is
};
// Leg length, offset and version of the plan, then what was placed. What is missing for one of them is its warning.
std::vector<NamedMeasure> measuresOf(const CaseState& state, const std::optional<LineFit>& canal);

// The middle of the femur's own head, from its clicks.
Result<UncertainPoint> headCenterOf(const CaseState& state);

// "42.3 ± 0.4 mm", "127.1 ± 0.3°"; a dash when it is not known.
QString textOf(const Measure& measure);

}  // namespace fluorocut::ui
