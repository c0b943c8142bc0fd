// MetaImage (.mha, .mhd), the format of ITK's MetaIO: "Key = value" lines, ElementDataFile last, then the elements.
// TransformMatrix lists the axes' direction vectors one after the other; positions are LPS, mm.
#include <map>

#include <fmt/format.h>

#include "core/io/atomic_file.h"
#include "core/io/formats/byte_reader.h"
#include "core/io/formats/raster.h"

namespace fluorocut {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kMaxHeader = 1 << 16;

struct TypeName {
    const char* name;
    ElementType type;
};
// long is 4 bytes for MetaIO, whatever the machine
constexpr TypeName kTypes[] = {
    {"MET_UCHAR", ElementType::uint8},     {"MET_CHAR", ElementType::int8},     {"MET_USHORT", ElementType::uint16},
    {"MET_SHORT", ElementType::int16},     {"MET_UINT", ElementType::uint32},   {"MET_INT", ElementType::int32},
    {"MET_ULONG", ElementType::uint32},    {"MET_LONG", ElementType::int32},    {"MET_ULONG_LONG", ElementType::uint64},
    {"MET_LONG_LONG", ElementType::int64}, {"MET_FLOAT", ElementType::float32}, {"MET_DOUBLE", ElementType::float64},
};

class Fields {
  public:
    Fields(fs::path path, std::map<std::string, std::string> values)
        : path_(std::move(path)), values_(std::move(values)) {}

    // The value of the first of several names that is there.
    const std::string* find(std::initializer_list<const char*> names) const {
        for (const char* key : names) {
            if (const auto found = values_.find(key); found != values_.end()) return &found->second;
        }
        return nullptr;
    }

    Result<bool> flag(std::initializer_list<const char*> names, bool otherwise) const {
        const std::string* text = find(names);
        if (!text) return otherwise;
        const std::string value = lower(*text);
        if (value == "true" || value == "1") return true;
        if (value == "false" || value == "0") return false;
        return invalidInput(where(*names.begin()), shown(*text), "True or False");
    }

    Result<std::vector<double>> numbers(std::initializer_list<const char*> names, std::size_t count) const {
        std::vector<double> values;
        const std::string* text = find(names);
        if (!text) return values;
        for (const std::string_view word : words(*text)) {
            double value = 0;
            if (!parseNumber(word, value)) return invalidInput(where(*names.begin()), shown(word), "a finite number");
            values.push_back(value);
        }
        if (values.size() != count) {
            return invalidInput(where(*names.begin()), fmt::format("{} numbers", values.size()),
                                fmt::format("{}", count));
        }
        return values;
    }

    std::string where(const char* key) const { return path_.string() + ", header field " + key; }

  private:
    fs::path path_;
    std::map<std::string, std::string> values_;
};

}  // namespace

Result<RasterHeader> readMetaImageHeader(const fs::path& path) {
    const Result<std::string> text = readBeginning(path, kMaxHeader);
    if (!text) return text.error();
    RasterHeader header;
    header.format = "MetaImage";

    std::map<std::string, std::string> values;
    std::size_t at = 0;
    bool complete = false;
    while (!complete && at < text->size()) {
        const std::size_t end = text->find('\n', at);
        if (end == std::string::npos && text->size() == kMaxHeader) break;
        const std::string_view line = std::string_view(*text).substr(at, end == std::string::npos ? end : end - at);
        at = end == std::string::npos ? text->size() : end + 1;
        if (trimmed(line).empty()) continue;
        const std::size_t equals = line.find_first_of("=:");
        if (equals == std::string_view::npos) {
            return invalidInput(path.string() + ", header", shown(trimmed(line)), "lines of the form Key = value");
        }
        const std::string key(trimmed(line.substr(0, equals)));
        values[key] = std::string(trimmed(line.substr(equals + 1)));
        complete = key == "ElementDataFile";
    }
    if (!complete) {
        return invalidInput(path.string() + ", header", "no ElementDataFile", "a complete MetaImage header");
    }
    const Fields fields(path, std::move(values));

    if (const std::string* object = fields.find({"ObjectType"}); object && lower(*object) != "image") {
        return invalidInput(fields.where("ObjectType"), shown(*object), "Image");
    }
    const Result<std::vector<double>> dimensions = fields.numbers({"NDims"}, 1);
    if (!dimensions) return dimensions.error();
    if (dimensions->empty() || !((*dimensions)[0] == 2 || (*dimensions)[0] == 3)) {
        return invalidInput(fields.where("NDims"),
                            dimensions->empty() ? "nothing" : fmt::format("{}", (*dimensions)[0]), "2 or 3");
    }
    header.dimensions = static_cast<int>((*dimensions)[0]);
    const std::size_t n = static_cast<std::size_t>(header.dimensions);

    const std::string* sizes = fields.find({"DimSize"});
    const std::vector<std::string_view> size_words = sizes ? words(*sizes) : std::vector<std::string_view>();
    if (size_words.size() != n) {
        return invalidInput(fields.where("DimSize"), sizes ? shown(*sizes) : "nothing",
                            fmt::format("{} whole numbers", n));
    }
    for (std::size_t i = 0; i < n; ++i) {
        if (!parseInteger(size_words[i], header.size[i])) {
            return invalidInput(fields.where("DimSize"), shown(size_words[i]), "a whole number");
        }
    }

    const std::string* type = fields.find({"ElementType"});
    const TypeName* known = nullptr;
    for (const TypeName& candidate : kTypes) {
        if (type && *type == candidate.name) known = &candidate;
    }
    if (!known) {
        return invalidInput(fields.where("ElementType"), type ? shown(*type) : "nothing",
                            "a scalar type such as MET_SHORT or MET_FLOAT");
    }
    header.type = known->type;
    const Result<std::vector<double>> channels = fields.numbers({"ElementNumberOfChannels"}, 1);
    if (!channels) return channels.error();
    if (!channels->empty() && (*channels)[0] != 1) {
        return invalidInput(fields.where("ElementNumberOfChannels"), fmt::format("{}", (*channels)[0]), "1",
                            "convert it to one channel");
    }

    const Result<std::vector<double>> spacing = fields.numbers({"ElementSpacing", "ElementSize"}, n);
    if (!spacing) return spacing.error();
    header.has_spacing = !spacing->empty();
    const Result<std::vector<double>> origin = fields.numbers({"Offset", "Position", "Origin"}, n);
    if (!origin) return origin.error();
    const Result<std::vector<double>> matrix = fields.numbers({"TransformMatrix", "Rotation", "Orientation"}, n * n);
    if (!matrix) return matrix.error();
    for (std::size_t i = 0; i < n; ++i) {
        const auto row = static_cast<Eigen::Index>(i);
        if (!spacing->empty()) header.spacing_mm[row] = (*spacing)[i];
        if (!origin->empty()) header.origin_mm[row] = (*origin)[i];
        for (std::size_t j = 0; j < n && !matrix->empty(); ++j) {
            header.direction(static_cast<Eigen::Index>(j), row) = (*matrix)[i * n + j];
        }
    }

    const Result<bool> binary = fields.flag({"BinaryData"}, true);
    if (!binary) return binary.error();
    if (!*binary) return invalidInput(fields.where("BinaryData"), "False (numbers as text)", "True");
    const Result<bool> big = fields.flag({"BinaryDataByteOrderMSB", "ElementByteOrderMSB"}, false);
    if (!big) return big.error();
    header.big_endian = *big;
    const Result<bool> compressed = fields.flag({"CompressedData"}, false);
    if (!compressed) return compressed.error();
    header.compressed = *compressed;

    const std::string data = *fields.find({"ElementDataFile"});
    if (lower(data) == "local") {
        header.data_file = path;
        header.data_offset = at;
    } else if (data.empty() || data.starts_with("LIST") || data.find('%') != std::string::npos) {
        return invalidInput(fields.where("ElementDataFile"), shown(data), "LOCAL or the name of one file",
                            "save it as a single .mha file");
    } else {
        header.data_file = path.parent_path() / data;  // an absolute name replaces the folder
    }
    const Result<std::vector<double>> skip = fields.numbers({"HeaderSize"}, 1);
    if (!skip) return skip.error();
    if (!skip->empty() && (*skip)[0] != 0) {
        const Result<std::uint64_t> size = inputFileSize(header.data_file);
        if (!size) return invalidInput(fields.where("ElementDataFile"), size.error().found, "its data file");
        const double wanted = static_cast<double>(header.count()) * static_cast<double>(byteCount(header.type));
        // -1: the data are the file's last bytes
        const double offset = (*skip)[0] == -1 ? static_cast<double>(*size) - wanted : (*skip)[0];
        if (!(offset >= 0 && offset <= static_cast<double>(*size)) || header.data_file == path) {
            return invalidInput(fields.where("HeaderSize"), fmt::format("{}", (*skip)[0]),
                                "a number of bytes within the data file");
        }
        header.data_offset = static_cast<std::uint64_t>(offset);
    }
    return header;
}

Result<void> writeMetaImage(const fs::path& path, const RasterView& raster) {
    Result<std::string> data = encodeElements(path, *raster.values, raster.type);
    if (!data) return data.error();
    if (raster.compressed) data = deflated(*data, DeflateWrapper::zlib);
    const int n = raster.dimensions;
    std::string sizes, spacing, origin, matrix;
    for (int i = 0; i < n; ++i) {
        sizes += fmt::format(" {}", raster.size[static_cast<std::size_t>(i)]);
        spacing += fmt::format(" {}", raster.spacing_mm[i]);
        origin += fmt::format(" {}", raster.origin_mm[i]);
        for (int j = 0; j < n; ++j)
            matrix += fmt::format(" {}", raster.direction(j, i));
    }
    const char* type = nullptr;
    for (const TypeName& candidate : kTypes) {
        if (candidate.type == raster.type) type = candidate.name;
    }
    std::string text = fmt::format(
        "ObjectType = Image\nNDims = {}\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = {}\n", n,
        raster.compressed ? "True" : "False");
    if (raster.compressed) text += fmt::format("CompressedDataSize = {}\n", data->size());
    text += fmt::format(
        "TransformMatrix ={}\nOffset ={}\nElementSpacing ={}\nDimSize ={}\nElementType = {}\nElementDataFile = LOCAL\n",
        matrix, origin, spacing, sizes, type);
    return writeWhole(path, text + *data);
}

}  // namespace fluorocut
