#include "core/planning/implant_file.h"

#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/base/units.h"
#include "core/geometry/mesh_properties.h"
#include "core/geometry/mesh_section.h"
#include "core/geometry/mesh_tools.h"
#include "core/io/atomic_file.h"
#include "core/io/json_file.h"
#include "core/io/mesh_file.h"
#include "core/io/resources.h"

namespace fluorocut {
namespace {

constexpr std::string_view kSchema = "fluorocut/implant/1";
namespace fs = std::filesystem;

Material material(JsonObject& object, std::string_view field) {
    std::vector<std::string_view> names;
    for (const Material m : materials())
        names.push_back(name(m));
    const std::size_t chosen = object.choice(field, names);
    return object.failed() ? Material::titanium : materials()[chosen];
}

ImplantFamily familyOf(JsonObject& file) {
    ImplantFamily family;
    family.name = file.text("name");
    family.description = file.text("description");
    family.basis = file.text("basis");
    JsonObject parts = file.object("materials");
    family.stem_material = material(parts, "stem");
    family.head_material = material(parts, "head");
    JsonObject stem = file.object("stem");
    family.even_taper = stem.number("even_taper");
    family.flare_power = stem.number("flare_power");
    family.distal_exponent = stem.number("distal_exponent");
    family.proximal_exponent = stem.number("proximal_exponent");
    family.posterior_curve_mm = stem.numberOr("posterior_curve_mm", 0);
    if (!stem.isNull("flutes")) {
        JsonObject flutes = stem.object("flutes");
        family.flutes = flutes.integer("count", 1, 24);
        family.flute_depth_mm = flutes.number("depth_mm");
        family.flute_levels = flutes.vector<2>("levels");
    }
    family.neck_shaft_angle_rad = radiansFromDegrees(file.number("neck_shaft_angle_deg"));
    family.anteversion_rad = radiansFromDegrees(file.number("anteversion_deg"));
    family.necks_mm = file.numbers("necks_mm");
    family.heads_mm = file.numbers("heads_mm");
    for (JsonObject& row : file.objects("sizes")) {
        StemSize size;
        size.name = row.text("name");
        size.length_mm = row.number("length_mm");
        size.distal_mm = row.vector<2>("distal_mm");
        size.proximal_mm = row.vector<2>("proximal_mm");
        size.offset_mm = row.number("offset_mm");
        size.head_height_mm = row.number("head_height_mm");
        family.sizes.push_back(std::move(size));
    }
    return family;
}

Result<ImplantFamily> checkedFamily(JsonObject& file) {
    ImplantFamily family = familyOf(file);
    if (const Result<void> read = file.finish(); !read) return read.error();
    if (const Result<void> good = family.validate(); !good) {
        const Error& e = good.error();
        return invalidInput(file.path().string() + ", field " + e.where, e.found, e.expected, e.advice);
    }
    return family;
}

Result<MeshImplant> meshImplantOf(JsonObject& file) {
    MeshImplant implant;
    implant.name = file.text("name");
    implant.mesh = file.path().parent_path() / file.text("mesh");
    implant.mm_per_unit = file.number("mm_per_unit", 1e-4, 1e4);
    implant.material = material(file, "material");
    implant.side = file.choice("side", {"left", "right"}) == 0 ? Side::left : Side::right;
    implant.cavity_from_mesh = file.rigid("cavity_from_mesh");
    implant.resection_z_mm = file.number("resection_z_mm", -1000, 1000);
    if (!file.isNull("head")) {
        JsonObject head = file.object("head");
        implant.head_center_mm = head.vector<3>("center_mm");
        implant.head_radius_mm = head.number("radius_mm", 5, 50);
    }
    if (const Result<void> read = file.finish(); !read) return read.error();
    return implant;
}

Result<Implant> loadMeshImplant(const MeshImplant& description, std::optional<Side> side) {
    const Result<MeshFile> file = readMesh(description.mesh, {LengthUnit::mm, false});
    if (!file) return file.error();
    TriangleMesh mesh = file->mesh;
    for (Vector3& v : mesh.vertices)
        v = description.cavity_from_mesh * Vector3(description.mm_per_unit * v);
    if (meshProperties(mesh).volume_mm3 < 0) mesh = flipped(std::move(mesh));
    Result<Implant> implant = implantOfMesh(std::move(mesh), description);
    if (!implant) return implant.error();
    return !side || *side == implant->side ? std::move(*implant) : mirrored(std::move(*implant));
}

}  // namespace

Result<ImplantFamily> readImplantFamily(const fs::path& path) {
    Result<JsonObject> file = readJson(path, kSchema);
    if (!file) return file.error();
    if (file->has("mesh"))
        return invalidInput(path.string(), "one stem that a mesh gives", "a family with sizes",
                            "name it where an implant is asked for");
    return checkedFamily(*file);
}

Result<void> writeMeshImplant(const fs::path& path, const MeshImplant& implant) {
    nlohmann::ordered_json json = {
        {"schema", kSchema},
        {"name", implant.name},
        {"mesh", fs::proximate(fs::absolute(implant.mesh), fs::absolute(path).parent_path()).generic_string()},
        {"mm_per_unit", implant.mm_per_unit},
        {"material", name(implant.material)},
        {"side", name(implant.side)}};
    const Matrix4 matrix = implant.cavity_from_mesh.matrix();
    for (Eigen::Index r = 0; r < 4; ++r)
        json["cavity_from_mesh"].push_back({matrix(r, 0), matrix(r, 1), matrix(r, 2), matrix(r, 3)});
    json["resection_z_mm"] = implant.resection_z_mm;
    if (const auto& head = implant.head_center_mm)
        json["head"] = {{"center_mm", {head->x(), head->y(), head->z()}}, {"radius_mm", implant.head_radius_mm}};
    return writeWhole(path, json.dump(2) + "\n");
}

Result<Implant> loadImplant(const std::string& name, const ImplantChoice& choice) {
    const Result<fs::path> path = findResource("implants", name);
    if (!path) return path.error();
    Result<JsonObject> file = readJson(*path, kSchema);
    if (!file) return file.error();
    if (!file->has("mesh")) {
        const Result<ImplantFamily> family = checkedFamily(*file);
        return family ? makeImplant(*family, choice) : family.error();
    }
    const Result<MeshImplant> description = meshImplantOf(*file);
    if (!description) return description.error();
    if (!choice.size.empty())
        return invalidOption("size", choice.size, "none: " + path->string() + " holds one stem that a mesh gives");
    return loadMeshImplant(*description, choice.side);
}

Result<std::vector<Implant>> loadSizes(const std::string& name, const ImplantChoice& choice) {
    const Result<fs::path> path = findResource("implants", name);
    if (!path) return path.error();
    const Result<ImplantFamily> family = readImplantFamily(*path);
    if (!family) return family.error();
    std::vector<Implant> sizes;
    for (const StemSize& size : family->sizes) {
        ImplantChoice of_size = choice;
        of_size.size = size.name;
        Result<Implant> implant = makeImplant(*family, of_size);
        if (!implant) return implant.error();
        sizes.push_back(std::move(*implant));
    }
    return sizes;
}

Result<Implant> implantOfMesh(TriangleMesh mesh, const MeshImplant& description) {
    const std::string where = description.mesh.empty() ? "mesh" : description.mesh.string();
    const MeshProperties properties = meshProperties(mesh);
    if (Result<void> solid = requireSolid(properties, where); !solid) {
        Error error = solid.error();
        error.code = ErrorCode::invalidInput;
        return error;
    }
    const Result<HalfEdgeMesh> half_edges = HalfEdgeMesh::build(mesh, where);
    if (!half_edges) return half_edges.error();
    Result<TriangleMesh> in_bone = partBelow(*half_edges, {{0, 0, description.resection_z_mm}, {0, 0, 1}});
    if (!in_bone) {
        Error error = in_bone.error();
        error.where = where + ", part below the resection";
        return error;
    }
    Implant implant;
    implant.family = description.name;
    implant.side = description.side;
    implant.in_bone = std::move(*in_bone);
    if (description.head_center_mm) {
        implant.head_center = *description.head_center_mm;
        implant.head_radius_mm = description.head_radius_mm;
    }
    implant.resection_z_mm = description.resection_z_mm;
    implant.stem_length_mm = description.resection_z_mm - properties.min_corner.z();
    implant.parts.push_back({"stem", description.material, std::move(mesh)});
    return implant;
}

}  // namespace fluorocut
