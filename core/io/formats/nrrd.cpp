// NRRD (.nrrd, .nhdr; teem.sourceforge.net/nrrd/format.html): "NRRD000X", "field: value" lines, a blank line, elements.
// Geometry is converted from the file's space (LPS, RAS, LAS or unnamed) to LPS.
#include <algorithm>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "core/io/atomic_file.h"
#include "core/io/formats/byte_reader.h"
#include "core/io/formats/raster.h"

namespace fluorocut {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kMaxHeader = 1 << 18;

const std::map<std::string, ElementType> kTypes = {
    {"signed char", ElementType::int8},
    {"int8", ElementType::int8},
    {"int8_t", ElementType::int8},
    {"uchar", ElementType::uint8},
    {"unsigned char", ElementType::uint8},
    {"uint8", ElementType::uint8},
    {"uint8_t", ElementType::uint8},
    {"short", ElementType::int16},
    {"short int", ElementType::int16},
    {"signed short", ElementType::int16},
    {"signed short int", ElementType::int16},
    {"int16", ElementType::int16},
    {"int16_t", ElementType::int16},
    {"ushort", ElementType::uint16},
    {"unsigned short", ElementType::uint16},
    {"unsigned short int", ElementType::uint16},
    {"uint16", ElementType::uint16},
    {"uint16_t", ElementType::uint16},
    {"int", ElementType::int32},
    {"signed int", ElementType::int32},
    {"int32", ElementType::int32},
    {"int32_t", ElementType::int32},
    {"uint", ElementType::uint32},
    {"unsigned int", ElementType::uint32},
    {"uint32", ElementType::uint32},
    {"uint32_t", ElementType::uint32},
    {"longlong", ElementType::int64},
    {"long long", ElementType::int64},
    {"int64", ElementType::int64},
    {"int64_t", ElementType::int64},
    {"ulonglong", ElementType::uint64},
    {"unsigned long long", ElementType::uint64},
    {"uint64", ElementType::uint64},
    {"uint64_t", ElementType::uint64},
    {"float", ElementType::float32},
    {"double", ElementType::float64},
};

// "(1,0,0)" of `n` numbers.
bool parseVector(std::string_view text, std::size_t n, Vector3& vector) {
    text = trimmed(text);
    if (!text.starts_with('(') || !text.ends_with(')')) return false;
    const std::vector<std::string_view> parts = words(text.substr(1, text.size() - 2), ", \t");
    if (parts.size() != n) return false;
    vector.setZero();
    for (std::size_t i = 0; i < n; ++i) {
        if (!parseNumber(parts[i], vector[static_cast<Eigen::Index>(i)])) return false;
    }
    return true;
}

// The signs that take the file's space to LPS, or nothing for a space that is not a patient's.
bool signsToLps(const std::string& space, Vector3& signs) {
    if (space.empty() || space == "left-posterior-superior" || space == "lps") {
        signs = Vector3(1, 1, 1);
    } else if (space == "right-anterior-superior" || space == "ras") {
        signs = Vector3(-1, -1, 1);
    } else if (space == "left-anterior-superior" || space == "las") {
        signs = Vector3(1, -1, 1);
    } else {
        return false;
    }
    return true;
}

}  // namespace

Result<RasterHeader> readNrrdHeader(const fs::path& path) {
    const Result<std::string> text = readBeginning(path, kMaxHeader);
    if (!text) return text.error();
    const auto where = [&](const std::string& field) { return path.string() + ", header field " + field; };

    std::map<std::string, std::string> fields;
    std::size_t at = 0;
    bool complete = false, first = true;
    while (at < text->size()) {
        const std::size_t end = text->find('\n', at);
        if (end == std::string::npos && text->size() == kMaxHeader) break;
        const std::string_view line =
            trimmed(std::string_view(*text).substr(at, end == std::string::npos ? end : end - at));
        at = end == std::string::npos ? text->size() : end + 1;
        if (line.empty()) {
            complete = true;
            break;
        }
        if (std::exchange(first, false) || line.starts_with('#') || line.find(":=") != std::string_view::npos) continue;
        const std::size_t colon = line.find(": ");
        const std::size_t split = colon != std::string_view::npos ? colon : line.find(':');
        if (split == std::string_view::npos) {
            return invalidInput(path.string() + ", header", shown(line), "lines of the form field: value");
        }
        fields[lower(trimmed(line.substr(0, split)))] = std::string(trimmed(line.substr(split + 1)));
    }
    const auto get = [&](std::initializer_list<const char*> names) -> std::string {
        for (const char* key : names) {
            if (const auto found = fields.find(key); found != fields.end()) return found->second;
        }
        return {};
    };
    const std::string data_file = get({"data file", "datafile"});
    if (!complete && data_file.empty()) {
        return invalidInput(path.string() + ", header", "no blank line after it", "a complete NRRD header");
    }

    RasterHeader header;
    header.format = "NRRD";
    std::int64_t n = 0;
    if (!parseInteger(get({"dimension"}), n) || !(n == 2 || n == 3)) {
        return invalidInput(where("dimension"), shown(get({"dimension"})), "2 or 3",
                            "colour and time series are not read: save one channel of one time");
    }
    header.dimensions = static_cast<int>(n);
    const std::size_t axes = static_cast<std::size_t>(n);
    const std::string sizes = get({"sizes"});
    const std::vector<std::string_view> size_words = words(sizes);
    if (size_words.size() != axes) return invalidInput(where("sizes"), shown(sizes), fmt::format("{} numbers", n));
    for (std::size_t i = 0; i < axes; ++i) {
        if (!parseInteger(size_words[i], header.size[i])) {
            return invalidInput(where("sizes"), shown(size_words[i]), "a whole number");
        }
    }
    const std::string type = lower(get({"type"}));
    const auto known = kTypes.find(type);
    if (known == kTypes.end()) return invalidInput(where("type"), shown(type), "a number type such as short or float");
    header.type = known->second;
    if (byteCount(header.type) > 1) {
        const std::string endian = lower(get({"endian"}));
        if (endian != "little" && endian != "big") return invalidInput(where("endian"), shown(endian), "little or big");
        header.big_endian = endian == "big";
    }
    const std::string encoding = lower(get({"encoding"}));
    if (encoding == "gzip" || encoding == "gz") {
        header.compressed = true;
    } else if (encoding != "raw") {
        return invalidInput(where("encoding"), shown(encoding), "raw or gzip", "save it with one of these");
    }
    for (const char* field : {"byte skip", "byteskip", "line skip", "lineskip"}) {
        if (const std::string skip = get({field}); !skip.empty() && skip != "0") {
            return invalidInput(where(field), shown(skip), "0", "save it as a single .nrrd file");
        }
    }

    const std::string space = lower(get({"space"}));
    Vector3 signs;
    if (!signsToLps(space, signs)) {
        return invalidInput(where("space"), shown(space),
                            "left-posterior-superior, right-anterior-superior or left-anterior-superior");
    }
    const std::string directions = get({"space directions"});
    if (!directions.empty()) {
        // "(a,b,c) (d,e,f) (g,h,i)": split after each closing bracket
        std::size_t from = 0;
        const std::size_t length = space.empty() ? axes : 3;
        for (std::size_t axis = 0; axis < axes; ++axis) {
            const std::size_t close = directions.find(')', from);
            const std::string_view part =
                std::string_view(directions)
                    .substr(std::min(from, directions.size()), close == std::string::npos ? close : close - from + 1);
            Vector3 vector;
            if (!parseVector(part, length, vector)) {
                return invalidInput(where("space directions"), shown(trimmed(part)),
                                    fmt::format("{} vectors of {} finite numbers", axes, length));
            }
            const auto column = static_cast<Eigen::Index>(axis);
            const double norm = vector.norm();
            header.spacing_mm[column] = norm;
            header.direction.col(column) = signs.cwiseProduct(vector) / (norm > 0 ? norm : 1);
            from = close == std::string::npos ? directions.size() : close + 1;
        }
        if (!trimmed(std::string_view(directions).substr(from)).empty()) {
            return invalidInput(where("space directions"), shown(directions), fmt::format("{} vectors", axes));
        }
        if (axes == 2 && length == 3) {
            header.direction.col(2) = header.direction.col(0).cross(header.direction.col(1));
        }
        if (const std::string origin = get({"space origin"}); !origin.empty()) {
            if (!parseVector(origin, length, header.origin_mm)) {
                return invalidInput(where("space origin"), shown(origin),
                                    fmt::format("a vector of {} finite numbers", length));
            }
            header.origin_mm = signs.cwiseProduct(header.origin_mm).eval();
        }
        const std::string units = get({"space units"});
        for (std::string_view unit : words(units, " \"")) {
            if (unit != "mm" && unit != "millimeter" && unit != "millimeters") {
                return invalidInput(where("space units"), shown(units), "mm");
            }
        }
    } else if (const std::string spacings = get({"spacings"}); !spacings.empty()) {
        const std::vector<std::string_view> parts = words(spacings);
        for (std::size_t i = 0; i < axes; ++i) {
            if (parts.size() != axes || !parseNumber(parts[i], header.spacing_mm[static_cast<Eigen::Index>(i)])) {
                return invalidInput(where("spacings"), shown(spacings), fmt::format("{} finite numbers", n));
            }
        }
    } else {
        header.has_spacing = false;
    }
    if (data_file.empty()) {
        header.data_file = path;
        header.data_offset = at;
    } else if (lower(data_file).starts_with("list") || data_file.find('%') != std::string::npos) {
        return invalidInput(where("data file"), shown(data_file), "the name of one file",
                            "save it as a single .nrrd file");
    } else {
        header.data_file = path.parent_path() / data_file;
    }
    return header;
}

Result<void> writeNrrd(const fs::path& path, const RasterView& raster) {
    Result<std::string> data = encodeElements(path, *raster.values, raster.type);
    if (!data) return data.error();
    if (raster.compressed) data = deflated(*data, DeflateWrapper::gzip);
    const int n = raster.dimensions;
    std::string sizes, directions, kinds, spacings;
    for (int i = 0; i < n; ++i) {
        const Vector3 step = raster.direction.col(i) * raster.spacing_mm[i];
        sizes += fmt::format(" {}", raster.size[static_cast<std::size_t>(i)]);
        spacings += fmt::format(" {}", raster.spacing_mm[i]);
        directions += fmt::format(" ({},{},{})", step.x(), step.y(), step.z());
        kinds += " domain";
    }
    const char* type = nullptr;
    switch (raster.type) {
        case ElementType::uint8:
            type = "uint8";
            break;
        case ElementType::uint16:
            type = "uint16";
            break;
        case ElementType::int16:
            type = "int16";
            break;
        default:
            type = "float";
    }
    std::string text =
        fmt::format("NRRD0004\ntype: {}\ndimension: {}\nsizes:{}\nkinds:{}\nendian: little\nencoding: {}\n", type, n,
                    sizes, kinds, raster.compressed ? "gzip" : "raw");
    if (n == 3) {
        text += fmt::format("space: left-posterior-superior\nspace directions:{}\nspace origin: ({},{},{})\n",
                            directions, raster.origin_mm.x(), raster.origin_mm.y(), raster.origin_mm.z());
    } else {
        text += fmt::format("spacings:{}\n", spacings);
    }
    return writeWhole(path, text + "\n" + *data);
}

}  // namespace fluorocut
