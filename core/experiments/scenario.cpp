#include "core/experiments/scenario.h"

#include <cmath>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/base/option_checks.h"
#include "core/io/formats/byte_reader.h"
#include "core/io/json_file.h"
#include "core/io/resources.h"
#include "core/planning/cavity.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::array<std::string_view, 3> kKinds{"femur", "acrylic", "ct"};

// The part of a file, or nothing when it is left out.
std::optional<JsonObject> part(JsonObject& file, std::string_view field) {
    if (file.isNull(field)) return std::nullopt;
    return file.object(field);
}

void read(JsonObject& in, std::string_view field, double& value) {
    value = in.numberOr(field, value);
}
void read(JsonObject& in, std::string_view field, int& value) {
    value = in.integerOr(field, value);
}
void read(JsonObject& in, std::string_view field, bool& value) {
    value = in.booleanOr(field, value);
}
void read(JsonObject& in, std::string_view field, std::string& value) {
    value = in.optionalText(field).value_or(value);
}
void read(JsonObject& in, std::string_view field, std::uint64_t& value) {
    const double number = in.numberOr(field, static_cast<double>(value));
    if (!(number >= 0 && number <= 9e15 && number == std::floor(number)))
        return in.fail(field, fmt::format("{}", number), "a whole number, 0 or more");
    value = static_cast<std::uint64_t>(number);
}
void read(JsonObject& in, std::string_view field, Vector3& value) {
    if (!in.isNull(field)) value = in.vector<3>(field);
}
// Relative to the file.
void read(JsonObject& in, std::string_view field, fs::path& value) {
    const auto text = in.optionalText(field);
    if (!text) return;
    value = fs::path(*text).is_absolute() ? fs::path(*text) : in.path().parent_path() / *text;
}

void readPatient(JsonObject& in, ScenarioPatient& patient) {
    read(in, "name", patient.name);
    if (!in.isNull("side")) patient.side = in.choice("side", {"left", "right"}) == 0 ? Side::left : Side::right;
    if (!in.isNull("kind")) patient.kind = static_cast<PatientKind>(in.choice("kind", {kKinds.begin(), kKinds.end()}));
    read(in, "ct", patient.ct);
    read(in, "phantom_seed", patient.phantom_seed);
    read(in, "voxel_mm", patient.voxel_mm);
    read(in, "block_mm", patient.block_mm);
    read(in, "soft_tissue", patient.soft_tissue);
    patient.bone_above_hu = in.numberOr("bone_above_hu", patient.kind == PatientKind::acrylic ? 80 : 250);
}

void readImplant(JsonObject& in, ScenarioImplant& implant) {
    const bool other = !in.isNull("cuboid_mm") || !in.isNull("mesh");
    implant.stem = in.optionalText("stem").value_or(other ? "" : implant.stem);
    read(in, "size", implant.size);
    if (!in.isNull("cuboid_mm")) implant.cuboid_mm = in.vector<3>("cuboid_mm");
    read(in, "mesh", implant.mesh);
}

void readPlacement(JsonObject& in, ScenarioPlacement& placement) {
    if (!in.isNull("femur_from_cavity")) placement.femur_from_cavity = in.rigid("femur_from_cavity");
    if (!in.isNull("axis_mm")) {
        const Eigen::MatrixXd points = in.matrix("axis_mm", 2, 3);
        placement.axis_mm = {Vector3(points.row(0).transpose()), Vector3(points.row(1).transpose())};
    }
    read(in, "below_resection_mm", placement.below_resection_mm);
    read(in, "open_wound_mm", placement.open_wound_mm);
}

void readCut(JsonObject& in, ScenarioCut& cut) {
    read(in, "cutter_radius_mm", cut.cutter_radius_mm);
    read(in, "cutter_length_mm", cut.cutter_length_mm);
    read(in, "stages", cut.stages);
    if (!in.isNull("insets_mm")) cut.insets_mm = in.numbers("insets_mm");
    read(in, "most_cusp_mm", cut.most_cusp_mm);
    read(in, "offset_mm", cut.offset_mm);
    read(in, "fill_hu", cut.fill_hu);
}

void readCarm(JsonObject& in, ScenarioCarm& carm) {
    read(in, "columns", carm.columns);
    read(in, "pixel_mm", carm.pixel_mm);
    read(in, "focal_length_mm", carm.focal_length_mm);
    read(in, "source_to_isocentre_mm", carm.source_to_isocentre_mm);
    read(in, "focal_length_error_mm", carm.focal_length_error_mm);
    read(in, "focal_length_sag_mm", carm.focal_length_sag_mm);
    read(in, "principal_point_error_px", carm.principal_point_error_px);
    read(in, "pincushion_mm", carm.pincushion_mm);
    read(in, "s_shape_rad", carm.s_shape_rad);
    read(in, "field_shift_mm", carm.field_shift_mm);
    read(in, "round_field", carm.round_field);
    read(in, "return_offset_mm", carm.return_offset_mm);
    read(in, "return_rotation_deg", carm.return_rotation_deg);
    read(in, "photons", carm.photons);
    read(in, "blur_px", carm.blur_px);
    read(in, "scatter", carm.scatter);
    read(in, "exact_projection", carm.exact_projection);
}

void readCalibration(JsonObject& in, ScenarioCalibration& calibration) {
    read(in, "pictures", calibration.pictures);
    read(in, "focal_length_sigma_mm", calibration.focal_length_sigma_mm);
    read(in, "principal_point_sigma_mm", calibration.principal_point_sigma_mm);
    read(in, "hand_eye_place_sigma_mm", calibration.hand_eye_place_sigma_mm);
    read(in, "hand_eye_rotation_sigma_deg", calibration.hand_eye_rotation_sigma_deg);
    read(in, "local_distortion_mm", calibration.local_distortion_mm);
}

void readCorkscrewPart(JsonObject& in, ScenarioCorkscrew& corkscrew) {
    read(in, "layout", corkscrew.layout);
    read(in, "above_mm", corkscrew.above_mm);
    read(in, "knock_place_sigma_mm", corkscrew.knock_place_sigma_mm);
    read(in, "knock_rotation_sigma_deg", corkscrew.knock_rotation_sigma_deg);
    if (!in.isNull("knock")) corkscrew.knock = in.vector<6>("knock");
}

Json arrayOf(const Vector3& v) {
    return {v.x(), v.y(), v.z()};
}

Json jsonOf(const ScenarioPlacement& placement) {
    Json json = {{"femur_from_cavity", nullptr},
                 {"axis_mm", nullptr},
                 {"below_resection_mm", placement.below_resection_mm},
                 {"open_wound_mm", placement.open_wound_mm}};
    if (placement.femur_from_cavity) {
        const Matrix4 m = placement.femur_from_cavity->matrix();
        Json rows = Json::array();
        for (int r = 0; r < 4; ++r)
            rows.push_back({m(r, 0), m(r, 1), m(r, 2), m(r, 3)});
        json["femur_from_cavity"] = rows;
    }
    if (placement.axis_mm)
        json["axis_mm"] = Json::array({arrayOf((*placement.axis_mm)[0]), arrayOf((*placement.axis_mm)[1])});
    return json;
}

Json jsonOf(const ScenarioCarm& carm) {
    return {{"columns", carm.columns},
            {"pixel_mm", carm.pixel_mm},
            {"focal_length_mm", carm.focal_length_mm},
            {"source_to_isocentre_mm", carm.source_to_isocentre_mm},
            {"focal_length_error_mm", carm.focal_length_error_mm},
            {"focal_length_sag_mm", carm.focal_length_sag_mm},
            {"principal_point_error_px", carm.principal_point_error_px},
            {"pincushion_mm", carm.pincushion_mm},
            {"s_shape_rad", carm.s_shape_rad},
            {"field_shift_mm", carm.field_shift_mm},
            {"round_field", carm.round_field},
            {"return_offset_mm", carm.return_offset_mm},
            {"return_rotation_deg", carm.return_rotation_deg},
            {"photons", carm.photons},
            {"blur_px", carm.blur_px},
            {"scatter", carm.scatter},
            {"exact_projection", carm.exact_projection}};
}

Result<void> checkPatient(const ScenarioPatient& patient) {
    if (patient.name.empty()) return invalidOption("patient.name", "nothing", "a name that the time-out can confirm");
    if ((patient.kind == PatientKind::ct) != !patient.ct.empty())
        return invalidOption("patient.ct", patient.ct.empty() ? std::string("nothing") : patient.ct.string(),
                             "a CT's path with the kind \"ct\", and only there");
    for (int a = 0; a < 3; ++a)
        if (auto ok = requireRange("patient.block_mm", patient.block_mm[a], 10, 300, "mm"); !ok) return ok;
    return requireRanges({{"patient.voxel_mm", patient.voxel_mm, 0.3, 2, "mm"},
                          {"patient.bone_above_hu", patient.bone_above_hu, -500, 3000, "HU"}});
}

Result<void> checkImplant(const ScenarioImplant& implant) {
    const int given = static_cast<int>(!implant.stem.empty()) + static_cast<int>(implant.cuboid_mm.has_value()) +
                      static_cast<int>(!implant.mesh.empty());
    if (given != 1) return invalidOption("implant", fmt::format("{} shapes", given), "one of stem, cuboid_mm and mesh");
    if (!implant.size.empty() && implant.stem.empty())
        return invalidOption("implant.size", implant.size, "null: only stems have sizes");
    if (implant.cuboid_mm)
        for (int a = 0; a < 3; ++a)
            if (auto ok = requireRange("implant.cuboid_mm", (*implant.cuboid_mm)[a], 6, 200, "mm"); !ok) return ok;
    return {};
}

Result<void> checkCut(const ScenarioCut& cut) {
    if (auto ok = requireRanges({{"cut.cutter_radius_mm", cut.cutter_radius_mm, 1, 10, "mm"},
                                 {"cut.cutter_length_mm", cut.cutter_length_mm, 20, 400, "mm"},
                                 {"cut.stages", static_cast<double>(cut.stages), 1, 10, ""},
                                 {"cut.most_cusp_mm", cut.most_cusp_mm, 0.005, 1, "mm"},
                                 {"cut.offset_mm", cut.offset_mm, -5, 5, "mm"},
                                 {"cut.fill_hu", cut.fill_hu, -1024, 1000, "HU"}});
        !ok)
        return ok;
    const std::string expected = fmt::format("one for each of the {} stages, falling to 0, the first at most {:g} mm",
                                             cut.stages, kMostInset_mm);
    if (cut.insets_mm.empty()) return {};
    if (cut.insets_mm.size() != static_cast<std::size_t>(cut.stages))
        return invalidOption("cut.insets_mm", fmt::format("{} insets", cut.insets_mm.size()), expected);
    for (std::size_t n = 0; n < cut.insets_mm.size(); ++n) {
        const bool last = n + 1 == cut.insets_mm.size();
        const double inset = cut.insets_mm[n];
        if (!(inset <= kMostInset_mm && (last ? inset == 0 : inset > cut.insets_mm[n + 1])))
            return invalidOption(fmt::format("cut.insets_mm[{}]", n), fmt::format("{}", inset), expected);
    }
    return {};
}

Result<void> checkViews(const std::vector<ScenarioView>& views) {
    if (views.empty() || views.size() > 8)
        return invalidOption("views", fmt::format("{}", views.size()), "1 to 8 views");
    std::set<std::string> names;
    for (std::size_t n = 0; n < views.size(); ++n) {
        const std::string field = fmt::format("views[{}].", n);
        if (views[n].name.empty() || !names.insert(views[n].name).second)
            return invalidOption(field + "name", fmt::format("\"{}\"", views[n].name), "a name of its own");
        if (auto ok = requireRange((field + "orbital_deg").c_str(), views[n].orbital_deg, -180, 180, "degrees"); !ok)
            return ok;
        if (auto ok = requireRange((field + "angulation_deg").c_str(), views[n].angulation_deg, -60, 60, "degrees");
            !ok)
            return ok;
    }
    return {};
}

}  // namespace

Result<void> Scenario::validate() const {
    if (name.empty()) return invalidOption("name", "nothing", "a name");
    if (auto ok = checkPatient(patient); !ok) return ok;
    if (auto ok = checkImplant(implant); !ok) return ok;
    if (auto ok = checkCut(cut); !ok) return ok;
    if (auto ok = checkViews(views); !ok) return ok;
    if (placement.axis_mm && !((*placement.axis_mm)[0] - (*placement.axis_mm)[1]).isZero(0) &&
        !(((*placement.axis_mm)[0] - (*placement.axis_mm)[1]).norm() >= 10))
        return invalidOption("placement.axis_mm", "two points nearer than 10 mm", "two points of an axis");
    if (corkscrew.knock) {
        for (int n = 0; n < 6; ++n)
            if (auto ok = requireRange("corkscrew.knock", (*corkscrew.knock)[n], -10, 10, "mm and degrees"); !ok)
                return ok;
    }
    return requireRanges(
        {{"placement.below_resection_mm", placement.below_resection_mm, -100, 200, "mm"},
         {"placement.open_wound_mm", placement.open_wound_mm, 0, 200, "mm"},
         {"carm.columns", static_cast<double>(carm.columns), 128, 2048, ""},
         {"carm.pixel_mm", carm.pixel_mm, 0.05, 2, "mm"},
         {"carm.focal_length_mm", carm.focal_length_mm, 500, 2000, "mm"},
         {"carm.source_to_isocentre_mm", carm.source_to_isocentre_mm, 200, carm.focal_length_mm - 50, "mm"},
         {"carm.focal_length_error_mm", carm.focal_length_error_mm, 0, 9, "mm"},
         {"carm.focal_length_sag_mm", carm.focal_length_sag_mm, -9, 9, "mm"},
         {"carm.principal_point_error_px", carm.principal_point_error_px, 0, 50, "px"},
         {"carm.pincushion_mm", carm.pincushion_mm, 0, 10, "mm"},
         {"carm.s_shape_rad", carm.s_shape_rad, 0, 0.1, "rad"},
         {"carm.field_shift_mm", carm.field_shift_mm, 0, 10, "mm"},
         {"carm.return_offset_mm", carm.return_offset_mm, 0, 100, "mm"},
         {"carm.return_rotation_deg", carm.return_rotation_deg, 0, 20, "degrees"},
         {"carm.photons", carm.photons, 50, 1e7, ""},
         {"carm.blur_px", carm.blur_px, 0, 5, "px"},
         {"calibration.focal_length_sigma_mm", calibration.focal_length_sigma_mm, 0.001, 10, "mm"},
         {"calibration.principal_point_sigma_mm", calibration.principal_point_sigma_mm, 0.001, 10, "mm"},
         {"calibration.hand_eye_place_sigma_mm", calibration.hand_eye_place_sigma_mm, 0.001, 5, "mm"},
         {"calibration.hand_eye_rotation_sigma_deg", calibration.hand_eye_rotation_sigma_deg, 0.001, 5, "degrees"},
         {"calibration.local_distortion_mm", calibration.local_distortion_mm, 0.001, 2, "mm"},
         {"corkscrew.above_mm", corkscrew.above_mm, 0, 300, "mm"},
         {"corkscrew.knock_place_sigma_mm", corkscrew.knock_place_sigma_mm, 0, 5, "mm"},
         {"corkscrew.knock_rotation_sigma_deg", corkscrew.knock_rotation_sigma_deg, 0, 5, "degrees"},
         {"robot.offset_mm", robot.offset_mm, 0, 50, "mm"},
         {"robot.rotation_deg", robot.rotation_deg, 0, 15, "degrees"},
         {"robot.calibration_mm", robot.calibration_mm, 0, 2, "mm"},
         {"robot.calibration_deg", robot.calibration_deg, 0, 2, "degrees"},
         {"beads.count", static_cast<double>(beads.count), 4, 40, ""},
         {"beads.diameter_mm", beads.diameter_mm, 1, 6, "mm"},
         {"beads.error_mm", beads.error_mm, 0, 1, "mm"},
         {"patient_offset_mm", patient_offset_mm, 0, 100, "mm"},
         {"patient_rotation_deg", patient_rotation_deg, 0, 30, "degrees"}});
}

Result<Scenario> parseScenario(std::string_view text, const fs::path& path) {
    auto file = parseJson(text, path, kScenarioSchema);
    if (!file) return file.error();
    Scenario scenario;
    read(*file, "name", scenario.name);
    read(*file, "seed", scenario.seed);
    if (auto in = part(*file, "patient")) readPatient(*in, scenario.patient);
    if (auto in = part(*file, "implant")) readImplant(*in, scenario.implant);
    if (auto in = part(*file, "placement")) readPlacement(*in, scenario.placement);
    if (auto in = part(*file, "cut")) readCut(*in, scenario.cut);
    if (!file->isNull("views")) {
        scenario.views.clear();
        for (JsonObject& in : file->objects("views"))
            scenario.views.push_back(
                {in.text("name"), in.numberOr("orbital_deg", 0), in.numberOr("angulation_deg", 0)});
    }
    if (auto in = part(*file, "carm")) readCarm(*in, scenario.carm);
    if (auto in = part(*file, "calibration")) readCalibration(*in, scenario.calibration);
    if (auto in = part(*file, "corkscrew")) readCorkscrewPart(*in, scenario.corkscrew);
    if (auto in = part(*file, "robot")) {
        read(*in, "offset_mm", scenario.robot.offset_mm);
        read(*in, "rotation_deg", scenario.robot.rotation_deg);
        read(*in, "calibration_mm", scenario.robot.calibration_mm);
        read(*in, "calibration_deg", scenario.robot.calibration_deg);
    }
    if (auto in = part(*file, "beads")) {
        read(*in, "count", scenario.beads.count);
        read(*in, "diameter_mm", scenario.beads.diameter_mm);
        read(*in, "error_mm", scenario.beads.error_mm);
    }
    read(*file, "patient_offset_mm", scenario.patient_offset_mm);
    read(*file, "patient_rotation_deg", scenario.patient_rotation_deg);
    if (auto ok = file->finish(); !ok) return ok.error();
    if (auto ok = scenario.validate(); !ok) {
        const Error& e = ok.error();
        return invalidInput(path.string() + ", field " + e.where, e.found, e.expected, e.advice);
    }
    return scenario;
}

Result<Scenario> readScenario(const std::string& name) {
    const auto path = findResource("scenarios", name);
    if (!path) return path.error();
    const auto bytes = readWholeFile(*path, 1u << 20);
    if (!bytes) return bytes.error();
    return parseScenario(*bytes, *path);
}

std::string textOf(const Scenario& s) {
    Json views = Json::array();
    for (const ScenarioView& view : s.views)
        views.push_back(
            {{"name", view.name}, {"orbital_deg", view.orbital_deg}, {"angulation_deg", view.angulation_deg}});
    Json knock = nullptr;
    if (s.corkscrew.knock) knock = std::vector<double>(s.corkscrew.knock->begin(), s.corkscrew.knock->end());
    const auto textOrNull = [](const std::string& text) { return text.empty() ? Json(nullptr) : Json(text); };
    const Json json = {
        {"schema", kScenarioSchema},
        {"name", s.name},
        {"seed", s.seed},
        {"patient",
         {{"name", s.patient.name},
          {"side", name(s.patient.side)},
          {"kind", kKinds[static_cast<std::size_t>(s.patient.kind)]},
          {"ct", textOrNull(s.patient.ct.string())},
          {"phantom_seed", s.patient.phantom_seed},
          {"voxel_mm", s.patient.voxel_mm},
          {"block_mm", arrayOf(s.patient.block_mm)},
          {"soft_tissue", s.patient.soft_tissue},
          {"bone_above_hu", s.patient.bone_above_hu}}},
        {"implant",
         {{"stem", textOrNull(s.implant.stem)},
          {"size", textOrNull(s.implant.size)},
          {"cuboid_mm", s.implant.cuboid_mm ? arrayOf(*s.implant.cuboid_mm) : Json(nullptr)},
          {"mesh", textOrNull(s.implant.mesh.string())}}},
        {"placement", jsonOf(s.placement)},
        {"cut",
         {{"cutter_radius_mm", s.cut.cutter_radius_mm},
          {"cutter_length_mm", s.cut.cutter_length_mm},
          {"stages", s.cut.stages},
          {"insets_mm", s.cut.insets_mm.empty() ? Json(nullptr) : Json(s.cut.insets_mm)},
          {"most_cusp_mm", s.cut.most_cusp_mm},
          {"offset_mm", s.cut.offset_mm},
          {"fill_hu", s.cut.fill_hu}}},
        {"views", views},
        {"carm", jsonOf(s.carm)},
        {"calibration",
         {{"pictures", s.calibration.pictures},
          {"focal_length_sigma_mm", s.calibration.focal_length_sigma_mm},
          {"principal_point_sigma_mm", s.calibration.principal_point_sigma_mm},
          {"hand_eye_place_sigma_mm", s.calibration.hand_eye_place_sigma_mm},
          {"hand_eye_rotation_sigma_deg", s.calibration.hand_eye_rotation_sigma_deg},
          {"local_distortion_mm", s.calibration.local_distortion_mm}}},
        {"corkscrew",
         {{"layout", s.corkscrew.layout},
          {"above_mm", s.corkscrew.above_mm},
          {"knock_place_sigma_mm", s.corkscrew.knock_place_sigma_mm},
          {"knock_rotation_sigma_deg", s.corkscrew.knock_rotation_sigma_deg},
          {"knock", knock}}},
        {"robot",
         {{"offset_mm", s.robot.offset_mm},
          {"rotation_deg", s.robot.rotation_deg},
          {"calibration_mm", s.robot.calibration_mm},
          {"calibration_deg", s.robot.calibration_deg}}},
        {"beads", {{"count", s.beads.count}, {"diameter_mm", s.beads.diameter_mm}, {"error_mm", s.beads.error_mm}}},
        {"patient_offset_mm", s.patient_offset_mm},
        {"patient_rotation_deg", s.patient_rotation_deg}};
    return json.dump(1) + "\n";
}

}  // namespace fluorocut
