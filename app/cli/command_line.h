// Reads the command line, runs one command, and turns what came of it into text or one JSON object and an exit code:
//
//   0 done and accepted             1 done, but an acceptance limit failed    2 wrong usage
//   3 an input is missing or wrong  4 the step found no solution              5 cancelled
//   70 our bug                      73 a result could not be written
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "app/cli/command.h"

namespace fluorocut::cli {

// All that can be said to the program. `json`: set when it is parsed; outlives it.
struct CommandLine {
    std::shared_ptr<CLI::App> app;
    std::vector<Command> commands;
};
CommandLine declareCommandLine(std::span<const Declare> commands, bool& json);

int runCommandLine(int argc, const char* const* argv, std::span<const Declare> commands);

}  // namespace fluorocut::cli
