#include "core/procedure/step_results.h"

#include <fmt/format.h>

#include "core/procedure/json_archive.h"

namespace fluorocut {
namespace {

template <class T>
struct Schema;
template <>
struct Schema<ImagesResult> {
    static constexpr const char* name = "images";
};
template <>
struct Schema<RegistrationResult> {
    static constexpr const char* name = "register";
};
template <>
struct Schema<PlanResult> {
    static constexpr const char* name = "plan";
};
template <>
struct Schema<TimeOutResult> {
    static constexpr const char* name = "time-out";
};
template <>
struct Schema<CutStepResult> {
    static constexpr const char* name = "cut";
};
template <>
struct Schema<LocationResult> {
    static constexpr const char* name = "locate";
};
template <>
struct Schema<CorrectionResult> {
    static constexpr const char* name = "correct";
};

}  // namespace

// Found by the archives through their argument.

template <class Archive>
static void describe(Archive& json, Judgement& judgement) {
    json.text("what", judgement.what);
    json.number("value", judgement.value);
    // Without a limit: null. What is judged has one of the two at least.
    const double none = std::numeric_limits<double>::infinity();
    json.number("least", judgement.least);
    json.number("most", judgement.most);
    if (std::isnan(judgement.least)) judgement.least = -none;
    if (std::isnan(judgement.most)) judgement.most = none;
    json.text("unit", judgement.unit);
}

template <class Archive>
static void describeFindings(Archive& json, StepFindings& findings) {
    json.text("summary", findings.summary);
    json.texts("warnings", findings.warnings);
    json.texts("doubts", findings.doubts);
    json.list("acceptance", findings.acceptance);
}

template <class Archive>
static void describe(Archive& json, TakenImage& image) {
    json.text("view", image.view);
    json.text("hash", image.hash);
    json.text("file_name", image.file_name);
    json.degrees("orbital_deg", image.position.orbital_rad);
    json.degrees("angulation_deg", image.position.angulation_rad);
    json.vector("isocentre_in_room_mm", image.position.isocentre_in_room);
    json.text("source", image.source);
    json.text("identity", image.identity);
}

template <class Archive>
static void describe(Archive& json, ImagesResult& result) {
    json.integer("stage", result.stage);
    json.list("images", result.images);
    json.rigid("robot_from_flange", result.robot_from_flange);
    json.text("taken_utc", result.taken_utc);
}

template <class Archive>
static void describe(Archive& json, RegisteredView& view) {
    json.text("name", view.name);
    json.flag("used", view.used);
    json.number("residual_mm", view.residual_mm);
    json.degrees("residual_deg", view.residual_rad);
    json.number("probability", view.probability);
    json.degrees("turn_from_scales_deg", view.turn_from_scales_rad);
    json.pose("imager_from_femur", view.imager_from_femur);
}

template <class Archive>
static void describe(Archive& json, BudgetShare& share) {
    json.text("term", share.term);
    json.number("share", share.share);
}

template <class Archive>
static void describe(Archive& json, RegistrationResult& result) {
    json.pose("robot_from_femur", result.robot_from_femur);
    json.list("views", result.views);
    json.number("probability", result.probability);
    json.degrees("view_angle_deg", result.view_angle_rad);
    json.number("radius95_mm", result.radius95_mm);
    json.list("budget", result.budget);
    json.text("budget_sentence", result.budget_sentence);
}

template <class Archive>
static void describe(Archive& json, PlannedStage& stage) {
    json.number("inset_mm", stage.inset_mm);
    json.text("mesh", stage.mesh);
    json.text("path", stage.path);
    json.number("volume_mm3", stage.volume_mm3);
    json.number("depth_mm", stage.depth_mm);
    json.number("top_mm", stage.top_mm);
    json.integer("layers", stage.layers);
    json.number("cutting_mm", stage.cutting_mm);
    json.number("cutting_time_s", stage.cutting_time_s);
    json.number("worst_by_mesh_mm", stage.worst_by_mesh_mm);
    json.number("worst_by_voxels_mm", stage.worst_by_voxels_mm);
}

template <class Archive>
static void describe(Archive& json, PlanResult& result) {
    json.list("stages", result.stages);
    json.number("asked_mm", result.asked_mm);
    json.number("bound_mm", result.bound_mm);
    json.number("unreachable_mm", result.unreachable_mm);
}

template <class Archive>
static void describe(Archive& json, TimeOutResult& result) {
    json.integer("stage", result.stage);
    json.text("patient", result.patient);
    json.text("side", result.side);
    json.text("implant", result.implant);
    json.text("stage_name", result.stage_name);
    json.text("calibrated_utc", result.calibrated_utc);
    json.number("calibration_age_s", result.calibration_age_s);
}

template <class Archive>
static void describe(Archive& json, CutStepResult& result) {
    json.integer("stage", result.stage);
    json.text("registration", result.registration);
    json.pose("robot_from_femur", result.robot_from_femur);
    json.rigid("robot_from_cavity", result.robot_from_cavity);
    json.number("inset_mm", result.inset_mm);
    json.number("bound_mm", result.bound_mm);
    json.texts("checkers", result.checkers);
    json.number("length_mm", result.length_mm);
    json.number("time_s", result.time_s);
    json.number("greatest_force_n", result.greatest_force_n);
    json.number("bone_rms_mm", result.bone_rms_mm);
    json.degrees("bone_rms_deg", result.bone_rms_rad);
    json.number("bone_most_mm", result.bone_most_mm);
    json.text("trace", result.trace);
}

template <class Archive>
static void describe(Archive& json, CavityOffset& offset) {
    json.number("most_mm", offset.most_mm);
    json.number("middle_mm", offset.middle_mm);
    json.degrees("turn_deg", offset.turn_rad);
}

template <class Archive>
static void describe(Archive& json, LocatedView& view) {
    json.text("name", view.name);
    json.number("rms_log", view.rms_log);
    json.number("pose_sigmas", view.pose_sigmas);
    json.number("evidence", view.evidence);
    json.number("beads_px", view.beads_px);
    json.pose("imager_from_femur", view.imager_from_femur);
}

template <class Archive>
static void describe(Archive& json, LocationResult& result) {
    json.integer("stage", result.stage);
    json.pose("femur_from_cut_cavity", result.femur_from_cut_cavity);
    json.object("offset", result.offset);
    json.number("bound_mm", result.bound_mm);
    json.list("views", result.views);
    json.texts("weak_directions", result.weak_directions);
}

template <class Archive>
static void describe(Archive& json, CorrectionResult& result) {
    json.integer("stage", result.stage);
    json.pose("robot_from_femur", result.robot_from_femur);
    json.object("offset", result.offset);
    json.number("announced_mm", result.announced_mm);
    json.number("probability", result.probability);
    json.number("gain_place", result.gain_place);
    json.number("gain_turn", result.gain_turn);
    json.object("correction", result.correction);
    json.optional("next_inset_mm", result.next_inset_mm);
    json.optional("next_bound_mm", result.next_bound_mm);
}

namespace {

template <class T>
std::string textOf(T result) {
    JsonWriter writer;
    writer.json["schema"] = fmt::format("fluorocut/step-{}/1", Schema<T>::name);
    writer.json["step"] = Schema<T>::name;
    describeFindings(writer, result.findings);
    describe(writer, result);
    return writer.json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

template <class T>
Result<T> resultOf(std::string_view text, const std::string& where) {
    const std::string schema = fmt::format("fluorocut/step-{}/1", Schema<T>::name);
    Result<JsonObject> file = parseJson(text, where, schema);
    if (!file) return file.error();
    JsonReader reader(*file);
    (void)reader.json.text("step");
    T result;
    describeFindings(reader, result.findings);
    describe(reader, result);
    if (auto read = reader.json.finish(); !read) return read.error();
    return result;
}

}  // namespace

std::string jsonText(const ImagesResult& result) {
    return textOf(result);
}
std::string jsonText(const RegistrationResult& result) {
    return textOf(result);
}
std::string jsonText(const PlanResult& result) {
    return textOf(result);
}
std::string jsonText(const TimeOutResult& result) {
    return textOf(result);
}
std::string jsonText(const CutStepResult& result) {
    return textOf(result);
}
std::string jsonText(const LocationResult& result) {
    return textOf(result);
}
std::string jsonText(const CorrectionResult& result) {
    return textOf(result);
}

Result<ImagesResult> parseImages(std::string_view text, const std::string& where) {
    return resultOf<ImagesResult>(text, where);
}
Result<RegistrationResult> parseRegistration(std::string_view text, const std::string& where) {
    return resultOf<RegistrationResult>(text, where);
}
Result<PlanResult> parsePlan(std::string_view text, const std::string& where) {
    return resultOf<PlanResult>(text, where);
}
Result<TimeOutResult> parseTimeOut(std::string_view text, const std::string& where) {
    return resultOf<TimeOutResult>(text, where);
}
Result<CutStepResult> parseCut(std::string_view text, const std::string& where) {
    return resultOf<CutStepResult>(text, where);
}
Result<LocationResult> parseLocation(std::string_view text, const std::string& where) {
    return resultOf<LocationResult>(text, where);
}
Result<CorrectionResult> parseCorrection(std::string_view text, const std::string& where) {
    return resultOf<CorrectionResult>(text, where);
}

Result<StepFindings> parseFindings(std::string_view text, const std::string& where) {
    Result<JsonObject> file = parseJson(text, where, "");
    if (!file) return file.error();
    JsonReader reader(*file);
    StepFindings findings;
    describeFindings(reader, findings);
    // Other fields are the steps' own: not asked for here.
    if (reader.json.failed()) return reader.json.finish().error();
    return findings;
}

}  // namespace fluorocut
