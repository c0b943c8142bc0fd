// register chain: robot_from_femur from all views, with its error budget.
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/register.h"
#include "app/cli/files.h"
#include "app/cli/numbers.h"
#include "app/cli/options.h"
#include "core/base/units.h"
#include "core/io/pose_file.h"
#include "core/registration/frame_graph.h"

namespace fluorocut::cli {
namespace {

struct Options {
    ChainInput input;
    std::string output;
    ChainOptions chain;
    double least_angle_deg = 10;
};

nlohmann::ordered_json numberOrNull(double value) {
    return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

// Which measurement each transform came from: one path for each view.
nlohmann::ordered_json pathsOf(const RegistrationFile& file) {
    nlohmann::ordered_json paths = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < file.problem.views.size(); ++i) {
        const ChainView& view = file.problem.views[i];
        const FrameNode robot{Frame::robot, ""}, femur{Frame::femur, ""}, flange{Frame::flange, view.name},
            corkscrew{Frame::corkscrew, view.name}, imager{Frame::imager, view.name};
        FrameGraph graph;
        graph.add({robot, flange, view.robot_from_flange, "robot", file.times[i], "", ""});
        graph.add({flange, corkscrew, file.problem.flange_from_corkscrew, "hand-eye calibration", "", "hand-eye", ""});
        graph.add({imager, corkscrew, view.imager_from_corkscrew.pose, "corkscrew", file.times[i], "", ""});
        graph.add({imager, femur, view.imager_from_femur.pose, "beads", file.times[i], "", ""});
        if (const Result<FoundTransform> found = graph.find(robot, femur)) paths.push_back(found->text);
    }
    return paths;
}

nlohmann::ordered_json jsonOf(const PointBudget& budget, const Chain& chain) {
    nlohmann::ordered_json terms = nlohmann::ordered_json::array();
    for (const std::size_t i : budget.largest_first) {
        const double share = budget.shares[i];
        terms.push_back({{"term", chain.terms[i].text()},
                         {"share", share},
                         {"rms_mm", std::sqrt(std::max(0.0, share * budget.covariance_mm2.trace()))}});
    }
    return {{"name", budget.point.name},
            {"in_femur_mm", arrayOf(budget.point.in_femur)},
            {"in_robot_mm", arrayOf(budget.in_robot)},
            {"covariance_mm2", rowsOf(budget.covariance_mm2)},
            {"radius95_mm", budget.radius95_mm},
            {"worst_sd_mm", budget.worst_sigma_mm},
            {"worst_direction_in_robot", arrayOf(budget.worst_direction)},
            {"budget", terms},
            {"sentence", budget.sentence}};
}

Report reportOf(const Chain& chain, const RegistrationFile& file, const Options& options) {
    Report report;
    nlohmann::ordered_json views = nlohmann::ordered_json::array(), points = nlohmann::ordered_json::array();
    for (const ChainViewResult& view : chain.views) {
        views.push_back({{"name", view.name},
                         {"used", view.used},
                         {"robot_from_femur", rowsOf(view.robot_from_femur.target_from_source.matrix())},
                         {"covariance", rowsOf(*view.robot_from_femur.covariance)},
                         {"residual", arrayOf(view.residual)},
                         {"residual_mm", view.residual_mm},
                         {"residual_deg", degreesFromRadians(view.residual.tail<3>().norm())},
                         {"chi_square", numberOrNull(view.chi_square)},
                         {"probability", numberOrNull(view.probability)},
                         {"beam_in_robot", arrayOf(view.beam_in_robot)}});
    }
    for (const PointBudget& budget : chain.points)
        points.push_back(jsonOf(budget, chain));
    const Pose& pose = chain.robot_from_femur;
    report.json = {
        {"file", options.output.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(options.output)},
        {"robot_from_femur", rowsOf(pose.target_from_source.matrix())},
        {"covariance", rowsOf(*pose.covariance)},
        {"points", points},
        {"views", views},
        {"outliers", chain.outliers},
        {"chi_square", numberOrNull(chain.chi_square)},
        {"degrees_of_freedom", chain.degrees_of_freedom},
        {"probability", numberOrNull(chain.probability)},
        {"view_angle_deg", degreesFromRadians(chain.view_angle_rad)},
        {"paths", pathsOf(file)},
        {"warnings", chain.warnings}};
    if (!options.output.empty()) report.line("pose", options.output);
    for (const PointBudget& budget : chain.points) {
        report.line("error", budget.sentence);
        std::string terms;
        for (std::size_t i = 0; i < std::min<std::size_t>(5, budget.largest_first.size()); ++i) {
            const std::size_t term = budget.largest_first[i];
            terms +=
                fmt::format("{}{} {:.0f} %", i > 0 ? ", " : "", chain.terms[term].text(), 100 * budget.shares[term]);
        }
        report.line("budget", terms);
    }
    for (const ChainViewResult& view : chain.views) {
        report.line("view",
                    fmt::format("{}: {:.3f} mm, {:.3f} degrees off{}", view.name, view.residual_mm,
                                degreesFromRadians(view.residual.tail<3>().norm()), view.used ? "" : "; left out"));
    }
    for (const std::string& one : chain.warnings)
        report.line("warning", one);
    report.judge(chain.acceptance);
    return report;
}

Result<Report> run(const Options& options, Progress& progress) {
    const Result<Measured> measured = measure(options.input, progress);
    if (!measured) return measured.error();
    const RegistrationFile* file = &measured->file;
    if (!options.output.empty()) {
        if (const Result<void> good = checkOutput(options.output, file->inputs, {".json"}); !good) return good.error();
    }
    ChainOptions chain_options = options.chain;
    if (!file->points.empty()) chain_options.points = file->points;
    chain_options.least_view_angle_rad = radiansFromDegrees(options.least_angle_deg);
    Result<Chain> chain = solveChain(file->problem, chain_options);
    if (!chain) {
        Error error = chain.error();
        if (error.code == ErrorCode::invalidInput && !options.input.measurements.empty())
            error.where = options.input.measurements + ", " + error.where;
        return error;
    }
    chain->warnings.insert(chain->warnings.begin(), measured->warnings.begin(), measured->warnings.end());
    chain->acceptance.insert(chain->acceptance.end(), measured->acceptance.begin(), measured->acceptance.end());
    if (!options.output.empty()) {
        if (const Result<void> written = writePose(options.output, chain->robot_from_femur); !written)
            return written.error();
    }
    return reportOf(*chain, *file, options);
}

}  // namespace

Command declareRegisterChain(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("chain", "robot_from_femur from all views, with its error budget");
    declareInput(*app, options->input);
    app->add_option("-o,--out", options->output, "robot_from_femur with its covariance, fluorocut/pose/1: .json");
    app->add_option("--min-angle-deg", options->least_angle_deg, "Views closer together than this are refused")
        ->check(between(0, 90))
        ->capture_default_str();
    app->add_option("--max-error-mm", options->chain.limits.most_radius95_mm,
                    "Acceptance limit: 95 % radius at the worst of the points")
        ->check(between(0, 1000))
        ->capture_default_str();
    app->add_option("--min-probability", options->chain.limits.least_probability,
                    "Acceptance limit: of views that disagree as much or more")
        ->check(between(0, 1))
        ->capture_default_str();
    app->footer(
        "Examples:\n"
        "  fluorocut-cli register chain --measurements poses.json --at-mm \"stem's tip=0,0,-120\" -o "
        "robot_from_femur.json\n"
        "  fluorocut-cli register chain --view ap.png,ap.json,robot1.json --view lat.png,lat.json,robot2.json \\\n"
        "      --beads femur.json --flange-from-corkscrew mount.json -o robot_from_femur.json");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace fluorocut::cli
