// One reader per mesh format. They give back what the file holds, with valid vertex numbers; whether that is a solid is
// for readMesh to judge.
//
// These formats need so little (vertices and faces) that reading them is shorter than guarding a general importer
// against hostile files.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/triangle_mesh.h"

namespace fluorocut {

constexpr std::uint64_t kMaxTriangles = 1ull << 25;
constexpr std::uint64_t kMaxMeshBytes = 1ull << 32;

struct RawMesh {
    TriangleMesh mesh;
    std::string format;
    std::vector<std::string> notes;
};

Result<RawMesh> parseStl(const std::filesystem::path& path, std::string_view content);
Result<RawMesh> parseObj(const std::filesystem::path& path, std::string_view content);
Result<RawMesh> parsePly(const std::filesystem::path& path, std::string_view content);

// Splits a text at white space, counting lines for messages.
class Words {
  public:
    explicit Words(std::string_view text) : text_(text) {}
    std::string_view next();  // empty at the end
    int line() const { return line_; }

  private:
    std::string_view text_;
    std::size_t at_ = 0;
    int line_ = 1;
};

// A polygon as a fan of triangles.
void addPolygon(const std::vector<std::int32_t>& corners, TriangleMesh& mesh);

Error tooManyTriangles(const std::filesystem::path& path);

}  // namespace fluorocut
