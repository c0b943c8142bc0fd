// The measurements of a chain, from a file of poses.
#include <CLI/CLI.hpp>

#include "app/cli/commands/register.h"
#include "app/cli/options.h"

namespace fluorocut::cli {

void declareInput(CLI::App& app, ChainInput& input) {
    app.add_option("--measurements", input.measurements, "Measured poses, fluorocut/registration/1")->required();
    app.add_option("--at-mm", input.at,
                   "Point of the femur whose error is wanted, x,y,z or NAME=x,y,z; again for each further one")
        ->allow_extra_args(false);
}

Result<RegistrationFile> measure(const ChainInput& input, Progress&) {
    Result<std::vector<NamedPoint>> points = pointsOf(input.at);
    if (!points) return points.error();
    Result<RegistrationFile> file = readRegistration(input.measurements);
    if (!file) return file.error();
    file->inputs.emplace_back(input.measurements);
    if (!points->empty()) file->points = std::move(*points);
    return file;
}

}  // namespace fluorocut::cli
