// All subcommands, in the order in which the help shows them.
#pragma once

#include <array>

#include "app/cli/command.h"

namespace fluorocut::cli {

Command declareInfo(CLI::App& parent);

inline constexpr std::array<Declare, 1> kCommands{declareInfo};

}  // namespace fluorocut::cli
