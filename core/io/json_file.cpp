#include "core/io/json_file.h"

#include <cmath>
#include <set>
#include <stdexcept>

#include <Eigen/SVD>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/io/formats/byte_reader.h"

namespace fluorocut {

namespace {

using Json = nlohmann::json;

constexpr std::uint64_t kMaxJsonBytes = 64u << 20;
constexpr int kMaxDepth = 64;

const Json& asJson(const void* node) {
    return *static_cast<const Json*>(node);
}

// "text "LIN"", "number 3.5", "array of 3", ...: a value as the person who wrote the file knows it.
std::string describe(const Json& value) {
    switch (value.type()) {
        case Json::value_t::null:
            return "null";
        case Json::value_t::object:
            return "an object";
        case Json::value_t::array:
            return fmt::format("an array of {}", value.size());
        case Json::value_t::string: {
            const std::string& text = value.get_ref<const std::string&>();
            return text.size() <= 60 ? "\"" + text + "\"" : fmt::format("a text of {} characters", text.size());
        }
        case Json::value_t::boolean:
            return value.get<bool>() ? "true" : "false";
        default:
            return value.dump();
    }
}

// Refuses what the library would take without a word: a field given twice (it keeps the last), deep nesting.
class Strictness {
  public:
    bool operator()(int depth, Json::parse_event_t event, Json& parsed) {
        if (event == Json::parse_event_t::object_start || event == Json::parse_event_t::array_start) {
            if (depth >= kMaxDepth) throw std::runtime_error(fmt::format("nesting deeper than {}", kMaxDepth));
        }
        if (event == Json::parse_event_t::object_start) open_.emplace_back();
        if (event == Json::parse_event_t::object_end) open_.pop_back();
        if (event == Json::parse_event_t::key && !open_.back().insert(parsed.get<std::string>()).second) {
            throw std::runtime_error("the field \"" + parsed.get<std::string>() + "\" twice in one object");
        }
        return true;
    }

  private:
    std::vector<std::set<std::string>> open_;
};

Result<Json> parse(std::string_view text, const std::string& where) {
    try {
        Strictness strictness;
        return Json::parse(text, std::ref(strictness));
    } catch (const Json::exception& error) {
        std::string what = error.what();
        // "[json.exception.parse_error.101] parse error at line 1, column 2: ..."; the bracket is the library's own
        if (const auto bracket = what.find("] "); bracket != std::string::npos) what.erase(0, bracket + 2);
        return invalidInput(where, what, "JSON (numbers finite, text in UTF-8)");
    } catch (const std::runtime_error& error) {
        return invalidInput(where, error.what(), "each field once, nested a few levels");
    }
}

}  // namespace

struct JsonObject::Document {
    struct Node {
        const Json* value;
        std::string prefix;  // "rings[2]."
        std::set<std::string, std::less<>> asked;
    };

    std::filesystem::path path;
    Json root;
    std::vector<Node> nodes;
    std::optional<Error> error;
};

std::string JsonObject::where(std::string_view field) const {
    return fmt::format("{}, field {}{}", document_->path.string(), document_->nodes[node_].prefix, field);
}

void JsonObject::fail(std::string_view field, std::string found, std::string expected, std::string advice) {
    if (!document_->error) {
        document_->error = invalidInput(where(field), std::move(found), std::move(expected), std::move(advice));
    }
}

bool JsonObject::failed() const {
    return document_->error.has_value();
}

const std::filesystem::path& JsonObject::path() const {
    return document_->path;
}

bool JsonObject::has(std::string_view field) const {
    return document_->nodes[node_].value->contains(field);
}

bool JsonObject::isNull(std::string_view field) const {
    const Json& object = *document_->nodes[node_].value;
    const auto found = object.find(field);
    document_->nodes[node_].asked.emplace(field);
    return found == object.end() || found->is_null();
}

const void* JsonObject::find(std::string_view field) {
    Document::Node& node = document_->nodes[node_];
    node.asked.emplace(field);
    if (failed()) return nullptr;
    const auto found = node.value->find(field);
    if (found == node.value->end()) {
        fail(field, "nothing", "this field");
        return nullptr;
    }
    return &*found;
}

double JsonObject::number(std::string_view field, double least, double most) {
    constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
    const void* node = find(field);
    if (!node) return kNothing;
    const Json& value = asJson(node);
    if (!value.is_number()) {
        fail(field, describe(value), "a number");
        return kNothing;
    }
    const double number = value.get<double>();
    if (!(number >= least && number <= most)) {
        constexpr double kLargest = std::numeric_limits<double>::max();
        const std::string expected = least > -kLargest && most < kLargest
                                         ? fmt::format("a number from {} to {}", least, most)
                                         : (least > -kLargest ? fmt::format("a number of at least {}", least)
                                                              : fmt::format("a number of at most {}", most));
        fail(field, describe(value), expected);
        return kNothing;
    }
    return number;
}

int JsonObject::integer(std::string_view field, int least, int most) {
    const void* node = find(field);
    if (!node) return 0;
    const Json& value = asJson(node);
    const double number = value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN();
    if (!(number >= least && number <= most && number == std::floor(number))) {
        fail(field, describe(value), fmt::format("a whole number from {} to {}", least, most));
        return 0;
    }
    return static_cast<int>(number);
}

bool JsonObject::boolean(std::string_view field) {
    const void* node = find(field);
    if (!node) return false;
    if (!asJson(node).is_boolean()) {
        fail(field, describe(asJson(node)), "true or false");
        return false;
    }
    return asJson(node).get<bool>();
}

std::string JsonObject::text(std::string_view field) {
    const void* node = find(field);
    if (!node) return {};
    if (!asJson(node).is_string()) {
        fail(field, describe(asJson(node)), "a text in quotes");
        return {};
    }
    return asJson(node).get<std::string>();
}

std::size_t JsonObject::choice(std::string_view field, const std::vector<std::string_view>& allowed) {
    const std::string value = text(field);
    if (failed()) return 0;
    for (std::size_t i = 0; i < allowed.size(); ++i) {
        if (value == allowed[i]) return i;
    }
    fail(field, describe(value), fmt::format("one of {}", fmt::join(allowed, ", ")));
    return 0;
}

std::vector<double> JsonObject::numbersAt(const void* node, const std::string& field) {
    const Json& array = asJson(node);
    if (!array.is_array()) {
        fail(field, describe(array), "an array of numbers");
        return {};
    }
    std::vector<double> values;
    values.reserve(array.size());
    for (const Json& element : array) {
        if (!element.is_number()) {
            fail(fmt::format("{}[{}]", field, values.size()), describe(element), "a number");
            return {};
        }
        values.push_back(element.get<double>());
    }
    return values;
}

std::vector<double> JsonObject::numbers(std::string_view field) {
    const void* node = find(field);
    return node ? numbersAt(node, std::string(field)) : std::vector<double>();
}

std::vector<double> JsonObject::numbers(std::string_view field, std::size_t count) {
    std::vector<double> values = numbers(field);
    if (!failed() && values.size() != count) {
        fail(field, fmt::format("an array of {}", values.size()), fmt::format("an array of {} numbers", count));
    }
    if (failed()) values.assign(count, std::numeric_limits<double>::quiet_NaN());
    return values;
}

Eigen::MatrixXd JsonObject::matrix(std::string_view field, int rows, int columns) {
    const Eigen::MatrixXd nothing = Eigen::MatrixXd::Constant(rows, columns, std::numeric_limits<double>::quiet_NaN());
    const void* node = find(field);
    if (!node) return nothing;
    const Json& array = asJson(node);
    const std::string expected = fmt::format("an array of {} rows of {} numbers", rows, columns);
    if (!array.is_array() || array.size() != static_cast<std::size_t>(rows)) {
        fail(field, describe(array), expected);
        return nothing;
    }
    Eigen::MatrixXd result(rows, columns);
    for (int r = 0; r < rows; ++r) {
        const std::string row_name = fmt::format("{}[{}]", field, r);
        const std::vector<double> row = numbersAt(&array[static_cast<std::size_t>(r)], row_name);
        if (failed()) return nothing;
        if (row.size() != static_cast<std::size_t>(columns)) {
            fail(row_name, fmt::format("{} numbers", row.size()), expected);
            return nothing;
        }
        for (int c = 0; c < columns; ++c)
            result(r, c) = row[static_cast<std::size_t>(c)];
    }
    return result;
}

Rigid3 JsonObject::rigid(std::string_view field) {
    const Eigen::MatrixXd m = matrix(field, 4, 4);
    if (failed()) return {};
    const Matrix3 rotation = m.topLeftCorner<3, 3>();
    const double error = (rotation * rotation.transpose() - Matrix3::Identity()).cwiseAbs().maxCoeff();
    if (!(m.row(3) == Eigen::RowVector4d(0, 0, 0, 1))) {
        fail(field, fmt::format("the last row {} {} {} {}", m(3, 0), m(3, 1), m(3, 2), m(3, 3)), "0 0 0 1",
             "write the matrix row major, the translation in its last column");
        return {};
    }
    if (!(error <= 1e-5)) {
        fail(field, fmt::format("a 3x3 part that is off a rotation by {:.3g}", error),
             "a rotation, orthonormal within 1e-5", "write it with at least 6 digits, without scale or shear");
        return {};
    }
    if (!(rotation.determinant() > 0)) {
        fail(field, "a 3x3 part that mirrors (determinant -1)", "a rotation with determinant +1");
        return {};
    }
    // the nearest rotation: U V^T of the singular value decomposition
    const Eigen::JacobiSVD<Matrix3> svd(rotation, Eigen::ComputeFullU | Eigen::ComputeFullV);
    return {Matrix3(svd.matrixU() * svd.matrixV().transpose()), Vector3(m.topRightCorner<3, 1>())};
}

std::vector<std::string> JsonObject::texts(std::string_view field) {
    const void* node = find(field);
    if (!node) return {};
    const Json& array = asJson(node);
    if (!array.is_array()) {
        fail(field, describe(array), "an array of texts");
        return {};
    }
    std::vector<std::string> values;
    for (const Json& element : array) {
        if (!element.is_string()) {
            fail(fmt::format("{}[{}]", field, values.size()), describe(element), "a text in quotes");
            return {};
        }
        values.push_back(element.get<std::string>());
    }
    return values;
}

JsonObject JsonObject::object(std::string_view field) {
    static const Json kEmpty = Json::object();
    const void* node = find(field);
    if (node && !asJson(node).is_object()) {
        fail(field, describe(asJson(node)), "an object");
        node = nullptr;
    }
    document_->nodes.push_back(
        {node ? &asJson(node) : &kEmpty, fmt::format("{}{}.", document_->nodes[node_].prefix, field), {}});
    return {document_, document_->nodes.size() - 1};
}

std::vector<JsonObject> JsonObject::objects(std::string_view field) {
    const void* node = find(field);
    if (!node) return {};
    const Json& array = asJson(node);
    if (!array.is_array()) {
        fail(field, describe(array), "an array of objects");
        return {};
    }
    std::vector<JsonObject> result;
    for (const Json& element : array) {
        const std::string name = fmt::format("{}[{}]", field, result.size());
        if (!element.is_object()) {
            fail(name, describe(element), "an object");
            return {};
        }
        document_->nodes.push_back({&element, fmt::format("{}{}.", document_->nodes[node_].prefix, name), {}});
        result.push_back({document_, document_->nodes.size() - 1});
    }
    return result;
}

std::optional<double> JsonObject::optionalNumber(std::string_view field) {
    if (isNull(field)) return std::nullopt;
    return number(field);
}

std::optional<std::string> JsonObject::optionalText(std::string_view field) {
    if (isNull(field)) return std::nullopt;
    return text(field);
}

double JsonObject::numberOr(std::string_view field, double otherwise) {
    return isNull(field) ? otherwise : number(field);
}

int JsonObject::integerOr(std::string_view field, int otherwise) {
    return isNull(field) ? otherwise : integer(field);
}

bool JsonObject::booleanOr(std::string_view field, bool otherwise) {
    return isNull(field) ? otherwise : boolean(field);
}

Result<void> JsonObject::finish() const {
    if (document_->error) return *document_->error;
    for (const Document::Node& node : document_->nodes) {
        for (const auto& [key, value] : node.value->items()) {
            if (node.asked.contains(key)) continue;
            std::string known = fmt::format("{}", fmt::join(node.asked, ", "));
            return invalidInput(fmt::format("{}, field {}{}", document_->path.string(), node.prefix, key),
                                "a field that is not known", "only " + known, "remove it or correct its name");
        }
    }
    return {};
}

Result<JsonObject> parseJson(std::string_view text, const std::filesystem::path& path, std::string_view schema) {
    Result<Json> root = parse(text, path.string());
    if (!root) return root.error();
    if (!root->is_object()) return invalidInput(path.string(), describe(*root), "a JSON object");
    auto document = std::make_shared<JsonObject::Document>();
    document->path = path;
    document->root = std::move(*root);
    document->nodes.push_back({&document->root, "", {}});
    JsonObject object(document, 0);
    if (!schema.empty()) {
        const std::string found = object.text("schema");
        if (!object.failed() && found != schema) {
            object.fail("schema", "\"" + found + "\"", "\"" + std::string(schema) + "\"");
        }
        if (object.failed()) return *document->error;
    }
    return object;
}

Result<JsonObject> readJson(const std::filesystem::path& path, std::string_view schema) {
    Result<std::string> text = readWholeFile(path, kMaxJsonBytes);
    if (!text) return text.error();
    return parseJson(*text, path, schema);
}

Result<std::string> jsonSchema(const std::filesystem::path& path) {
    Result<JsonObject> object = readJson(path, "");
    if (!object) return object.error();
    return object->optionalText("schema").value_or("");
}

}  // namespace fluorocut
