// paper-tables, Table 4: pockets in acrylic, cut in stages, beside the paper's figures.
#include <cmath>

#include <fmt/format.h>

#include "app/cli/commands/paper_tables_parts.h"
#include "core/base/units.h"
#include "core/experiments/table4.h"

namespace fluorocut::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<const char*, kTable4Trials> kSizes{"18 -> 23", "18 -> 23", "15 -> 20 -> 22"};

double paperOffset(const std::array<double, 2>& xy) {
    return std::hypot(xy[0], xy[1]);
}

Json jsonOf(const Table4Trial& trial) {
    Json cuts = Json::array();
    for (const StageFigures& stage : trial.run.stages)
        cuts.push_back({{"offset_mm", stage.truth.middle_mm},
                        {"rotation_deg", degreesFromRadians(stage.truth.turn_rad)},
                        {"worst_place_mm", stage.truth.most_mm},
                        {"bound_95_mm", stage.bound_mm},
                        {"held", stage.held}});
    return {{"scenario", trial.scenario},
            {"seed", trial.seed},
            {"finished", trial.run.finished},
            {"stopped", trial.run.stopped.empty() ? Json(nullptr) : Json(trial.run.stopped)},
            {"failure", trial.failure.empty() ? Json(nullptr) : Json(trial.failure)},
            {"cuts", cuts}};
}

void addRow(const Table4Trial& trial, std::size_t n, std::string& text) {
    const PaperOffsets& paper = paperTable4()[n];
    for (std::size_t cut = 0; cut < paper.size(); ++cut) {
        text += fmt::format("  {:<8}{:<16}{:>4}{:>10.2f}{:>8.2f}{:>10.2f}", cut == 0 ? fmt::format("{}", n + 1) : "",
                            cut == 0 ? kSizes[n] : "", cut + 1, paper[cut][0], paper[cut][1], paperOffset(paper[cut]));
        if (cut < trial.run.stages.size()) {
            const StageFigures& stage = trial.run.stages[cut];
            text +=
                fmt::format("{:>14.3f}{:>10.3f}{:>12.2f}{}\n", stage.truth.middle_mm,
                            degreesFromRadians(stage.truth.turn_rad), stage.bound_mm, stage.held ? "" : "  not held");
        } else {
            text += "             -\n";
        }
    }
    if (!trial.run.finished)
        text += fmt::format("          stopped: {}\n", trial.failure.empty() ? trial.run.stopped : trial.failure);
}

}  // namespace

Result<std::string> addTable4(const Table4Request& request, Json& json, Progress& progress) {
    Table4Options options;
    options.trials = request.trials;
    options.seed = request.seed;
    const auto table = runTable4(options, progress);
    if (!table) return table.error();
    std::string text = fmt::format(
        "Table 4: cuboid pockets, 40 mm deep, in acrylic; offset of the cut from the plan, mm\n"
        "  {:<8}{:<16}{:>4}{:>28}{:>36}\n  {:<8}{:<16}{:>4}{:>10}{:>8}{:>10}{:>14}{:>10}{:>12}\n",
        "", "", "", "paper", "FluoroCut", "trial", "size, mm", "cut", "x", "y", "offset", "offset", "degrees",
        "95 % bound");
    json["paper_trials"] = Json::array();
    for (std::size_t n = 0; n < table->paper.size(); ++n) {
        Json trial = jsonOf(table->paper[n]);
        trial["paper_offsets_mm"] = paperTable4()[n];
        json["paper_trials"].push_back(trial);
        addRow(table->paper[n], n, text);
    }
    json["random_trials"] = Json::array();
    for (const Table4Trial& trial : table->random)
        json["random_trials"].push_back(jsonOf(trial));
    json["final_offset_mm"] = jsonOf(table->final_mm);
    json["final_rotation_deg"] = jsonOf(table->final_deg);
    json["final_worst_place_mm"] = jsonOf(table->final_worst_place_mm);
    json["first_offset_mm"] = jsonOf(table->first_mm);
    json["first_rotation_deg"] = jsonOf(table->first_deg);
    json["cuts"] = table->cuts;
    json["bounds_broken"] = table->bounds_broken;
    json["final_bounds_broken"] = table->final_bounds_broken;
    json["finished"] = table->finished;
    json["stopped"] = table->stopped;
    json["failed"] = table->failed;
    json["elapsed_ms"] = table->elapsed_ms;
    text += fmt::format(
        "\n  {} runs ({} random): first cut {:.2f} mm, {:.2f} degrees; last cut {:.3f} mm (max {:.3f}), {:.3f} degrees "
        "(max {:.3f})\n  the paper's last cuts: 0.67, 0.29, 0.35 mm\n"
        "  announced 95 % bound broken in {} of {} cuts, {} of {} last cuts; {} stopped to ask, {} failed; {:.0f} s\n",
        table->paper.size() + table->random.size(), table->random.size(), table->first_mm.mean, table->first_deg.mean,
        table->final_mm.mean, table->final_mm.largest, table->final_deg.mean, table->final_deg.largest,
        table->bounds_broken, table->cuts, table->final_bounds_broken, table->finished, table->stopped, table->failed,
        table->elapsed_ms / 1000);
    for (const Table4Trial& trial : table->random)
        if (!trial.run.finished)
            text +=
                fmt::format("  seed {}: {}\n", trial.seed, trial.failure.empty() ? trial.run.stopped : trial.failure);
    return text;
}

}  // namespace fluorocut::cli
