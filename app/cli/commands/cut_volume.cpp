// cut-volume: what a cavity leaves of a CT.
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/list.h"
#include "app/cli/files.h"
#include "app/cli/patient.h"
#include "core/io/mesh_file.h"
#include "core/io/pose_file.h"
#include "core/io/volume_file.h"
#include "core/simulation/cutting.h"

namespace fluorocut::cli {
namespace {

struct Options {
    std::string ct;
    std::string mesh;
    std::string mesh_unit = "mm";
    std::string pose;
    std::string output;
    double fill_hu = CutOptions{}.fill_hu;
    double sweep_mm = CutOptions{}.sweep_mm;
};

Result<Report> run(const Options& options, Progress& progress) {
    if (const Result<void> good =
            checkOutput(options.output, {options.ct, options.mesh, options.pose}, {".mha", ".nrrd", ".nii", ".nii.gz"});
        !good) {
        return good.error();
    }
    const Result<MeshFile> mesh =
        readMesh(options.mesh, {.unit = options.mesh_unit == "m" ? LengthUnit::m : LengthUnit::mm});
    if (!mesh) return mesh.error();
    const Result<Pose> femur_from_cavity = readPose(options.pose, Frame::femur, Frame::cavity);
    if (!femur_from_cavity) return femur_from_cavity.error();
    SubProgress reading(progress, 0, 0.4);
    const Result<std::shared_ptr<const Volume>> ct = loadCt(options.ct, reading);
    if (!ct) return ct.error();

    SubProgress cutting(progress, 0.4, 0.9);
    CutOptions cut_options;
    cut_options.fill_hu = options.fill_hu;
    cut_options.sweep_mm = options.sweep_mm;
    const Result<CutResult> cut =
        cutMesh(**ct, mesh->mesh, femur_from_cavity->target_from_source, cut_options, nullptr, cutting);
    if (!cut) return cut.error();
    if (progress.isCancelled()) return cancelled("cut-volume");
    progress.report(0.9, "writing");
    if (const Result<void> written = writeVolume(options.output, cut->volume); !written) return written.error();

    Report report;
    report.json = {
        {"file", options.output},    {"size", cut->volume.grid().size},       {"removed_mm3", cut->removed_mm3},
        {"mesh_mm3", cut->mesh_mm3}, {"voxels_touched", cut->voxels_touched}, {"warnings", cut->warnings}};
    report.line("volume", options.output);
    report.line("removed", fmt::format("{:.1f} mm3", cut->removed_mm3));
    report.line("mesh", fmt::format("{:.1f} mm3", cut->mesh_mm3));
    for (const std::string& warning : cut->warnings)
        report.line("warning", warning);
    return report;
}

}  // namespace

Command declareCutVolume(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("cut-volume", "Remove a mesh from a CT, partial volumes kept");
    app->add_option("--ct", options->ct, "CT: file, DICOM folder, or a built-in patient: femur, acrylic")->required();
    app->add_option("--mesh", options->mesh, "Closed mesh of the cavity: STL, OBJ, PLY")->required();
    app->add_option("--mesh-unit", options->mesh_unit, "Unit of the mesh")
        ->check(CLI::IsMember({"mm", "m"}))
        ->capture_default_str();
    app->add_option("--femur-from-cavity", options->pose, "Pose femur from cavity, fluorocut/pose/1")->required();
    app->add_option("-o,--out", options->output, "CT after the cut: .mha .nrrd .nii .nii.gz")->required();
    app->add_option("--fill-hu", options->fill_hu, "What fills the cavity, HU")->capture_default_str();
    app->add_option("--sweep-mm", options->sweep_mm, "Also remove the way in: this far along the cavity's z axis")
        ->capture_default_str();
    app->footer(
        "Example: fluorocut-cli cut-volume --ct pelvis.nii.gz --mesh stem.stl --femur-from-cavity stem.json -o "
        "cut.mha");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace fluorocut::cli
