// A subcommand of fluorocut-cli: a function that declares its options below `parent` and returns what to run once they
// have been read. To add one: a new file in commands/, its name in commands/list.h.
#pragma once

#include <functional>

#include "app/cli/report.h"
#include "core/base/progress.h"
#include "core/base/result.h"

namespace CLI {
class App;
}

namespace fluorocut::cli {

using Run = std::function<Result<Report>(Progress&)>;

struct Command {
    CLI::App* app = nullptr;
    Run run;
};

using Declare = Command (*)(CLI::App& parent);

}  // namespace fluorocut::cli
