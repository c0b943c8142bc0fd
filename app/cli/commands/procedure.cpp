// demo and procedure run: a whole procedure in the virtual operating room, from calibration to the final cavity.
#include <filesystem>
#include <memory>

#include <CLI/CLI.hpp>

#include "app/cli/commands/list.h"
#include "app/cli/commands/procedure_report.h"
#include "core/io/resources.h"

namespace fluorocut::cli {
namespace {

struct Options {
    std::string scenario = "demo";
    std::string ct;
    std::string case_file, report, captures;
    std::optional<std::uint64_t> seed;
};

void declareShared(CLI::App& app, Options& options) {
    app.add_option("--case", options.case_file,
                   "File that keeps all of it: .fluorocut; one of the same scenario is gone on with");
    app.add_option("--report", options.report, "Pages to read and print: .pdf or .html");
    app.add_option("--captures", options.captures,
                   "Folder, new or empty, for DICOM pictures of the planned and the final views");
    app.add_option("--seed", options.seed, "Instead of the scenario's: another room, other errors")
        ->check(CLI::NonNegativeNumber);
}

Result<Report> run(const Options& options, Progress& progress) {
    auto scenario = readScenario(options.scenario);
    if (!scenario) return scenario.error();
    if (options.seed) scenario->seed = *options.seed;
    if (!options.ct.empty()) {
        if (scenario->patient.kind != PatientKind::ct)
            return invalidOption("--ct", options.ct, "none: the patient of this scenario is generated");
        scenario->patient.ct = options.ct;
    }
    return runProcedureRequest({std::move(*scenario), options.case_file, options.report, options.captures}, progress);
}

}  // namespace

Command declareDemo(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("demo",
                                          "A whole procedure, simulated: calibrate, register, cut, locate, "
                                          "correct, cut again");
    declareShared(*app, *options);
    app->footer(
        "The scenario is resources/scenarios/demo.json: the built-in femur, a straight stem, three stages. Everything\n"
        "is accepted by the limits; what is not within them stops it (exit code 1).\n"
        "Example: fluorocut-cli demo --case demo.fluorocut --report demo.pdf");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

Command declareProcedure(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app =
        parent.add_subcommand("procedure", "A procedure in the virtual operating room, and the report of any");
    app->require_subcommand(1);
    CLI::App* sub = app->add_subcommand("run", "Runs a scenario by the limits alone");
    sub->add_option("--scenario", options->scenario,
                    "fluorocut/scenario/1: a file, or one that comes with FluoroCut by name")
        ->required();
    sub->add_option("--ct", options->ct, "The patient's CT, instead of the one that the scenario names");
    declareShared(*sub, *options);
    const auto pages = std::make_shared<ReportRequest>();
    CLI::App* report = app->add_subcommand("report", "The report of a saved case, finished or not; nothing is changed");
    report->add_option("case", pages->case_file, "Saved case: .fluorocut")->required();
    report->add_option("report", pages->report, "Pages to read and print: .pdf or .html")->required();
    report->add_option("--captures", pages->captures,
                       "Folder, new or empty, for DICOM pictures of the planned and the final views");
    report->add_option("--patient-id", pages->patient_id, "The archive's, for the DICOM pictures");
    app->footer(
        "Examples:\n"
        "  fluorocut-cli procedure run --scenario table4-1 --seed 7\n"
        "  fluorocut-cli procedure run --scenario femur-m3 --ct femur.nii.gz --case hip.fluorocut --report hip.html\n"
        "  fluorocut-cli procedure report hip.fluorocut hip.pdf --captures pictures");
    return {app, [options, pages, report](Progress& progress) {
                return report->parsed() ? runReportRequest(*pages, progress) : run(*options, progress);
            }};
}

}  // namespace fluorocut::cli
