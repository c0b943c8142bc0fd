// STL. Binary: 80 bytes of anything, the number of triangles, 50 bytes each (normal, three corners, two bytes).
// ASCII: solid ... facet normal, outer loop, three vertices, endloop, endfacet ... endsolid. Normals are not read: the
// corners' order says the same. A binary file may begin with "solid" too; the size decides.
#include <cstring>

#include <fmt/format.h>

#include "core/io/formats/mesh_formats.h"
#include "core/io/formats/raster.h"

namespace fluorocut {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kHeader = 84;
constexpr std::size_t kFacet = 50;

std::uint64_t declaredTriangles(std::string_view content) {
    std::uint32_t count = 0;
    std::memcpy(&count, content.data() + 80, 4);
    return count;
}

Result<RawMesh> parseBinary(const fs::path& path, std::string_view content) {
    const std::uint64_t count = declaredTriangles(content);
    const std::uint64_t held = (content.size() - kHeader) / kFacet;
    if (count > kMaxTriangles) return tooManyTriangles(path);
    if (count > held) {
        return invalidInput(path.string(), fmt::format("{} triangles declared, {} in the file", count, held),
                            "all of them", "the file is cut short or not an STL file; copy or export it again");
    }
    RawMesh raw;
    raw.format = "binary STL";
    if (content.size() != kHeader + count * kFacet) raw.notes.push_back("bytes after the last triangle were ignored");
    if (content.substr(0, 80).find("SPACE=RAS") != std::string_view::npos) {
        raw.notes.push_back("the header says SPACE=RAS: coordinates are as stored, not turned to DICOM's LPS");
    }
    raw.mesh.vertices.reserve(count * 3);
    raw.mesh.triangles.reserve(count);
    for (std::uint64_t i = 0; i < count; ++i) {
        float corners[9];
        std::memcpy(corners, content.data() + kHeader + i * kFacet + 12, sizeof corners);
        const auto first = static_cast<std::int32_t>(raw.mesh.vertices.size());
        for (int c = 0; c < 3; ++c)
            raw.mesh.vertices.emplace_back(corners[3 * c], corners[3 * c + 1], corners[3 * c + 2]);
        raw.mesh.triangles.push_back({first, first + 1, first + 2});
    }
    return raw;
}

Result<RawMesh> parseAscii(const fs::path& path, std::string_view content) {
    RawMesh raw;
    raw.format = "ASCII STL";
    Words text(content);
    const auto wrong = [&](std::string_view found, std::string_view expected) {
        return invalidInput(fmt::format("{}, line {}", path.string(), text.line()),
                            found.empty() ? "the end of the file" : shown(found), std::string(expected),
                            "the file is damaged; export it again");
    };
    bool ended = false;
    for (std::string_view word = text.next(); !word.empty(); word = text.next()) {
        const std::string key = lower(word);
        ended = ended || key == "endsolid";
        if (key != "facet") continue;  // "solid", its name, "endsolid"
        ended = false;
        for (const std::string_view expected : {"normal", "", "", "", "outer", "loop"}) {
            const std::string_view found = text.next();
            if (found.empty() || (!expected.empty() && lower(found) != expected)) return wrong(found, expected);
        }
        const auto first = static_cast<std::int32_t>(raw.mesh.vertices.size());
        for (int corner = 0; corner < 3; ++corner) {
            if (const std::string_view found = text.next(); lower(found) != "vertex") return wrong(found, "vertex");
            Vector3 point;
            for (int axis = 0; axis < 3; ++axis) {
                const std::string_view number = text.next();
                if (!parseNumber(number, point[axis])) return wrong(number, "a finite coordinate");
            }
            raw.mesh.vertices.push_back(point);
        }
        for (const std::string_view expected : {"endloop", "endfacet"}) {
            if (const std::string_view found = text.next(); lower(found) != expected) return wrong(found, expected);
        }
        raw.mesh.triangles.push_back({first, first + 1, first + 2});
        if (raw.mesh.triangles.size() > kMaxTriangles) return tooManyTriangles(path);
    }
    if (!ended) return wrong("", "endsolid");
    return raw;
}

}  // namespace

Result<RawMesh> parseStl(const fs::path& path, std::string_view content) {
    const bool solid = trimmed(content.substr(0, 80)).starts_with("solid");
    const bool exact = content.size() >= kHeader && content.size() == kHeader + declaredTriangles(content) * kFacet;
    if (solid && !exact) return parseAscii(path, content);
    if (content.size() < kHeader) {
        return invalidInput(path.string(), fmt::format("{} bytes", content.size()), "an STL file",
                            "the file is cut short or of another kind");
    }
    return parseBinary(path, content);
}

}  // namespace fluorocut
