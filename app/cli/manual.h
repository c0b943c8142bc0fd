// What a shell and `man` know of the program, made from the declarations that it is run by, so that neither can say
// anything else: the manual page (roff, man(7)) and completion for bash.
#pragma once

#include <string>

#include "app/cli/command_line.h"

namespace fluorocut::cli {

std::string manualPage(const CLI::App& app, const std::string& version);

// Completes commands, options, and the values of options that take one of a list; file names elsewhere.
std::string bashCompletion(const CLI::App& app);

}  // namespace fluorocut::cli
