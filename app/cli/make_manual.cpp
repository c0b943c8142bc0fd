// Writes manual.h's texts while FluoroCut is built: fluorocut-cli-manual OUT.1 OUT.bash. Not installed.
#include <cstdio>

#include <CLI/CLI.hpp>

#include "app/cli/commands/list.h"
#include "app/cli/manual.h"
#include "core/io/atomic_file.h"

int main(int argc, char** argv) {
    using namespace fluorocut;
    if (argc != 3) {
        std::fprintf(stderr, "fluorocut-cli-manual MANUAL_PAGE COMPLETION\n");
        return 2;
    }
    bool json = false;
    const cli::CommandLine line = cli::declareCommandLine(cli::kCommands, json);
    for (const auto& [path, text] : {std::pair(argv[1], cli::manualPage(*line.app, FLUOROCUT_VERSION)),
                                     std::pair(argv[2], cli::bashCompletion(*line.app))}) {
        if (const Result<void> written = writeWhole(path, text); !written) {
            std::fprintf(stderr, "fluorocut-cli-manual: %s\n", written.error().message().c_str());
            return 73;
        }
    }
    return 0;
}
