// fabricate: what a workshop needs to make a calibration object: solids, drawings, and the file that describes it.
#include <memory>
#include <numbers>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/list.h"
#include "core/distortion/plate_solid.h"
#include "core/fabrication/bead_sheets.h"
#include "core/fabrication/corkscrew_rod.h"
#include "core/fabrication/plate_drawing.h"
#include "core/geometry/mesh_properties.h"
#include "core/io/atomic_file.h"
#include "core/io/mesh_file.h"
#include "core/io/resources.h"

namespace fluorocut::cli {
namespace {

namespace fs = std::filesystem;

struct Options {
    std::string description;  // a file or a built-in name
    std::string output;
};

Result<void> writeDrawing(const fs::path& folder, const std::string& name, const Drawing& drawing) {
    if (auto ok = writeWhole(folder / (name + ".svg"), drawing.svg()); !ok) return ok;
    return writeWhole(folder / (name + ".dxf"), drawing.dxf());
}

Report reportOf(const std::string& output, const std::vector<std::string>& files, double volume_mm3) {
    Report report;
    report.json = {{"folder", output}, {"files", files}, {"volume_mm3", volume_mm3}};
    report.line("folder", output);
    for (const std::string& file : files)
        report.line("", file);
    report.line("material", fmt::format("{:.1f} cm3", volume_mm3 / 1000));
    return report;
}

Result<Report> runPlate(const Options& options, Progress& progress) {
    const Result<fs::path> file = findResource("plates", options.description);
    if (!file) return file.error();
    const Result<GroovedPlate> plate = readGroovedPlate(*file);
    if (!plate) return plate.error();
    const Result<TriangleMesh> solid = plateSolid(*plate);
    if (!solid) return solid.error();
    const Result<Drawing> drawing = drawPlate(*plate);
    if (!drawing) return drawing.error();
    if (progress.isCancelled()) return cancelled("fabricate");
    const Result<void> written = writeWholeFolder(options.output, [&](const fs::path& folder) -> Result<void> {
        if (auto ok = writeGroovedPlate(folder / "plate.json", *plate); !ok) return ok;
        if (auto ok = writeMesh(folder / "plate.stl", *solid); !ok) return ok;
        return writeDrawing(folder, "plate", *drawing);
    });
    if (!written) return written.error();
    Report report = reportOf(options.output, {"plate.json", "plate.stl", "plate.svg", "plate.dxf"},
                             meshProperties(*solid).volume_mm3);
    report.json["grooves"] = plateExtent(*plate).grooves;
    return report;
}

Result<Report> runPhantom(const Options& options, Progress& progress) {
    const Result<fs::path> file = findResource("phantoms", options.description);
    if (!file) return file.error();
    const Result<BeadLayout> layout = readBeadLayout(*file);
    if (!layout) return layout.error();
    const Result<std::vector<BeadSheet>> sheets = beadSheets(*layout);
    if (!sheets) return sheets.error();
    std::vector<std::string> files{"phantom.json", "assembly.svg", "assembly.dxf"};
    double volume_mm3 = 0;
    const Result<void> written = writeWholeFolder(options.output, [&](const fs::path& folder) -> Result<void> {
        if (auto ok = writeBeadLayout(folder / "phantom.json", *layout); !ok) return ok;
        if (auto ok = writeDrawing(folder, "assembly", drawAssembly(*layout, *sheets)); !ok) return ok;
        const auto count = static_cast<int>(sheets->size());
        for (int n = 0; n < count; ++n) {
            if (progress.isCancelled()) return cancelled("fabricate");
            progress.report(double(n) / count, "sheets");
            const BeadSheet& sheet = (*sheets)[static_cast<std::size_t>(n)];
            const std::string name = fmt::format("sheet-{}", n + 1);
            const Result<TriangleMesh> solid = sheetSolid(sheet);
            if (!solid) return solid.error();
            volume_mm3 += meshProperties(*solid).volume_mm3;
            if (auto ok = writeMesh(folder / (name + ".stl"), *solid); !ok) return ok;
            if (auto ok = writeDrawing(folder, name, drawSheet(sheet, n + 1, count)); !ok) return ok;
            for (const char* extension : {".stl", ".svg", ".dxf"})
                files.push_back(name + extension);
        }
        return {};
    });
    if (!written) return written.error();
    Report report = reportOf(options.output, files, volume_mm3);
    report.json["sheets"] = sheets->size();
    report.json["beads"] = layout->beads.size();
    return report;
}

Result<Report> runCorkscrew(const Options& options, Progress& progress) {
    const Result<fs::path> file = findResource("fiducials", options.description);
    if (!file) return file.error();
    const Result<CorkscrewLayout> layout = readCorkscrew(*file);
    if (!layout) return layout.error();
    const Result<TriangleMesh> rod = corkscrewRod(*layout);
    if (!rod) return rod.error();
    const Result<Drawing> drawing = drawCorkscrew(*layout), paper = drawCorkscrewTemplate(*layout);
    if (!drawing) return drawing.error();
    if (!paper) return paper.error();
    if (progress.isCancelled()) return cancelled("fabricate");
    const Result<void> written = writeWholeFolder(options.output, [&](const fs::path& folder) -> Result<void> {
        if (auto ok = writeCorkscrew(folder / "corkscrew.json", *layout); !ok) return ok;
        if (auto ok = writeMesh(folder / "rod.stl", *rod); !ok) return ok;
        if (auto ok = writeDrawing(folder, "corkscrew", *drawing); !ok) return ok;
        return writeDrawing(folder, "template", *paper);
    });
    if (!written) return written.error();
    double wire_mm = layout->helix.length_mm();
    for (const CorkscrewRing& ring : layout->rings)
        wire_mm += 2 * std::numbers::pi * ring.radius_mm;
    Report report = reportOf(
        options.output, {"corkscrew.json", "rod.stl", "corkscrew.svg", "corkscrew.dxf", "template.svg", "template.dxf"},
        meshProperties(*rod).volume_mm3);
    report.json["wire_mm"] = wire_mm;
    report.line("wire", fmt::format("{:.0f} mm, {:.3g} mm thick", wire_mm, 2 * layout->helix.wire_radius_mm));
    return report;
}

Command declareKind(CLI::App& parent, const char* name, const char* what, const char* option, const char* schema,
                    const char* otherwise, Result<Report> (*run)(const Options&, Progress&)) {
    const auto options = std::make_shared<Options>();
    options->description = otherwise;
    CLI::App* app = parent.add_subcommand(name, what);
    CLI::Option* described =
        app->add_option(option, options->description, std::string(schema) + ", or one built in by name");
    if (options->description.empty()) {
        described->required();
    } else {
        described->capture_default_str();
    }
    app->add_option("-o,--out", options->output, "Folder: new or empty; it appears whole or not at all")->required();
    return {app, [options, run](Progress& progress) { return run(*options, progress); }};
}

}  // namespace

Command declareFabricate(CLI::App& parent) {
    CLI::App* app =
        parent.add_subcommand("fabricate", "What a workshop needs: STL in mm, dimensioned SVG and DXF, and the JSON");
    app->fallthrough();
    const std::vector<Command> kinds{
        declareKind(*app, "plate", "The grooved plate", "--plate", "Plate, fluorocut/plate/1", "paper", runPlate),
        declareKind(*app, "phantom", "A phantom of beads in parallel sheets", "--layout", "Beads, fluorocut/beads/1",
                    "", runPhantom),
        declareKind(*app, "corkscrew", "The corkscrew: its grooved rod, drawings and a paper template", "--corkscrew",
                    "Corkscrew, fluorocut/corkscrew/1", "corkscrew", runCorkscrew)};
    app->footer("Example: fluorocut-cli fabricate plate --plate paper -o workshop");
    return {app, [kinds](Progress& progress) -> Result<Report> {
                for (const Command& kind : kinds) {
                    if (kind.app->parsed()) return kind.run(progress);
                }
                return invalidOption("fabricate", "no kind", "plate, phantom or corkscrew", "see --help");
            }};
}

}  // namespace fluorocut::cli
