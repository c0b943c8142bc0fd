// paper-tables: the experiments of Yao, Taylor et al. (2000) in simulation, beside the paper's own figures.
#include <array>
#include <cmath>
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/list.h"
#include "app/cli/commands/paper_tables_parts.h"
#include "app/cli/options.h"
#include "core/experiments/dewarp_experiment.h"

namespace fluorocut::cli {
namespace {

constexpr double kPaperCentreMm = 0.12;
constexpr double kPaperMarginMm = 0.25;

struct Options {
    int trials = 20;
    std::uint64_t seed = 1;
    double pixel_mm = 0.32;
    CorkscrewTablesRequest corkscrew;
    CavityTableRequest cavity;
    Table4Request table4;
    std::string only;

    bool wants(const std::string& experiment) const { return only.empty() || only == experiment; }
    // Of the progress, where all are wanted.
    SubProgress part(Progress& progress, double begin, double end) const {
        return only.empty() ? SubProgress(progress, begin, end) : SubProgress(progress, 0, 1);
    }
};

std::string cell(const ErrorFigures& figures) {
    return fmt::format("{:.3f} {:.3f}", figures.mean, figures.largest);
}

std::string row(const std::string& name, const std::string& overlay, const std::array<std::string, 4>& cells) {
    return fmt::format("  {:<19}{:<11}{:>15}{:>15}{:>15}{:>15}\n", name, overlay, cells[0], cells[1], cells[2],
                       cells[3]);
}

// Adds one run's rows to both.
void add(const DewarpExperimentResult& result, bool objects, nlohmann::ordered_json& json, std::string& text) {
    nlohmann::ordered_json models = nlohmann::ordered_json::array();
    for (const DewarpModelFigures& model : result.models) {
        models.push_back(
            {{"model", model.model},
             {"fits", model.fits},
             {"coverage", model.coverage},
             {"bead_distance_error_mm",
              {{"centre", jsonOf(model.beads_centre)}, {"margin", jsonOf(model.beads_margin)}}},
             {"map_error_mm", {{"centre", jsonOf(model.map_centre)}, {"margin", jsonOf(model.map_margin)}}}});
        text +=
            row(model.model, objects ? "objects" : "clear",
                {cell(model.beads_centre), cell(model.beads_margin), cell(model.map_centre), cell(model.map_margin)});
    }
    json["runs"].push_back({{"objects", objects},
                            {"trials", result.trials},
                            {"refused", result.refused},
                            {"wrong", result.wrong},
                            {"detect_ms", result.detect_ms},
                            {"fit_ms", result.fit_ms},
                            {"models", models}});
}

// Adds to the report; gives the text.
Result<std::string> addDewarp(const Options& options, Report& report, Progress& progress) {
    nlohmann::ordered_json dewarp = {{"pixel_mm", options.pixel_mm},
                                     {"paper", {{"centre_mm", kPaperCentreMm}, {"margin_mm", kPaperMarginMm}}},
                                     {"runs", nlohmann::ordered_json::array()}};
    std::string text = fmt::format(
        "Distortion: beads 20 mm apart over the grooved plate, dewarped by a saved map\n"
        "  {} trials of each, seed {}, {} mm pixels, 500-2000 photons per pixel, groove contrast 5-8 %; mm, mean and "
        "max\n\n",
        options.trials, options.seed, options.pixel_mm);
    text += row("", "", {"beads, centre", "beads, margin", "map, centre", "map, margin"});
    text +=
        row("paper", "clear", {fmt::format("{:.2f}", kPaperCentreMm), fmt::format("{:.2f}", kPaperMarginMm), "", ""});
    std::string counts;
    for (const bool objects : {false, true}) {
        DewarpExperimentOptions experiment;
        experiment.trials = options.trials;
        experiment.seed = options.seed;
        experiment.pixel_mm = options.pixel_mm;
        experiment.size_px = static_cast<int>(std::lround(512 * 0.32 / options.pixel_mm));
        experiment.objects = objects;
        SubProgress part(progress, objects ? 0.5 : 0, objects ? 1 : 0.5);
        const Result<DewarpExperimentResult> result = runDewarpExperiment(experiment, part);
        if (!result) return result.error();
        add(*result, objects, dewarp, text);
        counts += fmt::format("  {}: {} of {} lattices found, {} wrong, {:.0f} ms to find, {:.0f} ms to fit\n",
                              objects ? "objects" : "clear", result->trials - result->refused, result->trials,
                              result->wrong, result->detect_ms, result->fit_ms);
    }
    report.json["dewarp"] = dewarp;
    return text + "\n" + counts;
}

Result<Report> run(const Options& options, Progress& progress) {
    Report report;
    if (options.wants("dewarp")) {
        SubProgress part = options.part(progress, 0, 0.2);
        const Result<std::string> text = addDewarp(options, report, part);
        if (!text) return text.error();
        report.raw += *text;
    }
    if (options.wants("corkscrew")) {
        CorkscrewTablesRequest request = options.corkscrew;
        request.seed = options.seed;
        request.pixel_mm = options.pixel_mm;
        SubProgress part = options.part(progress, 0.2, 0.4);
        const Result<std::string> text = addCorkscrewTables(request, report.json["corkscrew"], part);
        if (!text) return text.error();
        report.raw += (report.raw.empty() ? "" : "\n") + *text;
    }
    if (options.wants("table-3")) {
        CavityTableRequest request = options.cavity;
        request.seed = options.seed;
        request.pixel_mm = options.pixel_mm;
        SubProgress part = options.part(progress, 0.4, 0.6);
        const Result<std::string> text = addCavityTable(request, report.json["table_3"], part);
        if (!text) return text.error();
        report.raw += (report.raw.empty() ? "" : "\n") + *text;
    }
    if (options.wants("table-4")) {
        Table4Request request = options.table4;
        request.seed = options.seed;
        SubProgress part = options.part(progress, 0.6, 1);
        const Result<std::string> text = addTable4(request, report.json["table_4"], part);
        if (!text) return text.error();
        report.raw += (report.raw.empty() ? "" : "\n") + *text;
    }
    return report;
}

}  // namespace

nlohmann::ordered_json jsonOf(const ErrorFigures& figures) {
    return {{"count", figures.count},
            {"mean", figures.mean},
            {"rms", figures.rms},
            {"percentile_95", figures.percentile_95},
            {"max", figures.largest}};
}

Command declarePaperTables(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("paper-tables", "The paper's experiments in simulation, beside its figures");
    app->add_option("--trials", options->trials, "Of the distortion's experiment")
        ->check(CLI::Range(1, 100000))
        ->capture_default_str();
    app->add_option("--seed", options->seed)->check(CLI::NonNegativeNumber)->capture_default_str();
    app->add_option("--pixel-mm", options->pixel_mm, "Of the detector, for the same field")
        ->check(between(0.1, 0.64))
        ->capture_default_str();
    app->add_option("--carms", options->corkscrew.carms, "Of Tables 1 and 2, the corkscrew's: 31 images with each")
        ->check(CLI::Range(1, 10000))
        ->capture_default_str();
    app->add_option("--scenes", options->corkscrew.scenes, "Random ones, of the corkscrew's accuracy")
        ->check(CLI::Range(1, 100000))
        ->capture_default_str();
    app->add_option("--corkscrew", options->corkscrew.corkscrew, "Corkscrew, a file or one built in by name")
        ->capture_default_str();
    app->add_option("--cuts", options->cavity.random_trials, "Random cuts, besides Table 3's five")
        ->check(CLI::Range(0, 100000))
        ->capture_default_str();
    app->add_flag("--imperfect-ct", options->cavity.imperfect_ct,
                  "Table 3 with a CT that is blurred, noisy, 5 % wrong");
    app->add_option("--runs", options->table4.trials, "Random procedures of Table 4, beside the paper's three")
        ->check(CLI::Range(0, 10000))
        ->capture_default_str();
    app->add_option("--only", options->only, "One of the experiments")
        ->check(CLI::IsMember({"dewarp", "corkscrew", "table-3", "table-4"}));
    app->footer(
        "Examples:\n"
        "  fluorocut-cli paper-tables --trials 100 --seed 7\n"
        "  fluorocut-cli paper-tables --only corkscrew --carms 20 --scenes 500\n"
        "  fluorocut-cli paper-tables --only table-3 --cuts 50\n"
        "  fluorocut-cli paper-tables --only table-4 --runs 17");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace fluorocut::cli
