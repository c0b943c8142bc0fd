// The steps of the procedure as far as a case tells them: what the navigator shows.
#pragma once

#include <vector>

#include "ui/panels/navigator.h"
#include "ui/session/case_state.h"

namespace fluorocut::ui {

std::vector<NavigatorRow> stepsOf(const CaseState& state);

}  // namespace fluorocut::ui
