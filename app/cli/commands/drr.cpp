// drr: a simulated fluoroscopic image of a CT.
#include <algorithm>
#include <memory>
#include <optional>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/list.h"
#include "app/cli/files.h"
#include "app/cli/options.h"
#include "app/cli/patient.h"
#include "core/base/median.h"
#include "core/base/stopwatch.h"
#include "core/imaging/display_picture.h"
#include "core/imaging/standard_views.h"
#include "core/imaging/volume_projector.h"
#include "core/imaging/xray_physics.h"
#include "core/io/image_file.h"
#include "core/io/pose_file.h"

namespace fluorocut::cli {
namespace {

struct Options {
    std::string ct;
    std::string carm;
    std::string pose;
    std::string view;
    std::vector<double> aim_mm;  // empty: chosen by aimOf
    std::string output;
    std::string kind;  // empty: chosen by chooseKind
    double photons = 0;
    double blur_px = 0;
    std::uint64_t seed = 1;
    double mu_water_per_mm = AttenuationOptions{}.mu_water_per_mm;
    int repeat = 1;
    std::string method = "fast";
    int binning = 1;
};

enum class Kind { lineIntegral, intensity, fluoroscopy };

struct Geometry {
    CArm carm;
    Rigid3 imager_from_femur;
};

// What hands the best picture to whoever says no more than a file's name.
Result<Kind> chooseKind(const Options& options) {
    const bool physics = options.photons > 0 || options.blur_px > 0;
    const bool floats = extensionOf(options.output) != ".png" && extensionOf(options.output) != ".dcm";
    if (options.kind == "intensity" || (options.kind.empty() && physics)) return Kind::intensity;
    if (options.kind == "fluoroscopy" || (options.kind.empty() && !floats)) return Kind::fluoroscopy;
    if (!floats) {
        return invalidOption("--output line-integral", "an output in whole numbers, " + options.output,
                             "a file that holds real numbers", "name it .mha, .nrrd or .tiff");
    }
    if (physics) {
        return invalidOption("--photons, --blur-px", "line integrals, which have neither photons nor blur",
                             "--output intensity");
    }
    return Kind::lineIntegral;
}

// What a standard view looks at: the middle, except that of the built-in femur one wants to see the hip. Its frame's
// origin lies in the shaft at the lesser trochanter.
Vector3 aimOf(const Options& options, const VolumeGrid& grid) {
    if (!options.aim_mm.empty()) return {options.aim_mm[0], options.aim_mm[1], options.aim_mm[2]};
    return options.ct == kBuiltInFemur ? Vector3::Zero() : grid.center();
}

Result<Geometry> readGeometry(const Options& options, const VolumeGrid& grid) {
    Geometry geometry;
    if (options.carm.empty()) {
        geometry.carm = standardCArm();
    } else {
        Result<CArm> carm = readImager(options.carm);
        if (!carm) return carm.error();
        geometry.carm = *carm;
    }
    if (!options.view.empty()) {
        // At the same part of the way to the detector as in the standard C-arm.
        const double depth_mm = kStandardObjectDepthMm / standardCArm().focal_length_mm * geometry.carm.focal_length_mm;
        const StandardView view = options.view == "ap" ? StandardView::ap : StandardView::lateral;
        geometry.imager_from_femur = standardView(view, aimOf(options, grid), depth_mm);
        return geometry;
    }
    const Result<Pose> pose = readPose(options.pose, Frame::imager, Frame::femur);
    if (!pose) return pose.error();
    geometry.imager_from_femur = pose->target_from_source;
    return geometry;
}

XrayOptions xrayOptions(const Options& options, Kind kind, const Geometry& geometry, const VolumeGrid& grid) {
    if (kind == Kind::intensity) {
        XrayOptions xray = XrayOptions::ideal(options.photons > 0 ? options.photons : 1);
        xray.quantum_noise = options.photons > 0;
        xray.detector_blur_px = options.blur_px;
        xray.seed = options.seed;
        return xray;
    }
    XrayOptions xray;
    if (options.photons > 0) xray.photons_per_pixel = options.photons;
    if (options.blur_px > 0) xray.detector_blur_px = options.blur_px;
    xray.object_depth_mm = std::clamp((geometry.imager_from_femur * grid.center()).z(),
                                      0.1 * geometry.carm.focal_length_mm, 0.95 * geometry.carm.focal_length_mm);
    xray.bits = 16;
    xray.seed = options.seed;
    return xray;
}

Result<Image> pictureOf(const Image& line_integrals, const CArm& carm, const XrayOptions& xray) {
    Result<Exposure> exposure = expose(line_integrals, carm, xray);
    if (!exposure) return exposure.error();
    return std::move(exposure->image);
}

Result<Report> run(const Options& options, Progress& progress) {
    if (options.pose.empty() == options.view.empty()) {
        return invalidOption("command line",
                             options.pose.empty() ? "neither --pose nor --view" : "both --pose and --view",
                             "one of the two");
    }
    if (options.carm.empty() && !options.pose.empty()) {
        return invalidOption("command line", "--pose without --carm", "the C-arm that the pose belongs to");
    }
    if (const Result<void> good = checkOutput(options.output, {options.ct, options.carm, options.pose},
                                              {".mha", ".nrrd", ".tif", ".tiff", ".png", ".dcm"});
        !good) {
        return good.error();
    }
    const Result<Kind> kind = chooseKind(options);
    if (!kind) return kind.error();

    SubProgress reading(progress, 0, 0.7);
    const Result<std::shared_ptr<const Volume>> ct = loadCt(options.ct, reading);
    if (!ct) return ct.error();
    const VolumeGrid& grid = (*ct)->grid();
    const Result<Geometry> geometry = readGeometry(options, grid);
    if (!geometry) return geometry.error();

    progress.report(0.7, "preparing");
    const Stopwatch preparing;
    const Result<VolumeProjector> projector =
        VolumeProjector::prepare(*ct, {.mu_water_per_mm = options.mu_water_per_mm});
    if (!projector) return projector.error();
    const double prepare_ms = preparing.ms();

    ProjectionOptions projection;
    projection.method = options.method == "exact" ? ProjectionMethod::exact : ProjectionMethod::fast;
    projection.binning = options.binning;
    Image image;
    std::vector<double> times_ms;
    for (int i = 0; i < options.repeat; ++i) {
        progress.report(0.75 + 0.2 * i / options.repeat, "projecting");
        if (progress.isCancelled()) return cancelled("drr");
        const Stopwatch projecting;
        image = projector->project(geometry->carm, geometry->imager_from_femur, projection);
        times_ms.push_back(projecting.ms());
    }

    const CArm carm = geometry->carm.binned(options.binning);
    const bool empty = std::all_of(image.pixels().begin(), image.pixels().end(), [](float t) { return t == 0; });
    ImageWriteOptions writing;
    writing.pixel_spacing_mm = carm.pixel_mm;
    if (*kind != Kind::lineIntegral) {
        const XrayOptions xray = xrayOptions(options, *kind, *geometry, grid);
        Result<Image> picture = pictureOf(image, carm, xray);
        if (!picture) return picture.error();
        image = std::move(*picture);
        if (*kind == Kind::fluoroscopy) {
            Result<Image> shown = displayPicture(image);
            if (!shown) return shown.error();
            image = std::move(*shown);
            writing.window = {{0.0F, 1.0F}};
        }
        // Whole numbers: an open beam is the largest.
        if (*kind == Kind::intensity) writing.window = {{0.0F, static_cast<float>(xray.photons_per_pixel)}};
    }
    if (progress.isCancelled()) return cancelled("drr");
    if (const Result<void> written = writeImage(options.output, image, writing); !written) return written.error();

    static constexpr const char* kKindNames[] = {"line-integral", "intensity", "fluoroscopy"};
    const char* kind_name = kKindNames[static_cast<int>(*kind)];
    const auto [least, most] = std::minmax_element(image.pixels().begin(), image.pixels().end());
    Report report;
    report.json = {{"file", options.output},
                   {"output", kind_name},
                   {"size", {image.width(), image.height()}},
                   {"pixel_mm", {carm.pixel_mm.x(), carm.pixel_mm.y()}},
                   {"method", options.method},
                   {"prepare_ms", prepare_ms},
                   {"elapsed_ms", median(times_ms)},
                   {"repeat", options.repeat},
                   {"least", *least},
                   {"most", *most},
                   {"warnings", nlohmann::json::array()}};
    report.line("picture", options.output);
    report.line("size", fmt::format("{} x {} px of {:.3g} mm", image.width(), image.height(), carm.pixel_mm.x()));
    report.line("holds", fmt::format("{}, {:.4g} to {:.4g}", kind_name, *least, *most));
    report.line("prepared in", fmt::format("{:.1f} ms", prepare_ms));
    report.line("projected in", fmt::format("{:.2f} ms (median of {})", median(times_ms), options.repeat));
    if (empty) {
        report.json["warnings"].push_back("the CT lies nowhere in the picture");
        report.line("warning", "the CT lies nowhere in the picture; look at the pose");
    }
    return report;
}

}  // namespace

Command declareDrr(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("drr", "Simulated fluoroscopic image of a CT");
    app->add_option("--ct", options->ct, "CT: file, DICOM folder, or a built-in patient: femur, acrylic")->required();
    app->add_option("--carm", options->carm, "C-arm, fluorocut/carm/1 (default with --view: a 27 cm flat panel)");
    app->add_option("--pose", options->pose, "Pose imager from femur, fluorocut/pose/1");
    app->add_option("--view", options->view, "Instead of a pose: a standard view")
        ->check(CLI::IsMember({"ap", "lateral"}));
    app->add_option("--aim-mm", options->aim_mm, "What a standard view looks at: x y z in the CT's frame")->expected(3);
    app->add_option("-o,--out", options->output, "Picture: .mha .nrrd .tiff (real numbers) .png .dcm (16 bits)")
        ->required();
    app->add_option(
           "--output", options->kind,
           "line-integral: of mu, without unit; intensity: photons, N exp(-line integral);\n"
           "fluoroscopy: what the monitor of a C-arm shows, with noise, blur, scatter and brightness set for the eye.\n"
           "Default: fluoroscopy for .png and .dcm, intensity with --photons or --blur-px, else line-integral")
        ->check(CLI::IsMember({"line-integral", "intensity", "fluoroscopy"}));
    app->add_option("--photons", options->photons, "Photons per pixel in the open beam; gives Poisson noise")
        ->check(between(1e-3, 1e9));
    app->add_option("--blur-px", options->blur_px, "Standard deviation of the detector's blur, px")
        ->check(between(0, 100));
    app->add_option("--seed", options->seed, "Of the noise")->check(CLI::NonNegativeNumber)->capture_default_str();
    app->add_option("--mu-water", options->mu_water_per_mm, "Attenuation of water, 1/mm")->capture_default_str();
    app->add_option("--method", options->method, "fast: slice by slice; exact: ray by ray")
        ->check(CLI::IsMember({"fast", "exact"}))
        ->capture_default_str();
    app->add_option("--binning", options->binning, "Average this many detector pixels each way into one")
        ->check(CLI::IsMember({1, 2, 4, 8}))
        ->capture_default_str();
    app->add_option("--repeat", options->repeat, "Project this many times and tell the median time")
        ->check(CLI::Range(1, 1000000))
        ->capture_default_str();
    app->footer(
        "Examples:\n"
        "  fluorocut-cli drr --ct femur --view ap -o ap.png\n"
        "  fluorocut-cli drr --ct pelvis.nii.gz --carm carm.json --pose pose.json -o drr.mha\n"
        "  fluorocut-cli drr --ct femur --view lateral --output intensity --photons 2000 -o lateral.tiff");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace fluorocut::cli
