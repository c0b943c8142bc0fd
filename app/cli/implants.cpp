#include "app/cli/implants.h"

#include <filesystem>

#include <CLI/CLI.hpp>

#include "app/cli/files.h"
#include "app/cli/options.h"
#include "core/io/mesh_file.h"
#include "core/planning/implant_file.h"
#include "core/planning/implant_import.h"

namespace fluorocut::cli {

void declareChoice(CLI::App& app, ImplantWish& wish) {
    app.add_option("--size", wish.size, "Size, as `implant list` names it; default: the middle one");
    app.add_option("--side", wish.side, "left or right; default: left")->check(CLI::IsMember({"left", "right"}));
    app.add_option("--head", wish.head_mm, "Diameter of the head, mm")->capture_default_str();
    app.add_option("--neck", wish.neck_mm, "What the head adds to the neck's length, mm")->capture_default_str();
    app.add_option("--triangles", wish.triangles, "Of the stem, about")
        ->check(between(500, 400000))
        ->capture_default_str();
}

std::optional<Side> sideOf(const std::string& text) {
    if (text.empty()) return std::nullopt;
    return text == "right" ? Side::right : Side::left;
}

Result<ChosenImplant> implantOf(const ImplantWish& wish) {
    const std::string extension = extensionOf(wish.name);
    if (extension == ".stl" || extension == ".obj" || extension == ".ply") {
        if (!wish.size.empty())
            return invalidOption("--size", wish.size, "none with a mesh, which is one stem of one size");
        const Result<MeshFile> file = readMesh(wish.name, {LengthUnit::mm, false});
        if (!file) return file.error();
        ImportOptions options;
        options.name = std::filesystem::path(wish.name).stem().string();
        options.side = sideOf(wish.side);
        Result<ImplantImport> imported = importImplant(file->mesh, options, wish.name);
        if (!imported) return imported.error();
        return ChosenImplant{std::move(imported->implant), std::move(imported->guessed)};
    }
    Result<Implant> implant =
        loadImplant(wish.name, {wish.size, sideOf(wish.side), wish.head_mm, wish.neck_mm, wish.triangles});
    if (!implant) return implant.error();
    return ChosenImplant{std::move(*implant), {}};
}

}  // namespace fluorocut::cli
