#include "app/cli/command_line.h"
#include "app/cli/commands/list.h"

int main(int argc, char** argv) {
    return fluorocut::cli::runCommandLine(argc, argv, fluorocut::cli::kCommands);
}
