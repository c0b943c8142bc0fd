// One description of a struct's fields for both ways, into JSON and out of it:
//
//     template <class Archive> void describe(Archive& json, PlannedStage& stage) {
//         json.number("inset_mm", stage.inset_mm);
//         json.text("mesh", stage.mesh);
//     }
//
// Numbers that are not finite are written as null and come back as NaN; angles are in rad inside and in degrees in the
// text. Used by this folder only, by .cpp files.
#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/base/units.h"
#include "core/geometry/pose.h"
#include "core/io/json_file.h"
#include "core/io/json_values.h"
#include "core/io/pose_file.h"

namespace fluorocut {

class JsonWriter {
  public:
    nlohmann::ordered_json json = nlohmann::ordered_json::object();

    void number(const char* field, double value) {
        if (std::isfinite(value)) {
            json[field] = value;
        } else {
            json[field] = nullptr;
        }
    }
    void degrees(const char* field, double rad) { number(field, degreesFromRadians(rad)); }
    void optional(const char* field, const std::optional<double>& value) {
        number(field, value.value_or(std::nan("")));
    }
    void integer(const char* field, int value) { json[field] = value; }
    void flag(const char* field, bool value) { json[field] = value; }
    void text(const char* field, const std::string& value) { json[field] = value; }
    void texts(const char* field, const std::vector<std::string>& values) { json[field] = values; }
    void numbers(const char* field, const std::vector<double>& values) { json[field] = values; }
    void vector(const char* field, const Vector3& value) { json[field] = arrayOf(value); }
    void vector(const char* field, const Vector2& value) { json[field] = arrayOf(value); }
    void rigid(const char* field, const Rigid3& value) { json[field] = rowsOf(value.matrix()); }
    void pose(const char* field, const Pose& value) {
        nlohmann::ordered_json& one = json[field];
        one["target"] = name(value.target);
        one["source"] = name(value.source);
        one["matrix"] = rowsOf(value.target_from_source.matrix());
        one["covariance"] = nullptr;
        if (value.covariance) one["covariance"] = rowsOf(*value.covariance);
    }
    template <class T>
    void object(const char* field, T& value) {
        JsonWriter inner;
        describe(inner, value);
        json[field] = std::move(inner.json);
    }
    template <class T>
    void list(const char* field, std::vector<T>& values) {
        nlohmann::ordered_json array = nlohmann::ordered_json::array();
        for (T& value : values) {
            JsonWriter inner;
            describe(inner, value);
            array.push_back(std::move(inner.json));
        }
        json[field] = std::move(array);
    }
};

class JsonReader {
  public:
    explicit JsonReader(JsonObject object) : json(std::move(object)) {}
    JsonObject json;

    void number(const char* field, double& value) { value = json.numberOr(field, std::nan("")); }
    void degrees(const char* field, double& rad) { rad = radiansFromDegrees(json.numberOr(field, std::nan(""))); }
    void optional(const char* field, std::optional<double>& value) { value = json.optionalNumber(field); }
    void integer(const char* field, int& value) { value = json.integer(field); }
    void flag(const char* field, bool& value) { value = json.boolean(field); }
    void text(const char* field, std::string& value) { value = json.text(field); }
    void texts(const char* field, std::vector<std::string>& values) { values = json.texts(field); }
    void numbers(const char* field, std::vector<double>& values) { values = json.numbers(field); }
    void vector(const char* field, Vector3& value) { value = json.vector<3>(field); }
    void vector(const char* field, Vector2& value) { value = json.vector<2>(field); }
    void rigid(const char* field, Rigid3& value) { value = json.rigid(field); }
    void pose(const char* field, Pose& value) {
        JsonObject one = json.object(field);
        value.target = frame(one, "target");
        value.source = frame(one, "source");
        value.target_from_source = one.rigid("matrix");
        value.covariance = readCovariance(one, "covariance");
    }
    template <class T>
    void object(const char* field, T& value) {
        JsonReader inner(json.object(field));
        describe(inner, value);
    }
    template <class T>
    void list(const char* field, std::vector<T>& values) {
        values.clear();
        for (const JsonObject& one : json.objects(field)) {
            if (json.failed()) return;
            JsonReader inner(one);
            describe(inner, values.emplace_back());
        }
    }

  private:
    static Frame frame(JsonObject& one, const char* field) {
        const std::string text = one.text(field);
        const std::optional<Frame> found = frameFromName(text);
        if (!found && !one.failed()) one.fail(field, "\"" + text + "\"", "a frame");
        return found.value_or(Frame::imager);
    }
};

}  // namespace fluorocut
