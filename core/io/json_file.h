// Strict reading of FluoroCut's JSON files (and nothing of the JSON library in this header).
//
//     Result<JsonObject> file = readJson(path, "fluorocut/carm/1");
//     if (!file) return file.error();
//     carm.columns = file->integer("columns", 1, 16384);
//     carm.pixel_mm = file->vector<2>("pixel_mm");
//     for (JsonObject ring : file->objects("rings")) layout.rings.push_back({ring.number("x_mm"), ...});
//     if (Result<void> read = file->finish(); !read) return read.error();
//
// The first thing that is wrong is remembered with its file and field; every getter after it returns an empty value
// (NaN, 0, "", identity), so that a reader is written straight down and asks once, with finish(). finish() also names a
// field that nobody asked for: a misspelt or newer field never passes unseen. Numbers are finite by then.
#pragma once

#include <cstddef>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/rigid3.h"

namespace fluorocut {

class JsonObject {
  public:
    bool has(std::string_view field) const;     // is there, and may be null
    bool isNull(std::string_view field) const;  // absent or null

    // A required field. Limits are inclusive.
    double number(std::string_view field, double least = -std::numeric_limits<double>::max(),
                  double most = std::numeric_limits<double>::max());
    int integer(std::string_view field, int least = std::numeric_limits<int>::min(),
                int most = std::numeric_limits<int>::max());
    bool boolean(std::string_view field);
    std::string text(std::string_view field);
    // One of `allowed`; gives its index.
    std::size_t choice(std::string_view field, const std::vector<std::string_view>& allowed);

    std::vector<double> numbers(std::string_view field);                     // of any length
    std::vector<double> numbers(std::string_view field, std::size_t count);  // of this length
    template <int N>
    Eigen::Matrix<double, N, 1> vector(std::string_view field) {
        const std::vector<double> values = numbers(field, static_cast<std::size_t>(N));
        return Eigen::Map<const Eigen::Matrix<double, N, 1>>(values.data());
    }
    // An array of `rows` rows of `columns` numbers.
    Eigen::MatrixXd matrix(std::string_view field, int rows, int columns);
    // 4x4, row major, p_target = M p_source, mm. Orthonormal within 1e-5, determinant +1, last row 0 0 0 1.
    Rigid3 rigid(std::string_view field);
    std::vector<std::string> texts(std::string_view field);

    JsonObject object(std::string_view field);
    std::vector<JsonObject> objects(std::string_view field);

    // An optional field: absent or null gives nothing (or `otherwise`).
    std::optional<double> optionalNumber(std::string_view field);
    std::optional<std::string> optionalText(std::string_view field);
    double numberOr(std::string_view field, double otherwise);
    int integerOr(std::string_view field, int otherwise);
    bool booleanOr(std::string_view field, bool otherwise);

    // For checks that only the caller can make: the first failure of all wins.
    void fail(std::string_view field, std::string found, std::string expected, std::string advice = {});
    bool failed() const;

    // What went wrong first, or a field of this object, or of any object handed out by it, that nobody asked for.
    Result<void> finish() const;

    // The file's path as given, for paths inside it that are relative to it.
    const std::filesystem::path& path() const;

  private:
    struct Document;
    JsonObject(std::shared_ptr<Document> document, std::size_t node) : document_(std::move(document)), node_(node) {}
    friend Result<JsonObject> parseJson(std::string_view, const std::filesystem::path&, std::string_view);

    const void* find(std::string_view field);  // nullptr, and failed, when it is absent
    std::string where(std::string_view field) const;
    std::vector<double> numbersAt(const void* array, const std::string& field);

    std::shared_ptr<Document> document_;
    std::size_t node_;
};

// Reads a file and checks its `schema`. An empty `schema` takes a file without that field.
Result<JsonObject> readJson(const std::filesystem::path& path, std::string_view schema);

// The same for a text at hand; `path` is what messages call it.
Result<JsonObject> parseJson(std::string_view text, const std::filesystem::path& path, std::string_view schema);

// The schema a JSON file names ("fluorocut/pose/1"), empty when it names none.
Result<std::string> jsonSchema(const std::filesystem::path& path);

}  // namespace fluorocut
