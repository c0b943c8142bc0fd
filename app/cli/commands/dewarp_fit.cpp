// dewarp fit: a distortion map from an image of the grooved plate.
#include <cmath>
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/dewarp.h"
#include "app/cli/figures/dewarp_figure.h"
#include "app/cli/files.h"
#include "app/cli/options.h"
#include "core/base/units.h"
#include "core/distortion/distortion_acceptance.h"

namespace fluorocut::cli {
namespace {

struct Options {
    std::string image;
    int frame = 1;
    std::string plate = "paper";
    std::string output;
    std::string figure;
    DistortionFitOptions fit;
    double orbital_deg = std::nan("");
    double angulation_deg = std::nan("");
    std::string measured_at;
    DistortionLimits limits;
};

nlohmann::ordered_json countsOf(const GrooveCounts& counts) {
    return {{"expected", counts.expected},
            {"found", counts.found},
            {"hidden", counts.hidden},
            {"doubtful", counts.doubtful},
            {"outside", counts.outside}};
}

void addGrooves(Report& report, const GrooveDetection& grooves) {
    const int expected = grooves.along_y.expected + grooves.along_x.expected;
    const int found = grooves.along_y.found + grooves.along_x.found;
    report.json["segments"] = {{"along_y", countsOf(grooves.along_y)}, {"along_x", countsOf(grooves.along_x)}};
    report.json["pitch_px"] = grooves.pitch_px;
    report.json["rotation_deg"] = degreesFromRadians(grooves.rotation_rad);
    report.json["contrast"] = grooves.contrast;
    report.json["noise"] = grooves.noise;
    report.line("groove segments", fmt::format("{} of {} found", found, expected));
    report.line("plate", fmt::format("pitch {:.2f} px, turned by {:.2f} degrees, contrast {:.1f} %", grooves.pitch_px,
                                     degreesFromRadians(grooves.rotation_rad), 100 * grooves.contrast));
}

void addMap(Report& report, const DistortionMap& map) {
    const DistortionQuality& quality = map.quality();
    const MapUncertainty uncertainty = uncertaintyOf(map);
    report.json["model"] = map.model().name();
    report.json["residual_px"] = quality.rms_px;
    report.json["residual_mm"] = quality.rms_mm;
    report.json["points_used"] = quality.points_used;
    report.json["points_rejected"] = quality.points_rejected;
    report.json["grooves_found"] = {quality.columns_found, quality.rows_found};
    report.json["coverage"] = quality.coverage;
    report.json["pixel_mm"] = map.pixelMm();
    report.json["uncertainty_mm"] = {
        {"middle", uncertainty.middle_mm}, {"rms", uncertainty.rms_mm}, {"largest", uncertainty.largest_mm}};
    report.line("grooves", fmt::format("{} along y, {} along x", quality.columns_found, quality.rows_found));
    report.line("points", fmt::format("{} used, {} rejected", quality.points_used, quality.points_rejected));
    report.line("coverage", fmt::format("{:.0f} % of the image", 100 * quality.coverage));
    report.line("residual", fmt::format("{:.3f} px, {:.4f} mm rms", quality.rms_px, quality.rms_mm));
    report.line("uncertainty", fmt::format("{:.4f} mm in the middle, {:.4f} mm at most", uncertainty.middle_mm,
                                           uncertainty.largest_mm));
    report.line("pixel", fmt::format("{:.5f} mm in the plate's plane", map.pixelMm()));
}

Result<Report> run(const Options& options, Progress& progress) {
    if (const auto good = checkOutput(options.output, {options.image, options.plate}, {".json"}); !good)
        return good.error();
    if (!options.figure.empty()) {
        if (const auto good = checkOutput(options.figure, {options.image, options.plate}, {".png"}); !good)
            return good.error();
    }
    const Result<ImageFile> file = readImage(options.image, {.frame = options.frame});
    if (!file) return file.error();
    SubProgress fitting(progress, 0, options.figure.empty() ? 0.95 : 0.6);
    Result<PlateFit> fit = fitPlate(options.plate, file->image, options.fit, fitting);
    if (!fit) return fit.error();

    DistortionMapParts parts = fit->map.parts();
    parts.position = positionOf(options.orbital_deg, options.angulation_deg, &file->info);
    parts.measured_at = options.measured_at.empty() ? nowUtc() : options.measured_at;
    parts.quality.warnings.insert(parts.quality.warnings.begin(), fit->grooves.warnings.begin(),
                                  fit->grooves.warnings.end());
    const DistortionMap map(std::move(parts));
    if (const auto written = writeDistortionMap(options.output, map); !written) return written.error();
    if (!options.figure.empty()) {
        progress.report(0.7, "drawing");
        const Result<ColorImage> figure = dewarpFigure(file->image, fit->grooves, map);
        if (!figure) return figure.error();
        if (const auto written = writeFigure(options.figure, *figure); !written) return written.error();
    }

    Report report;
    report.json["file"] = options.output;
    report.line("map", fmt::format("{} ({})", options.output, map.model().name()));
    addGrooves(report, fit->grooves);
    addMap(report, map);
    const double detect_ms = fit->grooves.elapsed_ms;
    report.json["elapsed_ms"] = {{"detect", detect_ms}, {"fit", fit->fit_ms}};
    report.line("took", fmt::format("{:.0f} ms to find the grooves, {:.0f} ms to fit", detect_ms, fit->fit_ms));
    report.json["warnings"] = map.quality().warnings;
    for (const std::string& warning : map.quality().warnings)
        report.line("warning", warning);
    report.judge(judge(map, options.limits));
    return report;
}

}  // namespace

Command declareDewarpFit(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("fit", "Find the grooves of the plate and fit a distortion map to them");
    app->add_option("--image", options->image, "X-ray image of the plate")->required();
    app->add_option("--frame", options->frame, "Of a multi-frame image, counted from 1")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    app->add_option("--plate", options->plate, "Plate: a file (fluorocut/plate/1) or the name of one that comes along")
        ->capture_default_str();
    app->add_option("-o,--out", options->output, "Map: .json")->required();
    addModelOptions(app, options->fit);
    app->add_option("--pixel-mm", options->fit.pixel_mm, "Pixel of the straight image (else the image's own scale)")
        ->check(between(0.01, 10));
    app->add_option("--figure", options->figure, "Points, curves, straight image and displacements: .png");
    app->add_option("--orbital-deg", options->orbital_deg, "Where the C-arm stood (else as the image says)")
        ->check(between(-360, 360));
    app->add_option("--angulation-deg", options->angulation_deg)->check(between(-90, 90));
    app->add_option("--measured-at", options->measured_at, "UTC, as 2026-03-01T09:30:00Z (else now)");
    app->add_option("--max-residual-mm", options->limits.max_residual_mm, "Acceptance limit: rms of the points")
        ->check(between(0, 100))
        ->capture_default_str();
    app->add_option("--max-uncertainty-mm", options->limits.max_uncertainty_mm, "Acceptance limit: rms of the map")
        ->check(between(0, 100))
        ->capture_default_str();
    app->add_option("--min-coverage", options->limits.min_coverage, "Acceptance limit: share of the image")
        ->check(between(0, 1))
        ->capture_default_str();
    app->footer(
        "Example: fluorocut-cli dewarp fit --image plate.png --plate paper -o map.json "
        "--figure map.png");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace fluorocut::cli
