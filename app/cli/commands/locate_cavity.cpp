// locate-cavity: where the cavity that was cut really is, from images before and after the cut and, if there is one,
// the CT.
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/list.h"
#include "app/cli/commands/register.h"
#include "app/cli/files.h"
#include "app/cli/numbers.h"
#include "app/cli/patient.h"
#include "core/base/units.h"
#include "core/cavity/cavity_location.h"
#include "core/io/image_file.h"
#include "core/io/mesh_file.h"
#include "core/io/pose_file.h"

namespace fluorocut::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct Options {
    std::vector<std::string> views;
    std::string cavity, femur_from_cavity, ct, method = "full", mesh_unit = "mm", output;
    double in_plane_mm = ViewPoseUncertainty{}.in_plane_mm, depth_mm = ViewPoseUncertainty{}.depth_mm;
    double rotation_deg = degreesFromRadians(ViewPoseUncertainty{}.rotation_rad);
    double offset_level = 0;
    CavityLocationOptions location;
};

constexpr const char* kForm = "BEFORE,AFTER,CARM,POSE_BEFORE,POSE_AFTER";

Result<CavityView> readView(const std::string& text, double offset_level) {
    const Result<std::vector<std::string>> parts = partsOf("--view", text, 5, kForm);
    if (!parts) return parts.error();
    Result<ImageFile> before = readImage((*parts)[0]);
    if (!before) return before.error();
    Result<ImageFile> after = readImage((*parts)[1]);
    if (!after) return after.error();
    const Result<CArm> carm = readImager((*parts)[2]);
    if (!carm) return carm.error();
    const Result<Pose> pose_before = readPose((*parts)[3], Frame::imager, Frame::femur);
    if (!pose_before) return pose_before.error();
    const Result<Pose> pose = readPose((*parts)[4], Frame::imager, Frame::femur);
    if (!pose) return pose.error();
    for (Image* image : {&before->image, &after->image})
        for (float& pixel : image->pixels())
            pixel -= static_cast<float>(offset_level);
    return CavityView{fs::path((*parts)[1]).filename().string(),
                      std::move(after->image),
                      *carm,
                      pose->target_from_source,
                      std::move(before->image),
                      pose_before->target_from_source};
}

Result<Report> run(Options options, Progress& progress) {
    options.location.method = options.method == "paper" ? CavityMethod::paper : CavityMethod::full;
    options.location.view_pose = {options.in_plane_mm, options.depth_mm, radiansFromDegrees(options.rotation_deg)};
    if (auto good = options.location.validate(); !good) return good.error();
    std::vector<fs::path> inputs{options.cavity, options.femur_from_cavity};
    for (const std::string& view : options.views) {
        const Result<std::vector<std::string>> parts = partsOf("--view", view, 5, kForm);
        if (!parts) return parts.error();
        inputs.insert(inputs.end(), parts->begin(), parts->end());
    }
    if (!options.output.empty()) {
        if (auto good = checkOutput(options.output, inputs, {".json"}); !good) return good.error();
    }
    std::vector<CavityView> views;
    for (const std::string& text : options.views) {
        Result<CavityView> view = readView(text, options.offset_level);
        if (!view) return view.error();
        views.push_back(std::move(*view));
    }
    MeshReadOptions mesh_options;
    mesh_options.unit = options.mesh_unit == "m" ? LengthUnit::m : LengthUnit::mm;
    const Result<MeshFile> mesh = readMesh(options.cavity, mesh_options);
    if (!mesh) return mesh.error();
    const Result<Pose> planned = readPose(options.femur_from_cavity, Frame::femur, Frame::cavity);
    if (!planned) return planned.error();
    SubProgress reading(progress, 0, 0.3), locating(progress, 0.3, 1);
    std::shared_ptr<const Volume> ct;
    if (!options.ct.empty()) {
        Result<std::shared_ptr<const Volume>> loaded = loadCt(options.ct, reading);
        if (!loaded) return loaded.error();
        ct = std::move(*loaded);
    }
    const Result<CavityLocation> found =
        locateCavity(views, mesh->mesh, planned->target_from_source, ct, options.location, locating);
    if (!found) return found.error();

    Report report;
    const Pose& pose = found->femur_from_cavity;
    const Rigid3 off = planned->target_from_source.inverse() * pose.target_from_source;
    const Matrix6& covariance = *pose.covariance;
    const auto degrees = [&](int i) { return degreesFromRadians(std::sqrt(covariance(i, i))); };
    report.json["femur_from_cut_cavity"] = rowsOf(pose.target_from_source.matrix());
    report.json["covariance"] = rowsOf(covariance);
    report.json["planned_from_cut_cavity"] = rowsOf(off.matrix());
    report.json["offset_mm"] = off.translation().norm();
    report.json["rotation_deg"] = degreesFromRadians(off.rotationAngle());
    report.json["method"] = options.method;
    report.json["rank"] = found->rank;
    report.json["unobservable"] = found->weak_directions;
    report.json["views"] = Json::array();
    for (const ViewResidual& view : found->views) {
        report.json["views"].push_back({{"name", view.name},
                                        {"rms_log", view.rms_log},
                                        {"evidence", view.evidence},
                                        {"contour_residual_px", view.contour_px},
                                        {"pose_correction", arrayOf(view.pose_correction)},
                                        {"pose_correction_sigmas", view.pose_sigmas}});
    }
    report.json["iterations"] = found->iterations;
    report.json["elapsed_ms"] = found->elapsed_ms;
    report.json["warnings"] = found->warnings;
    report.line("cut, off the plan", fmt::format("{:.3f} mm, {:.3f} degrees", off.translation().norm(),
                                                 degreesFromRadians(off.rotationAngle())));
    report.line("along x, y, z of it", fmt::format("{} mm", listText(off.translation(), "{:.3f}")));
    report.line("standard deviations",
                fmt::format("{:.3f}, {:.3f}, {:.3f} mm; {:.3f}, {:.3f}, {:.3f} degrees (axes of the femur)",
                            std::sqrt(covariance(0, 0)), std::sqrt(covariance(1, 1)), std::sqrt(covariance(2, 2)),
                            degrees(3), degrees(4), degrees(5)));
    for (const std::string& weak : found->weak_directions)
        report.line("weak", weak);
    for (const ViewResidual& view : found->views) {
        std::string words = std::isnan(view.contour_px) ? std::string("no outline of the cavity found by itself")
                                                        : fmt::format("contour residual {:.2f} px", view.contour_px);
        if (options.location.method == CavityMethod::full)
            words += fmt::format(", {:.1f} % of the levels, pose corrected by {:.1f} of its deviations",
                                 100 * view.rms_log, view.pose_sigmas);
        report.line(view.name, words);
    }
    report.line("found in", fmt::format("{:.0f} ms", found->elapsed_ms));
    report.judge(found->acceptance);
    if (!options.output.empty()) {
        if (auto written = writePose(options.output, pose); !written) return written.error();
        report.json["file"] = options.output;
        report.line("pose", options.output);
    }
    return report;
}

}  // namespace

Command declareLocateCavity(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("locate-cavity", "Where the cavity that was cut really is");
    app->add_option("--view", options->views,
                    std::string(kForm) +
                        ": images before and after the cut, fluorocut/carm/1, poses imager from "
                        "femur; again for each view")
        ->required();
    app->add_option("--cavity", options->cavity, "Mesh of the cavity that was to be cut")->required();
    app->add_option("--femur-from-cavity", options->femur_from_cavity, "Where it was planned, fluorocut/pose/1")
        ->required();
    app->add_option("--ct", options->ct,
                    "CT before the cut: file, DICOM folder, or a built-in patient; without it the "
                    "images before the cut stand in its place");
    app->add_option("--method", options->method, "full: the best; paper: Yao, Taylor et al. (2000), to compare with")
        ->check(CLI::IsMember({"full", "paper"}))
        ->capture_default_str();
    app->add_option("--mesh-unit", options->mesh_unit, "Unit of the mesh")
        ->check(CLI::IsMember({"mm", "m"}))
        ->capture_default_str();
    app->add_option("--mu-water", options->location.mu_water_per_mm, "Attenuation of water, 1/mm")
        ->capture_default_str();
    app->add_option("--blur-px", options->location.blur_px, "The images' blur, to start with")->capture_default_str();
    app->add_option("--offset-level", options->offset_level, "Level of no photons")->capture_default_str();
    app->add_option("--view-in-plane-mm", options->in_plane_mm, "Standard deviation of a view's pose")
        ->capture_default_str();
    app->add_option("--view-depth-mm", options->depth_mm, "and of its depth")->capture_default_str();
    app->add_option("--view-rotation-deg", options->rotation_deg, "and of its rotation")->capture_default_str();
    app->add_option("-o,--out", options->output, "femur_from_cut_cavity with its covariance, fluorocut/pose/1: .json");
    app->footer(
        "All views are solved at once, each with its own small pose error; with a CT the images after the cut do the "
        "work.\nExample: fluorocut-cli locate-cavity --view b1.png,a1.png,carm.json,b1.json,a1.json --view "
        "b2.png,a2.png,carm.json,b2.json,a2.json --cavity stage_1.stl --femur-from-cavity plan.json --ct femur.nrrd");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace fluorocut::cli
