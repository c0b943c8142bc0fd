// paper-tables, the corkscrew: Tables 1 and 2 beside the paper's figures, and the accuracy in random scenes.
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "app/cli/commands/paper_tables_parts.h"
#include "core/experiments/corkscrew_experiment.h"
#include "core/io/resources.h"

namespace fluorocut::cli {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<const char*, 2> kMethods{"fluorocut", "closed_form"};

Result<CorkscrewSceneOptions> scenesFor(const CorkscrewTablesRequest& request) {
    const Result<std::filesystem::path> file = findResource("fiducials", request.corkscrew);
    if (!file) return file.error();
    const Result<CorkscrewLayout> layout = readCorkscrew(*file);
    if (!layout) return layout.error();
    CorkscrewSceneOptions scenes;
    scenes.layout = *layout;
    scenes.seed = request.seed;
    scenes.imager.bent = true;
    scenes.imager.pixel_mm = request.pixel_mm;
    scenes.imager.size_px = static_cast<int>(std::lround(512 * 0.32 / request.pixel_mm));
    return scenes;
}

double paperError(std::size_t motion, std::size_t trial) {
    const PaperTrial& paper = paperCorkscrewTable()[motion][trial];
    return std::abs(paper.computed - paper.moved);
}

double paperMean(std::size_t motion) {
    double mean = 0;
    for (std::size_t trial = 0; trial < kPaperTrials; ++trial)
        mean += paperError(motion, trial) / kPaperTrials;
    return mean;
}

Json trialsJson(const std::vector<CorkscrewTables>& methods, std::size_t motion) {
    Json trials = Json::array();
    for (std::size_t trial = 0; trial < kPaperTrials; ++trial) {
        const PaperTrial& paper = paperCorkscrewTable()[motion][trial];
        Json row = {{"moved", paper.moved},
                    {"paper", {{"computed", paper.computed}, {"error", paperError(motion, trial)}}}};
        for (std::size_t m = 0; m < methods.size(); ++m) {
            const CorkscrewTableCell& cell = methods[m].cells[motion][trial];
            row[kMethods[m]] = {{"computed", cell.computed}, {"error", jsonOf(cell.errors)}, {"refused", cell.refused}};
        }
        trials.push_back(row);
    }
    return trials;
}

void addTable(const std::vector<CorkscrewTables>& methods, std::size_t first, const char* title, const char* unit,
              std::string& text) {
    // Of each method: mean and largest error.
    text += fmt::format("{}\n  {:<7}{:>8}{:>24}{:>22}{:>22}\n  {:<7}{:>8}{:>16} {:>7}{:>14} {:>7}{:>14} {:>7}\n", title,
                        "", "", "paper", "FluoroCut", "closed form", "", "moved", "computed", "error", "mean", "max",
                        "mean", "max");
    for (std::size_t motion = first; motion < first + 3; ++motion) {
        for (std::size_t trial = 0; trial < kPaperTrials; ++trial) {
            const PaperTrial& paper = paperCorkscrewTable()[motion][trial];
            text += fmt::format("  {:<7}{:>8}{:>16.2f} {:>7.2f}", trial == 0 ? kCorkscrewMotions[motion] : "",
                                paper.moved, paper.computed, paperError(motion, trial));
            for (const CorkscrewTables& method : methods) {
                const ErrorFigures& errors = method.cells[motion][trial].errors;
                text += fmt::format("{:>14.3f} {:>7.3f}", errors.mean, errors.largest);
            }
            text += "\n";
        }
        text += fmt::format("  {:<7}{:>8}{:>16} {:>7.2f}", "", "mean", "", paperMean(motion));
        for (const CorkscrewTables& method : methods)
            text += fmt::format("{:>14.3f} {:>7.3f}", method.errors[motion].mean, method.errors[motion].largest);
        text += fmt::format(" {}\n", unit);
    }
    text += "\n";
}

Result<void> addTables(const CorkscrewTablesRequest& request, const CorkscrewSceneOptions& scenes, Json& json,
                       std::string& text, Progress& progress) {
    CorkscrewTablesOptions options;
    options.scenes = scenes;
    options.repeats = request.carms;
    const auto methods = runCorkscrewTables(options, corkscrewMethods(options.pose), progress);
    if (!methods) return methods.error();
    json["carms"] = request.carms;
    for (const std::size_t first : {0, 3}) {
        Json table = Json::object();
        for (std::size_t motion = first; motion < first + 3; ++motion) {
            Json row = {{"trials", trialsJson(*methods, motion)}, {"paper_mean", paperMean(motion)}};
            for (std::size_t m = 0; m < methods->size(); ++m)
                row[kMethods[m]] = jsonOf((*methods)[m].errors[motion]);
            table[kCorkscrewMotions[motion]] = row;
        }
        json[first == 0 ? "table_1_deg" : "table_2_mm"] = table;
    }
    for (std::size_t m = 0; m < methods->size(); ++m) {
        json["images"] = (*methods)[m].images;
        json["refused"][kMethods[m]] = (*methods)[m].refused;
    }
    text += fmt::format(
        "Corkscrew: C-arm unaltered, the corkscrew moved by a known way between two images\n"
        "  {} C-arms, each bent and known by a map; seed {}, {} mm pixels, 1000 photons; errors of the movement\n\n",
        request.carms, request.seed, request.pixel_mm);
    addTable(*methods, 0, "Table 1, degrees", "deg", text);
    addTable(*methods, 3, "Table 2, mm", "mm", text);
    text += fmt::format("  no answer in {} of {} images (closed form: {})\n\n", (*methods)[0].refused,
                        (*methods)[0].images, (*methods)[1].refused);
    return {};
}

Result<void> addAccuracy(const CorkscrewTablesRequest& request, const CorkscrewSceneOptions& scenes, Json& json,
                         std::string& text, Progress& progress) {
    CorkscrewAccuracyOptions options;
    options.scenes = scenes;
    options.scenes.clutter = CorkscrewClutter::surgery();
    options.trials = request.scenes;
    const auto accuracy = measureCorkscrewAccuracy(options, progress);
    if (!accuracy) return accuracy.error();
    const CorkscrewAccuracy& a = *accuracy;
    // The paper's errors are those of its tables: of movements, in clear pictures.
    const std::array<std::tuple<const char*, const ErrorFigures*, const char*>, 6> rows{{{"twist", &a.twist_deg, "deg"},
                                                                                         {"roll", &a.roll_deg, "deg"},
                                                                                         {"pitch", &a.pitch_deg, "deg"},
                                                                                         {"x", &a.x_mm, "mm"},
                                                                                         {"y", &a.y_mm, "mm"},
                                                                                         {"depth", &a.depth_mm, "mm"}}};
    Json figures = Json::object();
    text += fmt::format(
        "Corkscrew: pose from one image, {} random scenes with hip, screws, clamp, spindle, retractor\n"
        "  {:<7}{:>10}{:>10}{:>10}{:>10}\n",
        options.trials, "", "mean", "95 %", "max", "paper");
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const auto& [name, errors, unit] = rows[i];
        figures[fmt::format("{}_{}", name, unit)] = jsonOf(*errors);
        text += fmt::format("  {:<7}{:>10.4f}{:>10.4f}{:>10.4f}{:>10.2f} {}\n", name, errors->mean,
                            errors->percentile_95, errors->largest, paperMean(i), unit);
    }
    json["accuracy"] = {
        {"scenes", options.trials},
        {"answered", a.answered},
        {"accepted", a.accepted},
        {"gross_accepted", a.gross_accepted},
        {"gross_refused", a.gross_refused},
        {"errors", figures},
        {"map_error_mm", a.map_error_mm},
        {"region_95", {{"pose", a.pose_covered}, {"place", a.place_covered}, {"rotation", a.rotation_covered}}},
        {"elapsed_ms", {{"median", a.median_ms}, {"percentile_95", a.percentile_95_ms}}},
        {"tracking",
         {{"tried", a.tracking_tried},
          {"accepted", a.tracked},
          {"gross", a.tracked_gross},
          {"median_ms", a.tracking_median_ms},
          {"percentile_95_ms", a.tracking_percentile_95_ms}}}};
    text += fmt::format(
        "  {} answered, {} accepted, {} of these wrong by more than 1 degree or 2 mm\n"
        "  {:.0f} ms (95 %: {:.0f}) from scratch; {} of {} tracked in {:.0f} ms (95 %: {:.0f})\n",
        a.answered, a.accepted, a.gross_accepted, a.median_ms, a.percentile_95_ms, a.tracked, a.tracking_tried,
        a.tracking_median_ms, a.tracking_percentile_95_ms);
    return {};
}

}  // namespace

Result<std::string> addCorkscrewTables(const CorkscrewTablesRequest& request, Json& json, Progress& progress) {
    const Result<CorkscrewSceneOptions> scenes = scenesFor(request);
    if (!scenes) return scenes.error();
    json["corkscrew"] = request.corkscrew;
    json["pixel_mm"] = request.pixel_mm;
    std::string text;
    SubProgress tables(progress, 0, 0.6), accuracy(progress, 0.6, 1);
    if (const auto done = addTables(request, *scenes, json, text, tables); !done) return done.error();
    if (const auto done = addAccuracy(request, *scenes, json, text, accuracy); !done) return done.error();
    return text;
}

}  // namespace fluorocut::cli
