// phantom: the built-in patients, generated as CT volumes, and pictures of calibration objects (phantom_images.h).
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/list.h"
#include "app/cli/commands/phantom_images.h"
#include "app/cli/files.h"
#include "app/cli/numbers.h"
#include "core/base/units.h"
#include "core/io/volume_file.h"
#include "core/simulation/acrylic_phantom.h"
#include "core/simulation/femur_phantom.h"

namespace fluorocut::cli {
namespace {

const std::vector<std::string> kExtensions{".mha", ".nrrd", ".nii", ".nii.gz"};

Result<Report> save(const Volume& ct, const std::string& output, Progress& progress) {
    if (progress.isCancelled()) return cancelled("phantom");
    progress.report(0.9, "writing");
    // Hounsfield units are whole numbers in every scanner's files.
    if (const Result<void> written = writeVolume(output, ct, VoxelType::int16); !written) return written.error();
    const VolumeGrid& grid = ct.grid();
    Report report;
    report.json = {{"file", output},
                   {"size", grid.size},
                   {"spacing_mm", arrayOf(grid.spacing_mm)},
                   {"origin_mm", arrayOf(grid.origin_mm)}};
    report.line("volume", output);
    report.line("size", fmt::format("{} voxels of {:.3g} mm", timesText(grid.size), grid.spacing_mm.x()));
    return report;
}

// An option in degrees for a field in radians.
void addDegrees(CLI::App* app, const std::string& option, double& field_rad, const std::string& help) {
    app->add_option_function<double>(
           option, [&field_rad](const double& degrees) { field_rad = radiansFromDegrees(degrees); }, help)
        ->default_str(fmt::format("{:.4g}", degreesFromRadians(field_rad)));
}

struct FemurCommand {
    FemurOptions options;
    std::string side = "left";
    std::string dorr = "B";
    bool after_removal = false;
    bool dry = false;
    bool no_pelvis = false;
    std::string output;
};

Result<Report> runFemur(const FemurCommand& command, Progress& progress) {
    if (const Result<void> good = checkOutput(command.output, {}, kExtensions); !good) return good.error();
    FemurOptions options = command.options;
    options.side = command.side == "left" ? BodySide::left : BodySide::right;
    options.dorr = command.dorr == "A" ? DorrType::A : command.dorr == "B" ? DorrType::B : DorrType::C;
    options.soft_tissue = !command.dry;
    options.pelvis = !command.dry && !command.no_pelvis;
    if (command.after_removal) options.removed_implant = ImplantRemoval{};

    SubProgress generating(progress, 0, 0.9);
    const Result<FemurPhantom> femur = generateFemur(options, generating);
    if (!femur) return femur.error();
    Result<Report> report = save(femur->ct, command.output, progress);
    if (!report) return report;
    const FemurLandmarks& marks = femur->landmarks;
    report->json["elapsed_ms"] = femur->elapsed_ms;
    report->json["landmarks"] = {{"head_center_mm", arrayOf(marks.head_center_mm)},
                                 {"head_radius_mm", marks.head_radius_mm},
                                 {"neck_base_mm", arrayOf(marks.neck_base_mm)},
                                 {"neck_direction", arrayOf(marks.neck_direction)},
                                 {"greater_trochanter_mm", arrayOf(marks.greater_trochanter_mm)},
                                 {"lesser_trochanter_mm", arrayOf(marks.lesser_trochanter_mm)},
                                 {"isthmus_mm", arrayOf(marks.isthmus_mm)},
                                 {"isthmus_canal_mm", marks.isthmus_canal_mm},
                                 {"canal_flare_index", marks.canal_flare_index}};
    report->line("femur", fmt::format("{}, Dorr type {}{}", command.side, command.dorr,
                                      command.after_removal ? ", after removal of an implant" : ""));
    report->line("head", fmt::format("{:.1f} mm", 2 * marks.head_radius_mm));
    report->line("canal", fmt::format("{:.1f} mm at the isthmus, flare index {:.2f}", marks.isthmus_canal_mm,
                                      marks.canal_flare_index));
    report->line("generated in", fmt::format("{:.1f} s", femur->elapsed_ms / 1000));
    return report;
}

Command declareFemur(CLI::App& parent) {
    const auto command = std::make_shared<FemurCommand>();
    FemurOptions& femur = command->options;
    CLI::App* app = parent.add_subcommand("femur", "A proximal femur with soft tissue and the hip's socket");
    app->add_option("-o,--out", command->output, "CT: .mha .nrrd .nii .nii.gz")->required();
    app->add_option("--side", command->side)->check(CLI::IsMember({"left", "right"}))->capture_default_str();
    app->add_option("--head-diameter-mm", femur.head_diameter_mm, "Size of the head; the rest scales with it")
        ->capture_default_str();
    app->add_option("--offset-mm", femur.femoral_offset_mm, "Head's centre to the shaft's axis")->capture_default_str();
    addDegrees(app, "--neck-shaft-angle-deg", femur.neck_shaft_angle_rad, "Between the neck's and the shaft's axis");
    addDegrees(app, "--anteversion-deg", femur.anteversion_rad, "Of the neck, toward the front");
    app->add_option("--bow-radius-mm", femur.bow_radius_mm, "Of the shaft's axis")->capture_default_str();
    app->add_option("--shaft-length-mm", femur.shaft_length_mm, "Below the lesser trochanter")->capture_default_str();
    app->add_option("--dorr", command->dorr, "Shape of the canal: A champagne flute, B usual, C stovepipe")
        ->check(CLI::IsMember({"A", "B", "C"}))
        ->capture_default_str();
    app->add_option("--canal-flare-index", femur.canal_flare_index, "Instead of the type's");
    app->add_option("--isthmus-canal-mm", femur.isthmus_canal_mm, "Instead of the type's");
    app->add_flag("--after-removal", command->after_removal,
                  "An implant was taken out: its old canal and remains of cement");
    app->add_flag("--dry", command->dry, "Bone in air, without soft tissue and pelvis");
    app->add_flag("--no-pelvis", command->no_pelvis, "Without the socket");
    app->add_option("--voxel-mm", femur.voxel_mm)->capture_default_str();
    app->add_option("--seed", femur.seed, "Of the bone's texture")
        ->check(CLI::NonNegativeNumber)
        ->capture_default_str();
    app->footer("Example: fluorocut-cli phantom femur --side right --dorr C --after-removal -o femur.mha");
    return {app, [command](Progress& progress) { return runFemur(*command, progress); }};
}

struct AcrylicCommand {
    AcrylicOptions options;
    std::vector<double> size_mm;
    std::string output;
};

Result<Report> runAcrylic(const AcrylicCommand& command, Progress& progress) {
    if (const Result<void> good = checkOutput(command.output, {}, kExtensions); !good) return good.error();
    AcrylicOptions options = command.options;
    if (!command.size_mm.empty()) options.size_mm = Vector3(command.size_mm[0], command.size_mm[1], command.size_mm[2]);
    SubProgress generating(progress, 0, 0.9);
    const Result<AcrylicPhantom> block = generateAcrylicBlock(options, generating);
    if (!block) return block.error();
    Result<Report> report = save(block->ct, command.output, progress);
    if (!report) return report;
    report->json["bead_centers_mm"] = nlohmann::ordered_json::array();
    for (const Vector3& bead : block->bead_centers_mm)
        report->json["bead_centers_mm"].push_back(arrayOf(bead));
    report->line("block", fmt::format("{:.4g} x {:.4g} x {:.4g} mm", options.size_mm.x(), options.size_mm.y(),
                                      options.size_mm.z()));
    report->line("beads", std::to_string(block->bead_centers_mm.size()));
    return report;
}

Command declareAcrylic(CLI::App& parent) {
    const auto command = std::make_shared<AcrylicCommand>();
    AcrylicOptions& block = command->options;
    CLI::App* app = parent.add_subcommand("acrylic", "The paper's test object: a block of acrylic in air");
    app->add_option("-o,--out", command->output, "CT: .mha .nrrd .nii .nii.gz")->required();
    app->add_option("--size-mm", command->size_mm, "x y z")
        ->expected(3)
        ->default_str(fmt::format("{} {} {}", block.size_mm.x(), block.size_mm.y(), block.size_mm.z()));
    app->add_option("--edge-radius-mm", block.edge_radius_mm, "Rounding of the edges")->capture_default_str();
    app->add_option("--voxel-mm", block.voxel_mm)->capture_default_str();
    app->add_option("--beads", block.beads, "Steel beads in the walls")->capture_default_str();
    app->add_option("--bead-diameter-mm", block.bead_diameter_mm)->capture_default_str();
    app->footer("Example: fluorocut-cli phantom acrylic --beads 6 -o block.nrrd");
    return {app, [command](Progress& progress) { return runAcrylic(*command, progress); }};
}

}  // namespace

Command declarePhantom(CLI::App& parent) {
    CLI::App* app =
        parent.add_subcommand("phantom", "Generate a built-in patient as a CT, or a picture of a calibration object");
    app->fallthrough();
    const std::vector<Command> kinds{declareFemur(*app), declareAcrylic(*app), declarePhantomPlate(*app),
                                     declarePhantomBeads(*app), declarePhantomCorkscrew(*app)};
    app->footer("`fluorocut-cli phantom femur --help` tells its options.");
    return {app, [kinds](Progress& progress) -> Result<Report> {
                for (const Command& kind : kinds) {
                    if (kind.app->parsed()) return kind.run(progress);
                }
                return invalidOption("phantom", "no kind", "femur, acrylic, plate, beads or corkscrew", "see --help");
            }};
}

}  // namespace fluorocut::cli
