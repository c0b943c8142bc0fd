// implant: the library of stems, one of them as a mesh, and any manufacturer's mesh as an implant.
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/list.h"
#include "app/cli/files.h"
#include "app/cli/implants.h"
#include "app/cli/numbers.h"
#include "core/base/units.h"
#include "core/geometry/mesh_properties.h"
#include "core/geometry/mesh_tools.h"
#include "core/io/mesh_file.h"
#include "core/io/resources.h"
#include "core/planning/implant_file.h"
#include "core/planning/implant_import.h"

namespace fluorocut::cli {
namespace {

using Json = nlohmann::ordered_json;

Result<Report> runList(Progress&) {
    Report report;
    report.json["implants"] = Json::array();
    for (const std::string& entry : resourceNames("implants")) {
        const Result<std::filesystem::path> path = findResource("implants", entry);
        if (!path) return path.error();
        const Result<ImplantFamily> family = readImplantFamily(*path);
        if (!family) return family.error();
        Json sizes = Json::array();
        for (const StemSize& size : family->sizes)
            sizes.push_back({{"size", size.name},
                             {"stem_length_mm", size.length_mm},
                             {"distal_mm", arrayOf(size.distal_mm)},
                             {"proximal_mm", arrayOf(size.proximal_mm)},
                             {"offset_mm", size.offset_mm},
                             {"head_height_mm", size.head_height_mm}});
        report.json["implants"].push_back({{"name", entry},
                                           {"description", family->description},
                                           {"basis", family->basis},
                                           {"neck_shaft_angle_deg", degreesFromRadians(family->neck_shaft_angle_rad)},
                                           {"anteversion_deg", degreesFromRadians(family->anteversion_rad)},
                                           {"necks_mm", family->necks_mm},
                                           {"heads_mm", family->heads_mm},
                                           {"sizes", sizes}});
        report.line(entry, family->description);
        const StemSize &first = family->sizes.front(), &last = family->sizes.back();
        report.line("", fmt::format("{} sizes, {} to {}: stems of {:g} to {:g} mm, offsets of {:g} to {:g} mm",
                                    family->sizes.size(), first.name, last.name, first.length_mm, last.length_mm,
                                    first.offset_mm, last.offset_mm));
        const auto row = [](const std::vector<double>& values) {
            return listText(Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size())));
        };
        report.line("", fmt::format("necks {} mm, heads {} mm, neck at {:.0f} degrees, anteverted by {:.0f}",
                                    row(family->necks_mm), row(family->heads_mm),
                                    degreesFromRadians(family->neck_shaft_angle_rad),
                                    degreesFromRadians(family->anteversion_rad)));
    }
    return report;
}

void tell(Report& report, const Implant& implant) {
    report.json["family"] = implant.family;
    report.json["size"] = implant.size;
    report.json["side"] = name(implant.side);
    report.json["stem_length_mm"] = implant.stem_length_mm;
    report.json["resection_z_mm"] = implant.resection_z_mm;
    report.json["head_center_mm"] = implant.head_center.allFinite() ? arrayOf(implant.head_center) : Json(nullptr);
    report.json["parts"] = Json::array();
    report.line("stem", fmt::format("{} {} {}, {:.1f} mm long below the resection", implant.family, implant.size,
                                    name(implant.side), implant.stem_length_mm));
    if (implant.head_center.allFinite())
        report.line("head", fmt::format("{:g} mm, its centre at {} mm", 2 * implant.head_radius_mm,
                                        listText(implant.head_center, "{:.1f}")));
    for (const ImplantPart& part : implant.parts) {
        const MeshProperties properties = meshProperties(part.mesh);
        report.json["parts"].push_back({{"name", part.name},
                                        {"material", name(part.material)},
                                        {"volume_mm3", properties.volume_mm3},
                                        {"triangles", properties.triangles}});
        report.line(part.name, fmt::format("{}, {:.1f} cm3, {} triangles", name(part.material),
                                           properties.volume_mm3 / 1000, properties.triangles));
    }
    report.json["in_bone_mm3"] = meshProperties(implant.in_bone).volume_mm3;
}

struct MakeOptions {
    ImplantWish wish;
    std::string part = "all", output;
};

Result<Report> runMake(const MakeOptions& options, Progress&) {
    if (auto good = checkOutput(options.output, {options.wish.name}, {".stl"}); !good) return good.error();
    const Result<ChosenImplant> chosen = implantOf(options.wish);
    if (!chosen) return chosen.error();
    const Implant& implant = chosen->implant;
    TriangleMesh mesh;
    if (options.part == "in-bone") {
        mesh = implant.in_bone;
    } else {
        for (const ImplantPart& part : implant.parts)
            if (options.part == "all" || options.part == part.name) mesh = merged(std::move(mesh), part.mesh);
    }
    if (mesh.triangles.empty())
        return invalidOption("--part", options.part, "a part that the implant has", "this one has no head");
    if (auto written = writeMesh(options.output, mesh); !written) return written.error();
    Report report;
    report.json["file"] = options.output;
    report.json["part"] = options.part;
    report.line("mesh", options.output);
    tell(report, implant);
    report.json["remarks"] = chosen->remarks;
    for (const std::string& remark : chosen->remarks)
        report.line("guessed", remark);
    return report;
}

struct ImportCommand {
    std::string mesh, output, name, unit, side, material = "titanium";
    std::vector<double> axis, medial, reference;
};

Result<Report> runImport(const ImportCommand& command, Progress&) {
    if (auto good = checkOutput(command.output, {command.mesh}, {".json", ".stl"}); !good) return good.error();
    const Result<MeshFile> file = readMesh(command.mesh, {LengthUnit::mm, false});
    if (!file) return file.error();
    ImportOptions options;
    options.name = command.name.empty() ? std::filesystem::path(command.mesh).stem().string() : command.name;
    for (const auto& [unit, mm] : {std::pair("mm", 1.0), {"cm", 10.0}, {"m", 1000.0}, {"inch", 25.4}})
        if (command.unit == unit) options.mm_per_unit = mm;
    const auto vector = [](const std::vector<double>& values) -> std::optional<Vector3> {
        if (values.empty()) return std::nullopt;
        return Vector3(values[0], values[1], values[2]);
    };
    options.proximal = vector(command.axis);
    options.medial = vector(command.medial);
    options.reference = vector(command.reference);
    options.side = sideOf(command.side);
    options.material = *materialFromName(command.material);
    Result<ImplantImport> imported = importImplant(file->mesh, options, command.mesh);
    if (!imported) return imported.error();
    if (extensionOf(command.output) == ".json") {
        imported->description.mesh = command.mesh;
        if (auto written = writeMeshImplant(command.output, imported->description); !written) return written.error();
    } else {
        if (auto written = writeMesh(command.output, imported->implant.parts[0].mesh); !written) return written.error();
    }
    Report report;
    report.json["file"] = command.output;
    report.json["mm_per_unit"] = imported->description.mm_per_unit;
    report.json["cavity_from_mesh"] = rowsOf(imported->description.cavity_from_mesh.matrix());
    report.json["guessed"] = imported->guessed;
    report.json["uncertain"] = imported->uncertain;
    report.line("file", command.output);
    tell(report, imported->implant);
    for (const std::string& sentence : imported->guessed)
        report.line("guessed", sentence);
    return report;
}

}  // namespace

Command declareImplant(CLI::App& parent) {
    CLI::App* app = parent.add_subcommand("implant", "Femoral stems: the library, one as a mesh, a mesh as one");
    app->fallthrough();
    CLI::App* list = app->add_subcommand("list", "What the library holds");

    const auto make_options = std::make_shared<MakeOptions>();
    CLI::App* make = app->add_subcommand("make", "A stem with its head as STL, in mm, frame cavity");
    make->add_option("name", make_options->wish.name, "Name in the library, fluorocut/implant/1, or a mesh")
        ->required();
    declareChoice(*make, make_options->wish);
    make->add_option("--part", make_options->part, "What of it: in-bone is the stem below the resection")
        ->check(CLI::IsMember({"all", "stem", "head", "in-bone"}))
        ->capture_default_str();
    make->add_option("-o,--out", make_options->output, "Mesh: .stl")->required();
    make->footer("Example: fluorocut-cli implant make straight --size 12 --head 36 --neck 4 -o stem.stl");

    const auto import_options = std::make_shared<ImportCommand>();
    CLI::App* import = app->add_subcommand("import", "Any manufacturer's mesh; what is not given is guessed, and said");
    import->add_option("mesh", import_options->mesh, "STL, OBJ or PLY of a stem with its neck")->required();
    import->add_option("-o,--out", import_options->output, "fluorocut/implant/1 (.json) or the mesh in place (.stl)")
        ->required();
    import->add_option("--name", import_options->name, "What to call it; default: the file's name");
    import->add_option("--mesh-unit", import_options->unit, "Unit of the mesh")
        ->check(CLI::IsMember({"mm", "cm", "m", "inch"}));
    import->add_option("--axis", import_options->axis, "Proximal direction of the stem's axis, in the mesh's frame")
        ->expected(3);
    import->add_option("--medial", import_options->medial, "Direction toward the head, in the mesh's frame")
        ->expected(3);
    import
        ->add_option("--reference", import_options->reference,
                     "Point on the axis at the resection, in the mesh's frame and unit")
        ->expected(3);
    import->add_option("--side", import_options->side, "left or right; default: left")
        ->check(CLI::IsMember({"left", "right"}));
    std::vector<std::string> materials_known;
    for (const Material material : materials())
        materials_known.emplace_back(name(material));
    import->add_option("--material", import_options->material, "Of the stem")
        ->check(CLI::IsMember(materials_known))
        ->capture_default_str();
    import->footer("Example: fluorocut-cli implant import vendor.stl --mesh-unit mm --side right -o vendor.json");

    app->footer("`fluorocut-cli implant import --help` tells its options.");
    return {app, [=](Progress& progress) -> Result<Report> {
                if (list->parsed()) return runList(progress);
                if (make->parsed()) return runMake(*make_options, progress);
                if (import->parsed()) return runImport(*import_options, progress);
                return invalidOption("implant", "nothing to do", "list, make or import", "see --help");
            }};
}

}  // namespace fluorocut::cli
