// The parts of `plan`, each in its own file.
#pragma once

#include "app/cli/command.h"

namespace fluorocut::cli {

Command declarePlanStages(CLI::App& parent);
Command declarePlanPredict(CLI::App& parent);
Command declarePlanTemplate(CLI::App& parent);

}  // namespace fluorocut::cli
