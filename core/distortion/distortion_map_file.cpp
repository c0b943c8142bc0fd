#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/base/units.h"
#include "core/base/utc.h"
#include "core/distortion/distortion_map.h"
#include "core/io/atomic_file.h"

namespace fluorocut {
namespace {

constexpr std::string_view kSchema = "fluorocut/distortion/1";
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr int kMaxPixels = 16384;

nlohmann::ordered_json orNull(double value) {
    return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

Support readSupport(JsonObject object) {
    const Vector2 centre = object.vector<2>("centre_px");
    const std::vector<double> radii = object.numbers("radius_px", Support::kDirections);
    if (object.failed()) return {};
    if (!(centre.cwiseAbs().maxCoeff() <= 2 * kMaxPixels)) {
        object.fail("centre_px", "a point far outside the image", "one near it");
        return {};
    }
    for (const double radius : radii) {
        if (!(radius > 0 && radius <= 4 * kMaxPixels)) {
            object.fail("radius_px", fmt::format("{}", radius), fmt::format("above 0, up to {} px", 4 * kMaxPixels));
            return {};
        }
    }
    return {centre, radii};
}

DistortionQuality readQuality(JsonObject object) {
    DistortionQuality quality;
    quality.rms_px = object.numberOr("rms_px", kNaN);
    quality.rms_mm = object.numberOr("rms_mm", kNaN);
    quality.points_used = object.integer("points_used", 0);
    quality.points_rejected = object.integer("points_rejected", 0);
    quality.columns_found = object.integer("columns_found", 0);
    quality.rows_found = object.integer("rows_found", 0);
    quality.coverage = object.numberOr("coverage", kNaN);
    quality.warnings = object.texts("warnings");
    return quality;
}

}  // namespace

Result<DistortionMap> readDistortionMap(const std::filesystem::path& path) {
    Result<JsonObject> file = readJson(path, kSchema);
    if (!file) return file.error();
    DistortionMapParts parts;
    std::vector<std::string_view> names;
    for (const DistortionModelKind& kind : distortionModels())
        names.push_back(kind.name);
    const std::size_t kind = file->choice("model", names);
    parts.columns = file->integer("columns", 1, kMaxPixels);
    parts.rows = file->integer("rows", 1, kMaxPixels);
    parts.pixel_mm = file->number("pixel_mm", 1e-3, 100);
    parts.pitch_mm = file->number("pitch_mm", 1e-3, 1000);
    JsonObject motion = file->object("detector_from_plate");
    parts.detector_from_plate.rotation_rad = motion.number("rotation_rad", -10, 10);
    parts.detector_from_plate.shift_mm = motion.vector<2>("shift_mm");
    parts.support = readSupport(file->object("support"));
    parts.quality = readQuality(file->object("quality"));
    if (!file->isNull("position")) {
        JsonObject position = file->object("position");
        parts.position.emplace();
        parts.position->orbital_rad = radiansFromDegrees(position.number("orbital_deg", -360, 360));
        parts.position->angulation_rad = radiansFromDegrees(position.number("angulation_deg", -90, 90));
    }
    parts.measured_at = file->optionalText("measured_at").value_or("");
    if (!parts.measured_at.empty() && !daysFromUtc(parts.measured_at)) {
        file->fail("measured_at", "\"" + parts.measured_at + "\"", "a time like \"2026-03-01T09:30:00Z\", or null");
    }
    JsonObject parameters = file->object("parameters");
    if (file->failed()) return file->finish().error();
    parts.model = distortionModels()[kind].read(parameters);
    if (const Result<void> read = file->finish(); !read) return read.error();
    Result<DistortionMap> map = DistortionMap::create(std::move(parts));
    if (!map) {
        const Error& error = map.error();
        return invalidInput(path.string() + ", " + error.where, error.found, error.expected);
    }
    return map;
}

Result<void> writeDistortionMap(const std::filesystem::path& path, const DistortionMap& map) {
    const DistortionMapParts& parts = map.parts();
    if (!parts.measured_at.empty() && !daysFromUtc(parts.measured_at)) {
        return invalidOption("measured_at", "\"" + parts.measured_at + "\"", "a time like \"2026-03-01T09:30:00Z\"");
    }
    nlohmann::ordered_json json;
    json["schema"] = kSchema;
    json["model"] = parts.model->name();
    json["columns"] = parts.columns;
    json["rows"] = parts.rows;
    json["pixel_mm"] = parts.pixel_mm;
    json["pitch_mm"] = parts.pitch_mm;
    const PlaneMotion& motion = parts.detector_from_plate;
    json["detector_from_plate"] = {{"rotation_rad", motion.rotation_rad},
                                   {"shift_mm", {motion.shift_mm.x(), motion.shift_mm.y()}}};
    json["support"] = {{"centre_px", {parts.support.centre().x(), parts.support.centre().y()}},
                       {"radius_px", parts.support.radii()}};
    const DistortionQuality& quality = parts.quality;
    json["quality"] = {{"rms_px", orNull(quality.rms_px)},       {"rms_mm", orNull(quality.rms_mm)},
                       {"points_used", quality.points_used},     {"points_rejected", quality.points_rejected},
                       {"columns_found", quality.columns_found}, {"rows_found", quality.rows_found},
                       {"coverage", orNull(quality.coverage)},   {"warnings", quality.warnings}};
    json["position"] = nullptr;
    if (parts.position) {
        json["position"] = {{"orbital_deg", degreesFromRadians(parts.position->orbital_rad)},
                            {"angulation_deg", degreesFromRadians(parts.position->angulation_rad)}};
    }
    json["measured_at"] = nullptr;
    if (!parts.measured_at.empty()) json["measured_at"] = parts.measured_at;
    nlohmann::ordered_json parameters = nlohmann::ordered_json::object();
    for (const auto& [name, values] : parts.model->parameters())
        parameters[name] = values;
    json["parameters"] = std::move(parameters);
    return writeWhole(path, json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
}

}  // namespace fluorocut
