// paper-tables, the cavity: Table 3 beside the paper's figures, and random motions, by every method in the same images.
#include <fmt/format.h>

#include "app/cli/commands/paper_tables_parts.h"
#include "core/experiments/cavity_experiment.h"

namespace fluorocut::cli {
namespace {

using Json = nlohmann::ordered_json;

Json arrayOf(const CavityOffset& offset) {
    Json six = Json::array();
    for (const double mm : offset.shift_mm)
        six.push_back(mm);
    for (const double rad : offset.roll_pitch_yaw_rad)
        six.push_back(degreesFromRadians(rad));
    return six;
}

Json jsonOfAnswer(const CavityAnswer& answer) {
    Json json = {{"answered", answer.answered}, {"accepted", answer.accepted}};
    if (!answer.refusal.empty()) json["refusal"] = answer.refusal;
    json["elapsed_ms"] = answer.elapsed_ms;
    if (!answer.answered) return json;
    json["computed"] = arrayOf(answer.computed);
    json["error_mm"] = answer.error_mm;
    json["error_deg"] = answer.error_deg;
    json["yaw_error_deg"] = answer.yaw_error_deg;
    json["chi_square"] = answer.chi_square;
    json["contour_residual_px"] = answer.contour_px;
    return json;
}

Json jsonOfFigures(const CavityFigures& figures) {
    return {{"trials", figures.trials},
            {"answered", figures.answered},
            {"accepted", figures.accepted},
            {"gross", figures.gross},
            {"gross_accepted", figures.gross_accepted},
            {"error_mm", jsonOf(figures.mm)},
            {"error_deg", jsonOf(figures.deg)},
            {"yaw_error_deg", jsonOf(figures.yaw_deg)},
            {"region_95", figures.covered},
            {"median_ms", figures.median_ms}};
}

const char* title(CavityEstimator estimator) {
    switch (estimator) {
        case CavityEstimator::paper:
            return "paper's";
        case CavityEstimator::paperWithCt:
            return "paper's, CT";
        case CavityEstimator::full:
            return "full";
        case CavityEstimator::fullWithoutCt:
            return "full, no CT";
    }
    return "";
}

std::string motionText(const CavityOffset& offset) {
    std::string text;
    for (const double mm : offset.shift_mm)
        text += fmt::format("{:>6.1f}", mm);
    for (const double rad : offset.roll_pitch_yaw_rad)
        text += fmt::format("{:>5.1f}", degreesFromRadians(rad));
    return text;
}

std::string errorText(const CavityAnswer& answer) {
    return answer.answered ? fmt::format("{:.3f} {:.2f}", answer.error_mm, answer.error_deg) : "refused";
}

}  // namespace

Result<std::string> addCavityTable(const CavityTableRequest& request, Json& json, Progress& progress) {
    CavityExperimentOptions options;
    options.random_trials = request.random_trials;
    options.seed = request.seed;
    options.scenes.pixel_mm = request.pixel_mm;
    options.scenes.imperfect_ct = request.imperfect_ct;
    const Result<CavityExperiment> done = runCavityExperiment(options, progress);
    if (!done) return done.error();

    const CavitySceneOptions& scenes = options.scenes;
    json = {{"pixel_mm", scenes.pixel_mm},
            {"voxel_mm", scenes.voxel_mm},
            {"implant", scenes.implant},
            {"imperfect_ct", scenes.imperfect_ct},
            {"convention",
             "planned_from_cut = T(x, y, z) Rz(yaw) Ry(pitch) Rx(roll) about the cavity's middle; z and "
             "yaw along and about the stem's axis, x medial; mm, degrees"},
            {"trials", Json::array()}};
    std::string text = fmt::format(
        "Table 3: where the cavity is, off the plan by x y z (mm), roll pitch yaw (degrees)\n"
        "  about its middle, z and yaw along and about the stem; {} stem, {} mm CT{}, two views {:.0f} degrees apart,\n"
        "  before and after up to {:.0f} mm and {:.0f} degrees apart, {} mm pixels; errors: mm, degrees\n\n  "
        "{:<36}{:>12}",
        scenes.implant, scenes.voxel_mm, scenes.imperfect_ct ? " (blurred, 5 % wrong scale, noisy)" : "",
        degreesFromRadians(scenes.view_angle_rad), scenes.pose_way_mm, degreesFromRadians(scenes.pose_turn_rad),
        scenes.pixel_mm, "     x     y     z roll pitc  yaw", "as printed");
    for (const CavityEstimator estimator : options.estimators)
        text += fmt::format("{:>14}", title(estimator));
    text += "\n";
    std::size_t of_paper = 0;
    std::vector<double> paper_mm, paper_deg;
    for (const CavityTrial& trial : done->trials) {
        Json row = {{"of_the_paper", trial.of_the_paper}, {"expected", arrayOf(trial.expected)}};
        if (trial.of_the_paper) {
            const PaperCavityTrial& printed = paperCavityTable()[of_paper++];
            paper_mm.push_back(printed.error_mm);
            paper_deg.push_back(printed.error_deg);
            row["printed"] = {{"computed", arrayOf(printed.computed)},
                              {"error_mm", printed.error_mm},
                              {"error_deg", printed.error_deg}};
            text += fmt::format("  {:<36}{:>12}", motionText(trial.expected),
                                fmt::format("{:.2f} {:.2f}", printed.error_mm, printed.error_deg));
            for (const CavityAnswer& answer : trial.answers)
                text += fmt::format("{:>14}", errorText(answer));
            text += "\n";
        }
        for (std::size_t e = 0; e < options.estimators.size(); ++e)
            row[name(options.estimators[e])] = jsonOfAnswer(trial.answers[e]);
        json["trials"].push_back(row);
    }
    for (const bool paper : {true, false}) {
        if (!paper && request.random_trials == 0) continue;
        const char* which = paper ? "five trials" : "random";
        text += fmt::format("\n  {:<14}{:>9}{:>9}{:>9}{:>9}{:>9}{:>10}{:>10}{:>10}{:>8}{:>9}\n", which, "mean mm",
                            "max", "mean deg", "max", "yaw", "answered", "accepted", "wrong", "95 %", "ms");
        if (paper) {
            const ErrorFigures mm = figuresOf(paper_mm), deg = figuresOf(paper_deg);
            text += fmt::format("  {:<14}{:>9.2f}{:>9.2f}{:>9.2f}{:>9.2f}\n", "as printed", mm.mean, mm.largest,
                                deg.mean, deg.largest);
        }
        for (std::size_t e = 0; e < options.estimators.size(); ++e) {
            const CavityFigures f = done->figures(e, paper);
            json[paper ? "five_trials" : "random"][name(options.estimators[e])] = jsonOfFigures(f);
            text += fmt::format("  {:<14}{:>9.3f}{:>9.3f}{:>9.2f}{:>9.2f}{:>9.2f}{:>10}{:>10}{:>10}{:>8.2f}{:>9.0f}\n",
                                title(options.estimators[e]), f.mm.mean, f.mm.largest, f.deg.mean, f.deg.largest,
                                f.yaw_deg.mean, fmt::format("{}/{}", f.answered, f.trials), f.accepted,
                                fmt::format("{} ({})", f.gross, f.gross_accepted), f.covered, f.median_ms);
        }
    }
    text += "  wrong: off by more than 1 mm or 3 degrees (and accepted all the same)\n";
    return text;
}

}  // namespace fluorocut::cli
