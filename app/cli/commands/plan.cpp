// plan: what is to be cut, and what it will look like.
#include "app/cli/commands/plan.h"

#include <vector>

#include <CLI/CLI.hpp>

#include "app/cli/commands/list.h"

namespace fluorocut::cli {

Command declarePlan(CLI::App& parent) {
    CLI::App* app = parent.add_subcommand("plan", "Plan the cavity and what comes of it");
    app->fallthrough();
    const std::vector<Command> kinds{
        declarePlanStages(*app),
        declarePlanPredict(*app),
        declarePlanTemplate(*app),
    };
    app->footer("`fluorocut-cli plan stages --help` tells its options.");
    return {app, [kinds](Progress& progress) -> Result<Report> {
                for (const Command& kind : kinds) {
                    if (kind.app->parsed()) return kind.run(progress);
                }
                return invalidOption("plan", "nothing to plan", "one of its subcommands", "see --help");
            }};
}

}  // namespace fluorocut::cli
