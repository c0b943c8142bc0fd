// dewarp apply, points, collect: what distortion maps are for.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/dewarp.h"
#include "app/cli/files.h"
#include "app/cli/options.h"
#include "app/cli/point_table.h"
#include "core/base/stopwatch.h"
#include "core/base/units.h"
#include "core/distortion/dewarp.h"
#include "core/distortion/distortion_map_set.h"
#include "core/io/atomic_file.h"

namespace fluorocut::cli {
namespace {

struct ApplyOptions {
    MapOptions map;
    std::string image;
    int frame = 1;
    std::string resampling;  // empty: the model's own
    std::string output;
};

std::optional<Resampling> resamplingOf(const std::string& name) {
    if (name == "bspline") return Resampling::bspline;
    if (name == "two-pass") return Resampling::twoPass;
    if (name == "linear") return Resampling::linear;
    return std::nullopt;
}

// Interpolation overshoots at edges: whole numbers keep to the range of their kind of file.
Image withinRange(Image image, const std::string& output, const ImageInfo& info) {
    const std::string extension = extensionOf(output);
    if (extension != ".png" && extension != ".dcm") return image;
    const float most = info.is_float || info.bits > 8 ? 65535 : 255;
    for (float& value : image.pixels())
        value = std::clamp(value, 0.0F, most);
    return image;
}

Result<Report> runApply(const ApplyOptions& options, Progress& progress) {
    std::vector<std::filesystem::path> inputs = inputsOf(options.map);
    inputs.emplace_back(options.image);
    if (const auto good = checkOutput(options.output, inputs, {".png", ".tif", ".tiff", ".mha", ".nrrd", ".dcm"});
        !good)
        return good.error();
    const Result<ImageFile> file = readImage(options.image, {.frame = options.frame});
    if (!file) return file.error();
    SubProgress finding(progress, 0, 0.7);
    const Result<DistortionMap> map = mapFor(options.map, &*file, finding);
    if (!map) return map.error();

    progress.report(0.7, "resampling");
    const Stopwatch preparing;
    const Dewarper dewarper(*map, resamplingOf(options.resampling));
    const double prepare_ms = preparing.ms();
    const Stopwatch straightening;
    Result<Image> straight = dewarper.dewarped(file->image);
    if (!straight) return straight.error();
    const double elapsed_ms = straightening.ms();
    if (progress.isCancelled()) return cancelled("dewarp apply");

    ImageWriteOptions write;
    write.pixel_spacing_mm = Vector2::Constant(map->pixelMm());
    if (!file->info.is_float && file->info.bits <= 8 && extensionOf(options.output) == ".png")
        write.type = PixelType::uint8;
    const Image levels = withinRange(std::move(*straight), options.output, file->info);
    if (const auto written = writeImage(options.output, levels, write); !written) return written.error();

    const double answered =
        1 - static_cast<double>(dewarper.pixelsWithoutAnswer()) / static_cast<double>(levels.size());
    Report report;
    report.json = {{"file", options.output},     {"size", {levels.width(), levels.height()}},
                   {"pixel_mm", map->pixelMm()}, {"model", map->model().name()},
                   {"answered", answered},       {"prepare_ms", prepare_ms},
                   {"elapsed_ms", elapsed_ms}};
    report.line("straight image", options.output);
    report.line("size", fmt::format("{} x {} px of {:.5f} mm in the plate's plane", levels.width(), levels.height(),
                                    map->pixelMm()));
    report.line("answered", fmt::format("{:.1f} % of the pixels, the others are 0", 100 * answered));
    report.line("took", fmt::format("{:.1f} ms to prepare, {:.1f} ms to resample", prepare_ms, elapsed_ms));
    return report;
}

struct PointsOptions {
    MapOptions map;
    std::string points;
    std::string output;
    std::string axes = "plate";
};

Result<Report> runPoints(const PointsOptions& options, Progress& progress) {
    std::vector<std::filesystem::path> inputs = inputsOf(options.map);
    inputs.emplace_back(options.points);
    if (!options.output.empty()) {
        if (const auto good = checkOutput(options.output, inputs, {".csv"}); !good) return good.error();
    }
    const Result<DistortionMap> map = mapFor(options.map, nullptr, progress);
    if (!map) return map.error();
    const Result<std::vector<Vector2>> pixels = readPointTable(options.points);
    if (!pixels) return pixels.error();

    Report report;
    report.json = {{"axes", options.axes}, {"points", nlohmann::ordered_json::array()}};
    std::string table = "x_mm,y_mm,sd_mm,covered\n";
    std::size_t covered = 0;
    for (const Vector2& pixel : *pixels) {
        const Vector2 mm = options.axes == "plate" ? map->plateFromPixel(pixel) : map->detectorFromPixel(pixel);
        const double deviation = std::sqrt(0.5 * map->covariance(pixel).trace());
        const bool inside = map->covers(pixel);
        covered += inside ? 1 : 0;
        table += fmt::format("{:.6f},{:.6f},{:.6f},{}\n", mm.x(), mm.y(), deviation, inside ? 1 : 0);
        report.json["points"].push_back(
            {{"x_mm", mm.x()}, {"y_mm", mm.y()}, {"sd_mm", deviation}, {"covered", inside}});
    }
    report.json["covered"] = covered;
    if (options.output.empty()) {
        report.raw = table;
        return report;
    }
    if (const auto written = writeWhole(options.output, table); !written) return written.error();
    report.json["file"] = options.output;
    report.line("points", fmt::format("{} in {}", pixels->size(), options.output));
    report.line("covered by the map", std::to_string(covered));
    return report;
}

struct CollectOptions {
    std::vector<std::string> maps;
    std::string output;
};

Result<Report> runCollect(const CollectOptions& options, Progress&) {
    const std::vector<std::filesystem::path> files(options.maps.begin(), options.maps.end());
    if (const auto good = checkOutput(options.output, files, {".json"}); !good) return good.error();
    std::vector<DistortionMap> maps;
    for (const std::filesystem::path& file : files) {
        Result<DistortionMap> map = readDistortionMap(file);
        if (!map) return map.error();
        maps.push_back(std::move(*map));
    }
    const Result<DistortionMapSet> set = DistortionMapSet::create(std::move(maps));
    if (!set) return set.error();
    std::vector<std::filesystem::path> absolute;
    for (const std::filesystem::path& file : files)
        absolute.push_back(std::filesystem::absolute(file));
    if (const auto written = writeDistortionMapSet(options.output, *set, absolute); !written) return written.error();

    Report report;
    report.json = {{"file", options.output}, {"maps", nlohmann::ordered_json::array()}};
    report.line("set of maps", options.output);
    for (std::size_t i = 0; i < set->maps().size(); ++i) {
        const DistortionMapParts& parts = set->maps()[i].parts();
        const double orbital_deg = degreesFromRadians(parts.position->orbital_rad);
        const double angulation_deg = degreesFromRadians(parts.position->angulation_rad);
        report.json["maps"].push_back({{"file", options.maps[i]},
                                       {"orbital_deg", orbital_deg},
                                       {"angulation_deg", angulation_deg},
                                       {"measured_at", parts.measured_at}});
        report.line("map", fmt::format("{}: orbital {:.4g}, angulation {:.4g} degrees, {}", options.maps[i],
                                       orbital_deg, angulation_deg, parts.measured_at));
    }
    return report;
}

}  // namespace

Command declareDewarpApply(CLI::App& parent) {
    const auto options = std::make_shared<ApplyOptions>();
    CLI::App* app = parent.add_subcommand("apply", "Straighten an image");
    app->add_option("IMAGE", options->image, "Distorted image")->required();
    app->add_option("--frame", options->frame, "Of a multi-frame image, counted from 1")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    addMapOptions(app, options->map, true);
    addModelOptions(app, options->map.fit);
    app->add_option("--resampling", options->resampling, "Else as suits the map's model")
        ->check(CLI::IsMember({"bspline", "two-pass", "linear"}));
    app->add_option("-o,--out", options->output, "Image: .png .tif .mha .nrrd .dcm")->required();
    app->footer(
        "Examples:\n  fluorocut-cli dewarp apply --map map.json image.dcm -o straight.mha\n"
        "  fluorocut-cli dewarp apply --maps maps.json --orbital-deg 30 --angulation-deg 0 image.png -o straight.png\n"
        "  fluorocut-cli dewarp apply --plate paper image.png -o straight.png");
    return {app, [options](Progress& progress) { return runApply(*options, progress); }};
}

Command declareDewarpPoints(CLI::App& parent) {
    const auto options = std::make_shared<PointsOptions>();
    CLI::App* app = parent.add_subcommand("points", "Map pixels u_px,v_px to x_mm,y_mm in the detector plane");
    app->add_option("CSV", options->points, "Rows of u_px,v_px; a header line is skipped")->required();
    addMapOptions(app, options->map, false);
    app->add_option("--axes", options->axes,
                    "plate: along the grooves, from the crossing nearest to the middle; image: along columns and rows, "
                    "from the image's middle")
        ->check(CLI::IsMember({"plate", "image"}))
        ->capture_default_str();
    app->add_option("-o,--out", options->output, "Table: .csv (else on stdout)");
    app->footer("Example: fluorocut-cli dewarp points --map map.json pixels.csv -o mm.csv");
    return {app, [options](Progress& progress) { return runPoints(*options, progress); }};
}

Command declareDewarpCollect(CLI::App& parent) {
    const auto options = std::make_shared<CollectOptions>();
    CLI::App* app = parent.add_subcommand("collect", "Maps of key C-arm poses, for images without the plate");
    app->add_option("MAP", options->maps, "Maps from dewarp fit, each with the angles it was taken at")->required();
    app->add_option("-o,--out", options->output, "Set: .json")->required();
    app->footer("Example: fluorocut-cli dewarp collect ap.json oblique.json lateral.json -o maps.json");
    return {app, [options](Progress& progress) { return runCollect(*options, progress); }};
}

}  // namespace fluorocut::cli
