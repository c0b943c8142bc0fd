// Reading and writing closed surfaces: STL (binary and ASCII), OBJ, PLY (ASCII and binary). Millimetres, in the file's
// own frame. Only the shape is read: vertices and faces, polygons split into triangles, equal vertices welded.
//
// What a mesh must be, unless `require_solid` is turned off: finite, watertight and consistently turned (see
// core/geometry/mesh_properties.h), largest extent 1 mm to 5 m. A mesh that is inside out as a whole is turned, and
// MeshInfo::notes says so. One that looks like metres is named as such and refused rather than guessed.
//
// Every failure is one sentence with ErrorCode::invalidInput that names the path as given. Declared counts are checked
// against the file's size and against a limit (2^25 triangles) before memory is taken.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/mesh_properties.h"
#include "core/geometry/triangle_mesh.h"

namespace fluorocut {

enum class LengthUnit { mm, m };

struct MeshInfo {
    std::string format;         // "binary STL", "ASCII STL", "OBJ", "ASCII PLY", "binary PLY"
    MeshProperties properties;  // of the mesh handed out
    bool was_inside_out = false;
    std::vector<std::string> notes;  // what was done to the mesh, and warnings
};

struct MeshFile {
    TriangleMesh mesh;
    MeshInfo info;
};

struct MeshReadOptions {
    LengthUnit unit = LengthUnit::mm;
    // false: a mesh that is open, inside out or of an odd size is handed out as it is and described in the notes.
    bool require_solid = true;
};

Result<MeshFile> readMesh(const std::filesystem::path& path, const MeshReadOptions& options = {});

// Binary STL (.stl); coordinates are rounded to float.
Result<void> writeMesh(const std::filesystem::path& path, const TriangleMesh& mesh);

}  // namespace fluorocut
