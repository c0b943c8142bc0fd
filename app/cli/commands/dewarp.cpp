// dewarp: straight images, by the grooved plate.
#include "app/cli/commands/dewarp.h"

#include <chrono>
#include <cmath>

#include <CLI/CLI.hpp>
#include <fmt/chrono.h>
#include <fmt/format.h>

#include "app/cli/commands/list.h"
#include "app/cli/options.h"
#include "core/base/stopwatch.h"
#include "core/base/units.h"
#include "core/distortion/distortion_map_set.h"
#include "core/io/resources.h"

namespace fluorocut::cli {

void addMapOptions(CLI::App* app, MapOptions& options, bool plate_on) {
    CLI::Option* map = app->add_option("--map", options.map, "Distortion map, from dewarp fit");
    CLI::Option* maps = app->add_option("--maps", options.maps, "Set of maps by C-arm angle, from dewarp collect");
    map->excludes(maps);
    app->add_option("--orbital-deg", options.orbital_deg, "Where the C-arm stood, for --maps (else as the image says)")
        ->check(between(-360, 360))
        ->needs(maps);
    app->add_option("--angulation-deg", options.angulation_deg)->check(between(-90, 90))->needs(maps);
    if (!plate_on) return;
    app->add_option("--plate", options.plate, "The plate is in this image, which straightens itself: file or name")
        ->excludes(map)
        ->excludes(maps);
}

void addModelOptions(CLI::App* app, DistortionFitOptions& options) {
    std::vector<std::string> names;
    for (const DistortionModelKind& kind : distortionModels())
        if (kind.fit) names.emplace_back(kind.name);
    app->add_option("--model", options.model)->check(CLI::IsMember(names))->capture_default_str();
    app->add_option("--order", options.order, "Of the polynomial, 1 to 9; 0: chosen from the data")
        ->check(CLI::Range(0, 9))
        ->capture_default_str();
}

std::vector<std::filesystem::path> inputsOf(const MapOptions& options) {
    std::vector<std::filesystem::path> inputs;
    for (const std::string& file : {options.map, options.maps, options.plate})
        if (!file.empty()) inputs.emplace_back(file);
    return inputs;
}

std::optional<CArmPosition> positionOf(double orbital_deg, double angulation_deg, const ImageInfo* info) {
    if (std::isnan(orbital_deg) && info) orbital_deg = info->primary_angle_deg.value_or(orbital_deg);
    if (std::isnan(angulation_deg) && info) angulation_deg = info->secondary_angle_deg.value_or(angulation_deg);
    if (std::isnan(orbital_deg) || std::isnan(angulation_deg)) return std::nullopt;
    CArmPosition position;
    position.orbital_rad = radiansFromDegrees(orbital_deg);
    position.angulation_rad = radiansFromDegrees(angulation_deg);
    return position;
}

std::string nowUtc() {
    return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::chrono::system_clock::now()));
}

Result<PlateFit> fitPlate(const std::string& plate_file, const Image& image, const DistortionFitOptions& options,
                          Progress& progress) {
    const Result<std::filesystem::path> file = findResource("plates", plate_file);
    if (!file) return file.error();
    const Result<GroovedPlate> plate = readGroovedPlate(*file);
    if (!plate) return plate.error();
    SubProgress detecting(progress, 0, 0.8);
    Result<GrooveDetection> grooves = detectGrooves(image, *plate, {}, detecting);
    if (!grooves) return grooves.error();
    SubProgress fitting(progress, 0.8, 1);
    const Stopwatch stopwatch;
    Result<DistortionMap> map = fitDistortion(grooves->points, options, fitting);
    const double fit_ms = stopwatch.ms();
    if (!map) return map.error();
    return PlateFit{std::move(*grooves), std::move(*map), fit_ms};
}

Result<DistortionMap> mapFor(const MapOptions& options, const ImageFile* image, Progress& progress) {
    if (!options.map.empty()) return readDistortionMap(options.map);
    if (!options.maps.empty()) {
        const Result<DistortionMapSet> set = readDistortionMapSet(options.maps);
        if (!set) return set.error();
        const auto position = positionOf(options.orbital_deg, options.angulation_deg, image ? &image->info : nullptr);
        if (!position) {
            return invalidOption("--orbital-deg, --angulation-deg", "nothing, nor does the image say it",
                                 "where the C-arm stood when the image was taken");
        }
        return set->mapAt(*position, nowUtc());
    }
    if (!options.plate.empty() && image) {
        Result<PlateFit> fit = fitPlate(options.plate, image->image, options.fit, progress);
        if (!fit) return fit.error();
        return std::move(fit->map);
    }
    return invalidOption("dewarp", "no map", "--map MAP, --maps SET or --plate PLATE");
}

Command declareDewarp(CLI::App& parent) {
    CLI::App* app = parent.add_subcommand("dewarp", "Straight images: distortion maps from the grooved plate");
    app->fallthrough();
    app->require_subcommand(1);
    const std::vector<Command> kinds{declareDewarpFit(*app), declareDewarpApply(*app), declareDewarpPoints(*app),
                                     declareDewarpVerify(*app), declareDewarpCollect(*app)};
    app->footer("`fluorocut-cli dewarp fit --help` tells its options.");
    return {app, [kinds](Progress& progress) -> Result<Report> {
                for (const Command& kind : kinds) {
                    if (kind.app->parsed()) return kind.run(progress);
                }
                return invalidOption("dewarp", "no subcommand", "fit, apply, points, verify or collect", "see --help");
            }};
}

}  // namespace fluorocut::cli
