// register advise: the next C-arm angle that lowers the worst direction of a point's error most.
#include <memory>

#include <CLI/CLI.hpp>

#include "app/cli/commands/register.h"
#include "app/cli/numbers.h"
#include "app/cli/options.h"
#include "core/base/units.h"
#include "core/registration/next_view.h"

namespace fluorocut::cli {
namespace {

struct Options {
    ChainInput input;
    int reference = 1;
    double reference_orbital_deg = 0, reference_angulation_deg = 0;
    double most_orbital_deg = 110, most_angulation_deg = 35, step_deg = 5;
};

nlohmann::ordered_json jsonOf(const ForecastView& view) {
    return {{"orbital_deg", degreesFromRadians(view.angles.orbital_rad)},
            {"angulation_deg", degreesFromRadians(view.angles.angulation_rad)},
            {"worst_sd_mm", view.worst_sigma_mm},
            {"turn_deg", degreesFromRadians(view.turn_rad)}};
}

Result<Report> run(const Options& options, Progress& progress) {
    const Result<Measured> measured = measure(options.input, progress);
    if (!measured) return measured.error();
    const RegistrationFile* file = &measured->file;
    NextViewOptions next;
    if (!file->points.empty()) next.target = file->points.front();
    next.reference = static_cast<std::size_t>(options.reference - 1);
    next.reference_angles = {radiansFromDegrees(options.reference_orbital_deg),
                             radiansFromDegrees(options.reference_angulation_deg)};
    next.most_orbital_rad = radiansFromDegrees(options.most_orbital_deg);
    next.most_angulation_rad = radiansFromDegrees(options.most_angulation_deg);
    next.step_rad = radiansFromDegrees(options.step_deg);
    const Result<NextView> advice = adviseNextView(file->problem, next);
    if (!advice) return advice.error();
    Report report;
    nlohmann::ordered_json grid = nlohmann::ordered_json::array();
    for (const ForecastView& view : advice->grid)
        grid.push_back(jsonOf(view));
    report.json = {{"target", next.target.name},
                   {"in_femur_mm", arrayOf(next.target.in_femur)},
                   {"worst_sd_mm", advice->worst_sigma_mm},
                   {"radius95_mm", advice->radius95_mm},
                   {"worst_direction_in_robot", arrayOf(advice->worst_direction)},
                   {"next", jsonOf(advice->best)},
                   {"next_radius95_mm", advice->best_radius95_mm},
                   {"next_covariance", rowsOf(advice->best.covariance)},
                   {"largest_term_then", advice->largest_term},
                   {"sentence", advice->sentence},
                   {"grid", grid},
                   {"warnings", measured->warnings}};
    report.line("advice", advice->sentence);
    for (const std::string& one : measured->warnings)
        report.line("warning", one);
    return report;
}

}  // namespace

Command declareRegisterAdvise(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("advise", "The next C-arm angle that lowers the error at a point most");
    declareInput(*app, options->input);
    app->add_option("--reference", options->reference, "The view, from 1, that angles are known of")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    app->add_option("--reference-orbital-deg", options->reference_orbital_deg,
                    "How the C-arm stood for it; by default angles are counted from it")
        ->check(between(-180, 180))
        ->capture_default_str();
    app->add_option("--reference-angulation-deg", options->reference_angulation_deg, "The same")
        ->check(between(-90, 90))
        ->capture_default_str();
    app->add_option("--max-orbital-deg", options->most_orbital_deg, "How far the C-arm turns, either way")
        ->check(between(0, 180))
        ->capture_default_str();
    app->add_option("--max-angulation-deg", options->most_angulation_deg, "How far it tilts, either way")
        ->check(between(0, 90))
        ->capture_default_str();
    app->add_option("--step-deg", options->step_deg, "Of the grid of angles")
        ->check(between(1, 90))
        ->capture_default_str();
    app->footer(
        "Example:\n"
        "  fluorocut-cli register advise --measurements poses.json --at-mm \"stem's tip=0,0,-120\" --max-orbital-deg "
        "95");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace fluorocut::cli
