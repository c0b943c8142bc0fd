// dewarp verify: the paper's bead test of a distortion map.
#include <cmath>
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/dewarp.h"
#include "app/cli/options.h"
#include "core/base/units.h"
#include "core/distortion/bead_test.h"
#include "core/fiducial/bead_detection.h"

namespace fluorocut::cli {
namespace {

struct Options {
    MapOptions map;
    std::string image;
    int frame = 1;
    BeadTestOptions test;
    BeadTestLimits limits;
};

nlohmann::ordered_json jsonOf(const DistanceErrors& errors) {
    return {
        {"pairs", errors.pairs}, {"mean_mm", errors.mean_mm}, {"rms_mm", errors.rms_mm}, {"max_mm", errors.largest_mm}};
}

std::string textOf(const DistanceErrors& errors) {
    if (errors.pairs == 0) return "no pairs";
    return fmt::format("{:.4f} mm mean, {:.4f} mm max, {} pairs", errors.mean_mm, errors.largest_mm, errors.pairs);
}

Result<Report> run(const Options& options, Progress& progress) {
    const Result<ImageFile> file = readImage(options.image, {.frame = options.frame});
    if (!file) return file.error();
    SubProgress finding(progress, 0, 0.3);
    const Result<DistortionMap> map = mapFor(options.map, &*file, finding);
    if (!map) return map.error();
    if (file->image.width() != map->columns() || file->image.height() != map->rows()) {
        return invalidInput(options.image, fmt::format("{} x {} pixels", file->image.width(), file->image.height()),
                            fmt::format("the map's size, {} x {}", map->columns(), map->rows()));
    }
    SubProgress detecting(progress, 0.3, 1);
    const Result<BeadDetections> beads = detectBeads(file->image, {}, detecting);
    if (!beads) return beads.error();
    std::vector<Vector2> points;
    for (const BeadDetection& bead : beads->beads)
        if (map->covers(bead.center_px)) points.push_back(map->detectorFromPixel(bead.center_px));
    const Result<BeadTest> test = beadTest(points, options.test);
    if (!test) return test.error();

    Report report;
    report.json = {{"beads", test->beads},
                   {"stray", test->stray},
                   {"outside_map", beads->beads.size() - points.size()},
                   {"spacing_mm", options.test.spacing_mm},
                   {"scale", test->scale},
                   {"rotation_deg", degreesFromRadians(test->rotation_rad)},
                   {"mean_mm", test->all_neighbours.mean_mm},
                   {"max_mm", test->all_neighbours.largest_mm},
                   {"centre", jsonOf(test->centre)},
                   {"margin", jsonOf(test->margin)},
                   {"neighbours", jsonOf(test->all_neighbours)},
                   {"all_pairs", jsonOf(test->all_pairs)}};
    report.line("beads", fmt::format("{} in the lattice, {} stray, {} outside the map", test->beads, test->stray,
                                     beads->beads.size() - points.size()));
    report.line("centre", textOf(test->centre));
    report.line("margin", textOf(test->margin));
    report.line("all neighbours", textOf(test->all_neighbours));
    report.line("all pairs", textOf(test->all_pairs));
    report.line("scale", fmt::format("{:.6f} of the true one", test->scale));
    report.judge(judge(*test, options.limits));
    return report;
}

}  // namespace

Command declareDewarpVerify(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("verify", "The paper's bead test: distances of beads on a lattice");
    app->add_option("--image", options->image, "Image of beads over the plate")->required();
    app->add_option("--frame", options->frame, "Of a multi-frame image, counted from 1")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    addMapOptions(app, options->map, false);
    app->add_option("--spacing-mm", options->test.spacing_mm, "Of the beads' lattice")
        ->check(between(1, 200))
        ->capture_default_str();
    app->add_option("--bead-height-mm", options->test.bead_height_mm,
                    "Of the beads' centres over half the grooves' depth: they are seen enlarged by f / (f - height)")
        ->check(between(-100, 500))
        ->capture_default_str();
    app->add_option("--source-mm", options->test.source_mm, "f, source to plate")
        ->check(between(10, 10000))
        ->capture_default_str();
    app->add_option("--max-centre-mm", options->limits.max_centre_mm, "Acceptance limit: mean error in the centre")
        ->check(between(0, 100))
        ->capture_default_str();
    app->add_option("--max-margin-mm", options->limits.max_margin_mm, "Acceptance limit: mean error in the margin")
        ->check(between(0, 100))
        ->capture_default_str();
    app->footer("Example: fluorocut-cli dewarp verify --map map.json --image beads.png --spacing-mm 20");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace fluorocut::cli
