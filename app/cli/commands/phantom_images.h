// The kinds of `phantom` that are pictures: what a C-arm shows of a calibration object.
#pragma once

#include "app/cli/command.h"

namespace fluorocut::cli {

Command declarePhantomPlate(CLI::App& phantom);
Command declarePhantomBeads(CLI::App& phantom);
Command declarePhantomCorkscrew(CLI::App& phantom);

}  // namespace fluorocut::cli
