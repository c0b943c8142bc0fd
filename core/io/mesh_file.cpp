#include "core/io/mesh_file.h"

#include <cmath>
#include <cstring>

#include <fmt/format.h>

#include "core/geometry/mesh_tools.h"
#include "core/io/atomic_file.h"
#include "core/io/file_format.h"
#include "core/io/formats/byte_reader.h"
#include "core/io/formats/mesh_formats.h"
#include "core/io/formats/raster.h"

namespace fluorocut {

namespace fs = std::filesystem;

std::string_view Words::next() {
    const auto blank = [](char c) { return c == ' ' || (c >= '\t' && c <= '\r'); };
    while (at_ < text_.size() && blank(text_[at_]))
        line_ += text_[at_++] == '\n';
    const std::size_t begin = at_;
    while (at_ < text_.size() && !blank(text_[at_]))
        ++at_;
    return text_.substr(begin, at_ - begin);
}

void addPolygon(const std::vector<std::int32_t>& corners, TriangleMesh& mesh) {
    for (std::size_t i = 2; i < corners.size(); ++i)
        mesh.triangles.push_back({corners[0], corners[i - 1], corners[i]});
}

Error tooManyTriangles(const fs::path& path) {
    return invalidInput(path.string(), "more triangles than that", fmt::format("at most {} triangles", kMaxTriangles),
                        "simplify the mesh");
}

namespace {

constexpr double kLeastExtent_mm = 1;
constexpr double kMostExtent_mm = 5000;

// The largest extent as the file has it, and what is odd about it.
Result<void> checkExtent(const fs::path& path, double extent_mm, LengthUnit unit) {
    const double stated = unit == LengthUnit::m ? extent_mm / 1000 : extent_mm;
    const std::string found = fmt::format("a largest extent of {:.4g}", stated);
    if (unit == LengthUnit::mm && extent_mm >= 0.02 && extent_mm < kLeastExtent_mm) {
        return invalidInput(path.string(), found, "1 to 5000 mm", "this looks like metres; pass --mesh-unit m");
    }
    if (unit == LengthUnit::m && extent_mm > kMostExtent_mm) {
        return invalidInput(path.string(), found, "at most 5 m",
                            "this looks like millimetres; leave out --mesh-unit m");
    }
    if (!(extent_mm >= kLeastExtent_mm && extent_mm <= kMostExtent_mm)) {
        return invalidInput(path.string(), found + (unit == LengthUnit::m ? " m" : " mm"), "1 mm to 5 m",
                            "export it in millimetres");
    }
    return {};
}

Result<RawMesh> parse(const fs::path& path) {
    const Result<FileFormat> format = detectFormat(path);
    if (!format) return format.error();
    if (*format != FileFormat::stl && *format != FileFormat::obj && *format != FileFormat::ply) {
        return invalidInput(
            path.string(),
            *format == FileFormat::unknown ? std::string("content of no known format") : std::string(name(*format)),
            "a mesh (STL, OBJ or PLY)");
    }
    const Result<std::string> content = readWholeFile(path, kMaxMeshBytes);
    if (!content) return content.error();
    if (*format == FileFormat::stl) return parseStl(path, *content);
    return *format == FileFormat::obj ? parseObj(path, *content) : parsePly(path, *content);
}

}  // namespace

Result<MeshFile> readMesh(const fs::path& path, const MeshReadOptions& options) {
    Result<RawMesh> raw = withinMemory(path, [&] { return parse(path); });
    if (!raw) return raw.error();
    if (raw->mesh.triangles.empty()) return invalidInput(path.string(), "no triangles", "a surface");
    const double scale = options.unit == LengthUnit::m ? 1000 : 1;
    for (std::size_t i = 0; i < raw->mesh.vertices.size(); ++i) {
        Vector3& vertex = raw->mesh.vertices[i];
        if (!vertex.allFinite()) {
            return invalidInput(fmt::format("{}, vertex {}", path.string(), i), "a coordinate that is not finite",
                                "finite coordinates", "export it again");
        }
        vertex *= scale;
        if (!(vertex.cwiseAbs().maxCoeff() <= 1e6)) {
            return invalidInput(fmt::format("{}, vertex {}", path.string(), i),
                                fmt::format("a coordinate of {:.4g} mm", vertex.cwiseAbs().maxCoeff()),
                                "coordinates within 1000 m");
        }
    }
    MeshFile file;
    file.info.format = raw->format;
    file.info.notes = std::move(raw->notes);
    file.mesh = weldVertices(raw->mesh);
    const std::size_t lost = raw->mesh.triangles.size() - file.mesh.triangles.size();
    if (lost > 0) file.info.notes.push_back(fmt::format("{} triangles with two equal corners were left out", lost));
    if (file.mesh.triangles.empty()) return invalidInput(path.string(), "no triangle with an area", "a surface");
    file.info.properties = meshProperties(file.mesh);

    const MeshProperties& properties = file.info.properties;
    const double extent = (properties.max_corner - properties.min_corner).maxCoeff();
    if (Result<void> sane = checkExtent(path, extent, options.unit); !sane) {
        if (options.require_solid) return sane.error();
        file.info.notes.push_back(sane.error().message());
    }
    file.info.was_inside_out = properties.watertight() && properties.volume_mm3 < 0;
    if (file.info.was_inside_out && options.require_solid) {
        file.mesh = flipped(std::move(file.mesh));
        file.info.properties = meshProperties(file.mesh);
        file.info.notes.push_back("the mesh was inside out: its triangles were turned");
    }
    if (Result<void> solid = requireSolid(file.info.properties, path.string()); !solid) {
        if (options.require_solid) {
            Error error = solid.error();
            error.code = ErrorCode::invalidInput;
            return error;
        }
        file.info.notes.push_back(solid.error().message());
    }
    return file;
}

Result<void> writeMesh(const fs::path& path, const TriangleMesh& mesh) {
    if (lower(path.extension().string()) != ".stl") {
        return invalidOption(path.string(), "the extension " + shown(path.extension().string()), ".stl");
    }
    if (mesh.triangles.size() > kMaxTriangles) {
        return invalidOption(path.string(), fmt::format("{} triangles", mesh.triangles.size()),
                             fmt::format("at most {}", kMaxTriangles));
    }
    std::string bytes(84, '\0');
    // "UNITS=mm" is understood by some readers and harms none; the header must not begin with "solid"
    constexpr std::string_view kHeader = "FluoroCut binary STL UNITS=mm";
    std::memcpy(bytes.data(), kHeader.data(), kHeader.size());
    const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
    std::memcpy(bytes.data() + 80, &count, 4);
    bytes.reserve(84 + 50 * mesh.triangles.size());
    for (const Triangle& triangle : mesh.triangles) {
        const Vector3 corner[3] = {mesh.vertices.at(static_cast<std::size_t>(triangle[0])),
                                   mesh.vertices.at(static_cast<std::size_t>(triangle[1])),
                                   mesh.vertices.at(static_cast<std::size_t>(triangle[2]))};
        const Vector3 normal = (corner[1] - corner[0]).cross(corner[2] - corner[0]).normalized();
        float facet[12];
        for (int axis = 0; axis < 3; ++axis) {
            facet[axis] = static_cast<float>(normal[axis]);
            for (int c = 0; c < 3; ++c)
                facet[3 + 3 * c + axis] = static_cast<float>(corner[c][axis]);
        }
        bytes.append(reinterpret_cast<const char*>(facet), sizeof facet);
        bytes.append(2, '\0');
    }
    return writeWhole(path, bytes);
}

}  // namespace fluorocut
