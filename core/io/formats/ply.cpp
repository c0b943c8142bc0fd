// PLY (Stanford): a text header that declares elements and their properties, then the elements as text or binary of
// either byte order. Read are x, y, z of "vertex" and the list of corners of "face"; every other property and element
// is passed over.
#include <algorithm>
#include <cstring>
#include <optional>

#include <fmt/format.h>

#include "core/io/formats/mesh_formats.h"
#include "core/io/formats/raster.h"

namespace fluorocut {

namespace fs = std::filesystem;

namespace {

std::optional<ElementType> typeFromName(std::string_view name) {
    if (name == "char" || name == "int8") return ElementType::int8;
    if (name == "uchar" || name == "uint8") return ElementType::uint8;
    if (name == "short" || name == "int16") return ElementType::int16;
    if (name == "ushort" || name == "uint16") return ElementType::uint16;
    if (name == "int" || name == "int32") return ElementType::int32;
    if (name == "uint" || name == "uint32") return ElementType::uint32;
    if (name == "float" || name == "float32") return ElementType::float32;
    if (name == "double" || name == "float64") return ElementType::float64;
    return std::nullopt;
}

struct Property {
    std::string name;
    ElementType type = ElementType::float32;
    std::optional<ElementType> count;  // of a list: the type of its length
};

struct Element {
    std::string name;
    std::uint64_t count = 0;
    std::vector<Property> properties;
};

enum class Encoding { ascii, little, big };

// Hands out one number after the other.
class Values {
  public:
    Values(std::string_view content, Encoding encoding) : content_(content), words_(content), encoding_(encoding) {}

    bool next(ElementType type, double& value) {
        if (encoding_ == Encoding::ascii) return parseNumber(words_.next(), value);
        const std::size_t bytes = byteCount(type);
        if (content_.size() < bytes) return false;
        char raw[8];
        std::memcpy(raw, content_.data(), bytes);
        content_.remove_prefix(bytes);
        if (encoding_ == Encoding::big) std::reverse(raw, raw + bytes);
        const auto as = [&](auto sample) {
            std::memcpy(&sample, raw, sizeof sample);
            value = static_cast<double>(sample);
        };
        switch (type) {
            case ElementType::int8:
                as(std::int8_t{});
                break;
            case ElementType::uint8:
                as(std::uint8_t{});
                break;
            case ElementType::int16:
                as(std::int16_t{});
                break;
            case ElementType::uint16:
                as(std::uint16_t{});
                break;
            case ElementType::int32:
                as(std::int32_t{});
                break;
            case ElementType::uint32:
                as(std::uint32_t{});
                break;
            case ElementType::float32:
                as(float{});
                break;
            default:
                as(double{});
        }
        return true;
    }

  private:
    std::string_view content_;
    Words words_;
    Encoding encoding_;
};

struct Header {
    Encoding encoding = Encoding::ascii;
    std::vector<Element> elements;
    std::size_t length = 0;
};

Result<Header> parseHeader(const fs::path& path, std::string_view content) {
    Header header;
    std::size_t at = 0;
    bool format = false;
    for (int line_number = 1;; ++line_number) {
        const std::size_t end = content.find('\n', at);
        if (end == std::string_view::npos || at > (1u << 16)) {
            return invalidInput(path.string() + ", header", "no end_header", "a complete PLY header");
        }
        const std::string_view line = trimmed(content.substr(at, end - at));
        at = end + 1;
        const auto wrong = [&](std::string expected) {
            return invalidInput(fmt::format("{}, header line {}", path.string(), line_number), shown(line),
                                std::move(expected));
        };
        const std::vector<std::string_view> parts = words(line);
        if (parts.empty() || parts[0] == "ply" || parts[0] == "comment" || parts[0] == "obj_info") continue;
        if (parts[0] == "end_header") break;
        if (parts[0] == "format" && parts.size() == 3) {
            format = true;
            if (parts[1] == "ascii") {
                header.encoding = Encoding::ascii;
            } else if (parts[1] == "binary_little_endian") {
                header.encoding = Encoding::little;
            } else if (parts[1] == "binary_big_endian") {
                header.encoding = Encoding::big;
            } else {
                return wrong("ascii, binary_little_endian or binary_big_endian");
            }
        } else if (parts[0] == "element" && parts.size() == 3) {
            std::int64_t count = 0;
            if (!parseInteger(parts[2], count) || count < 0) return wrong("element, name and number");
            header.elements.push_back({printable(parts[1]), static_cast<std::uint64_t>(count), {}});
        } else if (parts[0] == "property" && !header.elements.empty() && (parts.size() == 3 || parts.size() == 5)) {
            Property property;
            const bool list = parts.size() == 5 && parts[1] == "list";
            const auto type = typeFromName(parts[list ? 3 : 1]);
            if (list) property.count = typeFromName(parts[2]);
            if (!type || (parts.size() == 5 && !property.count)) return wrong("property, type and name");
            property.type = *type;
            property.name = printable(parts.back());
            header.elements.back().properties.push_back(property);
        } else {
            return wrong("format, element or property");
        }
    }
    if (!format) return invalidInput(path.string() + ", header", "no format", "format ascii or binary");
    header.length = at;
    return header;
}

// The least that one element takes in the file: a lying count is refused before memory is taken for it.
std::uint64_t leastBytes(const Element& element, Encoding encoding) {
    std::uint64_t bytes = 0;
    for (const Property& property : element.properties) {
        bytes += encoding == Encoding::ascii ? 2 : byteCount(property.count.value_or(property.type));
    }
    return std::max<std::uint64_t>(bytes, 1);
}

}  // namespace

Result<RawMesh> parsePly(const fs::path& path, std::string_view content) {
    const Result<Header> header = parseHeader(path, content);
    if (!header) return header.error();
    RawMesh raw;
    raw.format = header->encoding == Encoding::ascii ? "ASCII PLY" : "binary PLY";
    Values values(content.substr(header->length), header->encoding);
    bool polygons = false;
    std::vector<std::int32_t> corners;
    for (const Element& element : header->elements) {
        const std::string what = fmt::format("{}, {} elements of {}", path.string(), element.count, element.name);
        // + 1: the last number of a text needs no blank after it
        if (element.count > (content.size() - header->length + 1) / leastBytes(element, header->encoding)) {
            return invalidInput(what, fmt::format("{} bytes of data", content.size() - header->length), "all of them",
                                "the file is cut short or its header is wrong");
        }
        const bool is_vertex = element.name == "vertex", is_face = element.name == "face";
        if (is_vertex && !raw.mesh.vertices.empty()) return invalidInput(what, "vertices twice", "one vertex element");
        int axes = 0, lists = 0;
        for (const Property& property : element.properties) {
            axes += !property.count && (property.name == "x" || property.name == "y" || property.name == "z");
            lists += property.count && (property.name == "vertex_indices" || property.name == "vertex_index");
        }
        if (is_vertex && axes != 3) return invalidInput(what, "no x, y, z", "the properties x, y and z");
        if (is_face && lists != 1) return invalidInput(what, "no list of corners", "the property list vertex_indices");
        for (std::uint64_t i = 0; i < element.count; ++i) {
            const auto wrong = [&](std::string found, std::string expected) {
                return invalidInput(fmt::format("{}, {} {}", path.string(), element.name, i), std::move(found),
                                    std::move(expected), "the file is damaged; export it again");
            };
            Vector3 point = Vector3::Zero();
            for (const Property& property : element.properties) {
                double value = 0;
                if (!values.next(property.count.value_or(property.type), value)) {
                    return wrong("the end of the file or no number", property.name);
                }
                if (is_vertex && property.name == "x") point.x() = value;
                if (is_vertex && property.name == "y") point.y() = value;
                if (is_vertex && property.name == "z") point.z() = value;
                if (!property.count) continue;
                const bool wanted = is_face && (property.name == "vertex_indices" || property.name == "vertex_index");
                if (!(value >= (wanted ? 3 : 0) && value <= 4096 && value == static_cast<int>(value))) {
                    return wrong(fmt::format("a list of {}", value), "3 to 4096 corners");
                }
                corners.clear();
                for (int c = 0; c < static_cast<int>(value); ++c) {
                    double index = 0;
                    if (!values.next(property.type, index)) return wrong("the end of the file or no number", "a list");
                    if (!wanted) continue;
                    if (!(index >= 0 && index < static_cast<double>(raw.mesh.vertices.size()) &&
                          index == static_cast<std::int32_t>(index))) {
                        return wrong(fmt::format("the vertex number {}", index),
                                     fmt::format("0 to {}", raw.mesh.vertices.size()));
                    }
                    corners.push_back(static_cast<std::int32_t>(index));
                }
                if (!wanted) continue;
                polygons = polygons || corners.size() > 3;
                addPolygon(corners, raw.mesh);
                if (raw.mesh.triangles.size() > kMaxTriangles) return tooManyTriangles(path);
            }
            if (is_vertex) raw.mesh.vertices.push_back(point);
        }
    }
    if (polygons) raw.notes.push_back("polygons were split into triangles");
    return raw;
}

}  // namespace fluorocut
