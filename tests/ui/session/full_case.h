// A small case in which every field has a value of its own, and whether two cases are the same.
#pragma once

#include "ui/session/case_state.h"

namespace fluorocut::test {

ui::CaseState fullCase();
void expectSame(const ui::CaseState& a, const ui::CaseState& b);

}  // namespace fluorocut::test
