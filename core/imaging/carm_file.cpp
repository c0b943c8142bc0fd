#include "core/imaging/carm_file.h"

#include <stdexcept>

#include <nlohmann/json.hpp>

#include "core/io/atomic_file.h"
#include "core/io/json_file.h"

namespace fluorocut {
namespace {

constexpr std::string_view kSchema = "fluorocut/carm/1";

Result<std::shared_ptr<const Distortion>> readDistortion(const std::filesystem::path& path, const CArm& carm,
                                                         const DistortionReaders& readers) {
    const Result<std::string> schema = jsonSchema(path);
    if (!schema) return schema.error();
    const auto reader = readers.find(*schema);
    if (reader != readers.end()) return reader->second(path, carm);
    std::string known;
    for (const auto& [name, read] : readers)
        known += (known.empty() ? "" : ", ") + name;
    return invalidInput("distortion file " + path.string(),
                        schema->empty() ? "no schema" : "a model of the kind \"" + *schema + "\"",
                        known.empty() ? "\"distortion\": null, as this version knows no model of distortion"
                                      : "one of the models " + known);
}

}  // namespace

Result<CArm> readCArm(const std::filesystem::path& path, const DistortionReaders& readers) {
    Result<JsonObject> file = readJson(path, kSchema);
    if (!file) return file.error();
    CArm carm;
    carm.name = file->text("name");
    carm.columns = file->integer("columns");
    carm.rows = file->integer("rows");
    carm.pixel_mm = file->vector<2>("pixel_mm");
    carm.focal_length_mm = file->number("focal_length_mm");
    carm.principal_point_px = file->vector<2>("principal_point_px");
    const bool distorted = !file->isNull("distortion");
    const std::string distortion = distorted ? file->text("distortion") : std::string();
    if (distorted && distortion.empty())
        file->fail("distortion", "an empty text", "null or the path of a distortion file");
    if (const Result<void> read = file->finish(); !read) return read.error();
    if (const Result<void> valid = carm.validate(); !valid) {
        const Error& error = valid.error();
        return invalidInput(path.string() + ", field " + error.where, error.found, error.expected, error.advice);
    }
    if (distorted) {
        auto model = readDistortion(path.parent_path() / distortion, carm, readers);
        if (!model) return model.error();
        carm.distortion = std::move(*model);
    }
    return carm;
}

Result<void> writeCArm(const std::filesystem::path& path, const CArm& carm,
                       const std::filesystem::path& distortion_file) {
    if ((carm.distortion == nullptr) != distortion_file.empty()) {
        throw std::logic_error("writeCArm: the C-arm's distortion and its file do not go together");
    }
    if (const Result<void> valid = carm.validate(); !valid) return valid.error();
    nlohmann::ordered_json json;
    json["schema"] = kSchema;
    json["name"] = carm.name;
    json["columns"] = carm.columns;
    json["rows"] = carm.rows;
    json["pixel_mm"] = {carm.pixel_mm.x(), carm.pixel_mm.y()};
    json["focal_length_mm"] = carm.focal_length_mm;
    json["principal_point_px"] = {carm.principal_point_px.x(), carm.principal_point_px.y()};
    json["distortion"] = nullptr;
    if (carm.distortion) {
        const std::filesystem::path folder = std::filesystem::absolute(path).lexically_normal().parent_path();
        json["distortion"] = distortion_file.is_absolute()
                                 ? distortion_file.lexically_normal().lexically_relative(folder).string()
                                 : distortion_file.string();
    }
    // A name that is no UTF-8 is repaired rather than refused.
    return writeWhole(path, json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
}

}  // namespace fluorocut
