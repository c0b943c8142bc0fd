// calibrate imager: the intrinsics of an imager from pictures of a bead phantom.
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/list.h"
#include "app/cli/files.h"
#include "app/cli/numbers.h"
#include "app/cli/options.h"
#include "core/base/units.h"
#include "core/distortion/distortion_map.h"
#include "core/fiducial/bead_detection.h"
#include "core/fiducial/imager_calibration.h"
#include "core/imaging/carm_file.h"
#include "core/io/image_file.h"
#include "core/io/json_file.h"
#include "core/io/resources.h"

namespace fluorocut::cli {
namespace {

namespace fs = std::filesystem;

constexpr double kAssumedPixelMm = 0.32;
// Where neither a C-arm nor a header gives the focal length: so many image widths. Image intensifiers and flat panels
// have 4 to 6.
constexpr double kFocalLengthInWidths = 5;

struct Options {
    std::vector<std::string> images;
    std::string phantom = "two-plane";
    std::string output;
    std::string map;
    std::string carm;
    std::optional<double> pixel_mm;
    int frame = 1;
    bool aspect = false;
    bool bright = false;
    double most_focal_percent = 100 * ImagerAcceptanceLimits{}.most_focal_sigma;
    ImagerAcceptanceLimits limits;
};

// What is known before the pictures of the phantom are looked at.
struct Known {
    CArm nominal;
    PixelScaleSource pixel_scale_source = PixelScaleSource::assumed;
    std::optional<DistortionMap> map;
    fs::path map_file;
    std::vector<std::string> warnings;
};

// The map that a C-arm's file names.
Result<fs::path> mapOf(const fs::path& carm) {
    Result<JsonObject> file = readJson(carm, "fluorocut/carm/1");
    if (!file) return file.error();
    const std::optional<std::string> named = file->optionalText("distortion");
    return named ? carm.parent_path() / *named : fs::path();
}

Result<Known> gather(const Options& options, const ImageInfo& info) {
    Known known;
    CArm& nominal = known.nominal;
    bool focal_known = false;
    if (!options.carm.empty()) {
        const Result<CArm> carm = readImager(options.carm);
        if (!carm) return carm.error();
        if (carm->columns != info.width || carm->rows != info.height) {
            return invalidInput(options.carm, fmt::format("{} x {} pixels", carm->columns, carm->rows),
                                fmt::format("the images' {} x {}", info.width, info.height));
        }
        nominal = *carm;
        known.pixel_scale_source = PixelScaleSource::stated;
        focal_known = true;
        if (carm->distortion && options.map.empty()) {
            const Result<fs::path> map = mapOf(options.carm);
            if (!map) return map.error();
            known.map_file = *map;
        }
    } else {
        nominal.name = info.manufacturer.empty() ? "C-arm" : info.manufacturer;
        nominal.columns = info.width;
        nominal.rows = info.height;
        nominal.principal_point_px = 0.5 * Vector2(info.width - 1, info.height - 1);
        nominal.pixel_mm = Vector2::Constant(kAssumedPixelMm);
        if (info.imager_pixel_spacing_mm) {
            nominal.pixel_mm = *info.imager_pixel_spacing_mm;
            known.pixel_scale_source = PixelScaleSource::header;
        } else if (info.pixel_spacing_mm && info.spacing_plane == SpacingPlane::unstated &&
                   *info.pixel_spacing_mm != Vector2::Ones()) {  // one is what files say that know nothing
            nominal.pixel_mm = *info.pixel_spacing_mm;
            known.pixel_scale_source = PixelScaleSource::header;
            known.warnings.push_back(fmt::format(
                "The image states pixels of {:.4g} x {:.4g} mm without saying where; they are taken as the detector's.",
                nominal.pixel_mm.x(), nominal.pixel_mm.y()));
        }
    }
    if (!options.map.empty()) known.map_file = options.map;
    if (!known.map_file.empty()) {
        if (options.pixel_mm) {
            return invalidOption("--pixel-mm", "a distortion map beside it",
                                 "one of the two: the map has its own pixel");
        }
        if (options.aspect) {
            return invalidOption("--aspect", "a distortion map beside it",
                                 "one of the two: the map's pixels are square");
        }
        Result<DistortionMap> map = readDistortionMap(known.map_file);
        if (!map) return map.error();
        if (map->columns() != info.width || map->rows() != info.height) {
            return invalidInput(known.map_file.string(), fmt::format("{} x {} pixels", map->columns(), map->rows()),
                                fmt::format("the images' {} x {}", info.width, info.height));
        }
        nominal.pixel_mm = Vector2::Constant(map->pixelMm());
        known.pixel_scale_source = PixelScaleSource::distortionMap;
        known.map = std::move(*map);
    } else if (options.pixel_mm) {
        nominal.pixel_mm = Vector2::Constant(*options.pixel_mm);
        known.pixel_scale_source = PixelScaleSource::stated;
    }
    if (!focal_known && info.source_detector_mm && *info.source_detector_mm >= 100) {
        nominal.focal_length_mm = *info.source_detector_mm;
        focal_known = known.pixel_scale_source != PixelScaleSource::assumed;
    }
    if (!focal_known) nominal.focal_length_mm = kFocalLengthInWidths * info.width * nominal.pixel_mm.x();
    nominal.distortion = nullptr;
    if (const Result<void> valid = nominal.validate(); !valid) return valid.error();
    return known;
}

// Shadows may be anything from the smallest bead at the detector to the largest near the source.
BeadDetectionOptions detectionOptions(const Options& options, const BeadLayout& layout, const Known& known) {
    BeadDetectionOptions detection;
    detection.bright = options.bright;
    if (known.pixel_scale_source == PixelScaleSource::assumed) {
        detection.most_diameter_px = 60;
        return detection;
    }
    double least = layout.beads.front().diameter_mm, most = least;
    for (const Bead& bead : layout.beads) {
        least = std::min(least, bead.diameter_mm);
        most = std::max(most, bead.diameter_mm);
    }
    const double pixel_mm = known.nominal.pixel_mm.mean();
    detection.least_diameter_px = std::clamp(0.6 * least / pixel_mm, 2.0, 100.0);
    detection.most_diameter_px = std::clamp(2.5 * most / pixel_mm, 2 * detection.least_diameter_px, 300.0);
    return detection;
}

nlohmann::ordered_json jsonOf(const CalibratedView& view, const BeadLayout& layout) {
    nlohmann::ordered_json json = {
        {"image", view.name},
        {"imager_from_" + std::string(name(layout.frame)), rowsOf(view.imager_from_phantom.matrix())},
        {"covariance", rowsOf(view.covariance)},
        {"rms_px", view.rms_px},
        {"beads_used", view.matches.size()},
        {"beads_expected", view.expected},
        {"false_shadows", view.unexplained},
        {"correlation",
         {{"focal_length_depth", view.focal_depth_correlation},
          {"center_tilt", arrayOf(view.center_tilt_correlation)}}}};
    json["beads"] = nlohmann::ordered_json::array();
    for (const BeadMatch& match : view.matches) {
        json["beads"].push_back({{"name", layout.beads[match.bead].name},
                                 {"ideal_px", arrayOf(match.ideal_px)},
                                 {"residual_px", arrayOf(match.residual_px)}});
    }
    return json;
}

Report reportOf(const ImagerCalibration& result, const BeadLayout& layout, const Options& options) {
    const CArm& carm = result.carm;
    const Vector2 center_sd_mm = result.center_sigma_px.cwiseProduct(carm.pixel_mm);
    Report report;
    nlohmann::ordered_json views = nlohmann::ordered_json::array();
    for (const CalibratedView& view : result.views)
        views.push_back(jsonOf(view, layout));
    report.json = {{"file", options.output},
                   {"columns", carm.columns},
                   {"rows", carm.rows},
                   {"focal_length_mm", carm.focal_length_mm},
                   {"focal_length_sd_mm", result.focal_sigma_mm},
                   {"principal_point_px", arrayOf(carm.principal_point_px)},
                   {"principal_point_sd_px", arrayOf(result.center_sigma_px)},
                   {"principal_point_sd_mm", arrayOf(center_sd_mm)},
                   {"pixel_mm", arrayOf(carm.pixel_mm)},
                   {"pixel_mm_source", name(result.pixel_scale_source)},
                   {"aspect", result.aspect},
                   {"aspect_sd", result.aspect_sigma},
                   {"covariance",
                    {{"of", {"focal_length_mm", "principal_point_px[0]", "principal_point_px[1]", "1/aspect"}},
                     {"matrix", rowsOf(result.covariance)}}},
                   {"rms_px", result.rms_px},
                   {"unexplained_px", result.unexplained_px},
                   {"views", views},
                   {"weak_directions", result.weak_directions},
                   {"warnings", result.warnings},
                   {"elapsed_ms", result.elapsed_ms}};
    report.line("C-arm", options.output);
    report.line("focal length", fmt::format("{:.2f} +- {:.2f} mm", carm.focal_length_mm, result.focal_sigma_mm));
    report.line("image centre",
                fmt::format("{:.2f}, {:.2f} +- {:.2f}, {:.2f} px", carm.principal_point_px.x(),
                            carm.principal_point_px.y(), result.center_sigma_px.x(), result.center_sigma_px.y()));
    report.line("pixel", fmt::format("{:.5f} x {:.5f} mm ({})", carm.pixel_mm.x(), carm.pixel_mm.y(),
                                     name(result.pixel_scale_source)));
    for (const CalibratedView& view : result.views) {
        report.line("view", fmt::format("{}: {} of {} beads, {:.3f} px", view.name, view.matches.size(), view.expected,
                                        view.rms_px));
    }
    report.line("residual", fmt::format("{:.3f} px", result.rms_px));
    for (const std::string& one : result.weak_directions)
        report.line("weak", one);
    for (const std::string& one : result.warnings)
        report.line("warning", one);
    report.judge(result.acceptance);
    return report;
}

Result<Report> run(const Options& options, Progress& progress) {
    const Result<fs::path> phantom_file = findResource("phantoms", options.phantom);
    if (!phantom_file) return phantom_file.error();
    std::vector<fs::path> inputs(options.images.begin(), options.images.end());
    inputs.push_back(*phantom_file);
    for (const std::string& file : {options.map, options.carm})
        if (!file.empty()) inputs.emplace_back(file);
    if (const Result<void> good = checkOutput(options.output, inputs, {".json"}); !good) return good.error();
    const Result<BeadLayout> layout = readBeadLayout(*phantom_file);
    if (!layout) return layout.error();

    std::vector<PhantomView> views;
    std::optional<Known> known;
    std::string first_size;
    for (std::size_t i = 0; i < options.images.size(); ++i) {
        const std::string& path = options.images[i];
        Result<ImageFile> file = readImage(path, {.frame = options.frame});
        if (!file) return file.error();
        const std::string size = fmt::format("{} x {}", file->info.width, file->info.height);
        if (!known) {
            Result<Known> gathered = gather(options, file->info);
            if (!gathered) return gathered.error();
            known = std::move(*gathered);
            first_size = size;
        }
        if (size != first_size) {
            return invalidInput(path, size + " pixels", "the size of " + options.images[0] + ", " + first_size,
                                "calibrate with pictures of one imager in one mode");
        }
        const double part = 0.5 / static_cast<double>(options.images.size());
        SubProgress detecting(progress, part * static_cast<double>(i), part * static_cast<double>(i + 1));
        Result<BeadDetections> beads = detectBeads(file->image, detectionOptions(options, *layout, *known), detecting);
        if (!beads) {
            Error error = beads.error();
            error.where = path + ", " + error.where;
            return error;
        }
        views.push_back({path, {}});
        for (const BeadDetection& bead : beads->beads) {
            // Where the map has no say there is no millimetre.
            if (!known->map || known->map->covers(bead.center_px, bead.radius_px))
                views.back().detections.push_back(bead);
        }
    }

    ImagerCalibrationOptions calibration;
    calibration.nominal = known->nominal;
    calibration.pixel_scale_source = known->pixel_scale_source;
    calibration.estimate_aspect = options.aspect;
    calibration.limits = options.limits;
    calibration.limits.most_focal_sigma = options.most_focal_percent / 100;
    if (known->map) {
        const DistortionMap& map = *known->map;
        calibration.distortion = [&map](const CArm& carm) { return distortionOf(map, carm); };
    }
    SubProgress solving(progress, 0.5, 1);
    Result<ImagerCalibration> result = calibrateImager(views, *layout, calibration, solving);
    if (!result) return result.error();
    result->warnings.insert(result->warnings.begin(), known->warnings.begin(), known->warnings.end());
    if (progress.isCancelled()) return cancelled("calibrate imager");
    if (const Result<void> written =
            writeCArm(options.output, result->carm, known->map ? fs::absolute(known->map_file) : fs::path());
        !written) {
        return written.error();
    }
    return reportOf(*result, *layout, options);
}

Command declareImager(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("imager", "Focal length, image centre and pixel of an imager");
    app->add_option("--image", options->images, "Picture of the phantom; again for each further view")
        ->required()
        ->allow_extra_args(false);
    app->add_option("--phantom", options->phantom, "Its beads: fluorocut/beads/1, or a built-in phantom's name")
        ->capture_default_str();
    app->add_option("-o,--out", options->output, "C-arm, fluorocut/carm/1: .json")->required();
    app->add_option("--map", options->map, "Distortion map of these pictures; has the pixel's size from the plate");
    app->add_option("--pixel-mm", options->pixel_mm,
                    "Size of a pixel at the detector. Default: the map's, the C-arm's, the image header's, else 0.32")
        ->check(between(0.001, 100));
    app->add_option("--carm", options->carm, "Nominal C-arm: where the search starts, and the pixel's size");
    app->add_option("--frame", options->frame, "Of files with several, counted from 1")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    app->add_flag("--aspect", options->aspect, "Estimate the pixel's height over its width as well");
    app->add_flag("--bright", options->bright, "The beads are brighter than what lies around them");
    app->add_option("--max-focal-percent", options->most_focal_percent,
                    "Acceptance limit: standard deviation of the focal length")
        ->check(between(0, 100))
        ->capture_default_str();
    app->add_option("--max-centre-mm", options->limits.most_center_sigma_mm,
                    "Acceptance limit: standard deviation of the image centre")
        ->check(between(0, 1000))
        ->capture_default_str();
    app->add_option("--max-rms-px", options->limits.most_rms_px, "Acceptance limit: residual")
        ->check(between(0, 1000))
        ->capture_default_str();
    app->footer(
        "Three views, the phantom tilted by 20 degrees to different sides, tell focal length and centre.\n"
        "Examples:\n"
        "  fluorocut-cli calibrate imager --image a.png --image b.png --image c.png --map map.json -o carm.json\n"
        "  fluorocut-cli calibrate imager --image a.dcm --phantom beads.json -o carm.json");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace

Command declareCalibrate(CLI::App& parent) {
    CLI::App* app = parent.add_subcommand("calibrate", "Measure the geometry of a device");
    app->fallthrough();
    const std::vector<Command> kinds{declareImager(*app), declareCalibrateRobot(*app)};
    app->footer("`fluorocut-cli calibrate imager --help` and `calibrate robot --help` tell their options.");
    return {app, [kinds](Progress& progress) -> Result<Report> {
                for (const Command& kind : kinds) {
                    if (kind.app->parsed()) return kind.run(progress);
                }
                return invalidOption("calibrate", "nothing to calibrate", "imager or robot", "see --help");
            }};
}

}  // namespace fluorocut::cli
