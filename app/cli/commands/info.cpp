// info FILE: what a file holds, as it was read.
#include <filesystem>
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/info_json.h"
#include "app/cli/commands/list.h"
#include "app/cli/files.h"
#include "app/cli/numbers.h"
#include "core/io/file_format.h"
#include "core/io/image_file.h"
#include "core/io/mesh_file.h"
#include "core/io/volume_file.h"

namespace fluorocut::cli {
namespace {

struct Options {
    std::string file;
    int frame = 1;
    std::string mesh_unit = "mm";
};

std::string depthText(int bits, bool is_signed, bool is_float) {
    return fmt::format("{} bits, {}", bits, is_float ? "real numbers" : is_signed ? "signed" : "unsigned");
}

// A field that only some files have: left out where it is absent.
void addText(Report& report, const char* key, const char* label, const std::string& text) {
    if (text.empty()) return;
    report.json[key] = text;
    report.line(label, text);
}

void addNumber(Report& report, const char* key, const char* label, const std::optional<double>& value,
               const char* unit) {
    if (!value) return;
    report.json[key] = *value;
    report.line(label, fmt::format("{:.5g} {}", *value, unit));
}

void addNotes(Report& report, const std::vector<std::string>& notes) {
    report.json["notes"] = notes;
    for (const std::string& note : notes)
        report.line("note", note);
}

void addIdentity(Report& report, bool has_identifying_fields) {
    report.json["has_identifying_fields"] = has_identifying_fields;
    if (has_identifying_fields) report.line("identity", "fields that identify a person are present (not shown)");
}

// What DICOM says of the device, in images and in volumes.
template <class Info>
void addDevice(Report& report, const Info& info) {
    addText(report, "modality", "modality", info.modality);
    addText(report, "manufacturer", "manufacturer", info.manufacturer);
    addText(report, "transfer_syntax", "transfer syntax", info.transfer_syntax);
}

Report reportOf(const ImageInfo& info) {
    Report report;
    report.json = {{"kind", "image"},
                   {"format", info.format},
                   {"size", {info.width, info.height}},
                   {"frames", info.frames},
                   {"frame", info.frame},
                   {"bits", info.bits},
                   {"is_signed", info.is_signed},
                   {"is_float", info.is_float},
                   {"least", info.least},
                   {"most", info.most},
                   {"spacing_plane", name(info.spacing_plane)},
                   {"intensity", name(info.intensity)}};
    report.line("image", info.format);
    report.line("size", fmt::format("{} x {} px", info.width, info.height));
    if (info.frames > 1) report.line("frames", fmt::format("{}, number {} was read", info.frames, info.frame));
    report.line("pixels", depthText(info.bits, info.is_signed, info.is_float));
    report.line("values", fmt::format("{:.5g} to {:.5g}, bright means more photons", info.least, info.most));
    if (info.pixel_spacing_mm) {
        report.json["pixel_spacing_mm"] = arrayOf(*info.pixel_spacing_mm);
        report.line("spacing", fmt::format("{} mm (plane: {})", listText(*info.pixel_spacing_mm, "{:.5g}", " x "),
                                           name(info.spacing_plane)));
    }
    if (info.imager_pixel_spacing_mm) {
        report.json["imager_pixel_spacing_mm"] = arrayOf(*info.imager_pixel_spacing_mm);
        report.line("at detector", listText(*info.imager_pixel_spacing_mm, "{:.5g}", " x ") + " mm");
    }
    if (info.intensity != IntensityScale::unstated) report.line("intensity", std::string(name(info.intensity)));
    addDevice(report, info);
    addText(report, "photometric", "photometric", info.photometric);
    addNumber(report, "source_detector_mm", "source-detector", info.source_detector_mm, "mm");
    addNumber(report, "source_patient_mm", "source-patient", info.source_patient_mm, "mm");
    addNumber(report, "primary_angle_deg", "primary angle", info.primary_angle_deg, "degrees");
    addNumber(report, "secondary_angle_deg", "secondary angle", info.secondary_angle_deg, "degrees");
    addIdentity(report, info.has_identifying_fields);
    addNotes(report, info.notes);
    return report;
}

Report reportOf(const VolumeInfo& info) {
    const VolumeGrid& grid = info.grid;
    const Vector3 extent = grid.spacing_mm.cwiseProduct(Vector3(grid.size[0], grid.size[1], grid.size[2]));
    Report report;
    report.json = {{"kind", "volume"},
                   {"format", info.format},
                   {"size", grid.size},
                   {"spacing_mm", arrayOf(grid.spacing_mm)},
                   {"origin_mm", arrayOf(grid.origin_mm)},
                   {"direction", rowsOf(grid.direction)},
                   {"bits", info.bits},
                   {"is_signed", info.is_signed},
                   {"is_float", info.is_float},
                   {"least", info.least},
                   {"most", info.most},
                   {"files", info.files}};
    report.line("volume", info.files > 1 ? fmt::format("{}, {} files", info.format, info.files) : info.format);
    report.line("size", timesText(grid.size) + " voxels");
    report.line("spacing", listText(grid.spacing_mm, "{:.5g}", " x ") + " mm");
    report.line("extent", listText(extent, "{:.4g}", " x ") + " mm");
    report.line("origin", listText(grid.origin_mm, "{:.6g}") + " mm (DICOM LPS)");
    for (int axis = 0; axis < 3; ++axis) {
        report.line(fmt::format("axis {}", "ijk"[axis]), listText(Vector3(grid.direction.col(axis)), "{:.4f}"));
    }
    report.line("voxels", depthText(info.bits, info.is_signed, info.is_float));
    report.line("values", fmt::format("{:.5g} to {:.5g}", info.least, info.most));
    addDevice(report, info);
    addText(report, "series_uid", "series", info.series_uid);
    addNumber(report, "slice_thickness_mm", "slice thickness", info.slice_thickness_mm, "mm");
    addIdentity(report, info.has_identifying_fields);
    addNotes(report, info.notes);
    return report;
}

Report reportOf(const MeshInfo& info) {
    const MeshProperties& mesh = info.properties;
    const Vector3 extent = mesh.max_corner - mesh.min_corner;
    Report report;
    report.json = {{"kind", "mesh"},
                   {"format", info.format},
                   {"vertices", mesh.vertices},
                   {"triangles", mesh.triangles},
                   {"parts", mesh.components},
                   {"watertight", mesh.watertight()},
                   {"open_edges", mesh.open_edges},
                   {"area_mm2", mesh.area_mm2},
                   {"volume_mm3", mesh.volume_mm3},
                   {"min_corner_mm", arrayOf(mesh.min_corner)},
                   {"max_corner_mm", arrayOf(mesh.max_corner)},
                   {"was_inside_out", info.was_inside_out}};
    report.line("mesh", info.format);
    report.line("size", fmt::format("{} vertices, {} triangles, {} part{}", mesh.vertices, mesh.triangles,
                                    mesh.components, mesh.components == 1 ? "" : "s"));
    report.line("surface", mesh.watertight() ? "watertight" : fmt::format("open: {} edges", mesh.open_edges));
    report.line("extent", listText(extent, "{:.5g}", " x ") + " mm");
    report.line("area", fmt::format("{:.1f} mm2", mesh.area_mm2));
    report.line("volume", fmt::format("{:.1f} mm3", mesh.volume_mm3));
    addNotes(report, info.notes);
    return report;
}

Result<Report> infoOfVolume(const Options& options, Progress& progress) {
    const Result<VolumeFile> file = readVolume(options.file, {}, progress);
    if (!file) return file.error();
    return reportOf(file->info);
}

// MetaImage and NRRD hold pictures and volumes alike.
Result<Report> infoOfRaster(const Options& options, Progress& progress) {
    const Result<ImageFile> file = readImage(options.file, {.frame = options.frame});
    if (file && file->info.frames == 1) return reportOf(file->info);
    return infoOfVolume(options, progress);
}

Result<Report> infoOfImage(const Options& options) {
    const Result<ImageFile> file = readImage(options.file, {.frame = options.frame});
    if (!file) return file.error();
    return reportOf(file->info);
}

Result<Report> infoOfMesh(const Options& options) {
    const LengthUnit unit = options.mesh_unit == "m" ? LengthUnit::m : LengthUnit::mm;
    const Result<MeshFile> file = readMesh(options.file, {.unit = unit, .require_solid = false});
    if (!file) return file.error();
    return reportOf(file->info);
}

Result<Report> run(const Options& options, Progress& progress) {
    const Result<FileFormat> format = detectFormat(options.file);
    if (!format) return format.error();
    Result<Report> report = [&]() -> Result<Report> {
        switch (*format) {
            case FileFormat::png:
            case FileFormat::tiff:
            case FileFormat::dicom:
                return infoOfImage(options);
            case FileFormat::metaImage:
            case FileFormat::nrrd:
                return infoOfRaster(options, progress);
            case FileFormat::nifti:
            case FileFormat::dicomFolder:
                return infoOfVolume(options, progress);
            case FileFormat::stl:
            case FileFormat::obj:
            case FileFormat::ply:
                return infoOfMesh(options);
            case FileFormat::json:
                return infoOfJson(options.file);
            case FileFormat::unknown:
                break;
        }
        return invalidInput(options.file, "content of no known format",
                            "PNG, TIFF, MHA, NRRD, DICOM, NIfTI, STL, OBJ, PLY or a JSON file of FluoroCut");
    }();
    if (report) report->json["file"] = options.file;
    return report;
}

}  // namespace

Command declareInfo(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app = parent.add_subcommand("info", "What a file holds, as it was read");
    app->add_option("FILE", options->file, "Image, volume, DICOM folder, mesh, or JSON file")->required();
    app->add_option("--frame", options->frame, "Of a multi-frame image, counted from 1")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    app->add_option("--mesh-unit", options->mesh_unit, "Unit of a mesh")
        ->check(CLI::IsMember({"mm", "m"}))
        ->capture_default_str();
    app->footer("Examples:\n  fluorocut-cli info pelvis.nii.gz\n  fluorocut-cli info --json pose.json");
    return {app, [options](Progress& progress) { return run(*options, progress); }};
}

}  // namespace fluorocut::cli
