// info FILE: what a file holds, as it was read.
#include <filesystem>
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/list.h"

namespace fluorocut::cli {
namespace {

namespace fs = std::filesystem;

struct Options {
    std::string file;
};

Result<Report> run(const Options& options) {
    std::error_code ignored;
    if (!fs::exists(options.file, ignored)) {
        return invalidInput(options.file, "no such file or folder",
                            "an image, a volume, a mesh or a JSON file of FluoroCut");
    }
    return invalidInput(options.file, "a file that cannot be read yet", "an image, a volume, a mesh or a JSON file");
}

}  // namespace

Command declareInfo(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("info", "What a file holds, as it was read");
    app->add_option("FILE", options->file, "Image, volume, DICOM folder, mesh, or JSON file")->required();
    app->footer("Example: fluorocut-cli info pelvis.nii.gz");
    return {app, [options](Progress&) { return run(*options); }};
}

}  // namespace fluorocut::cli
