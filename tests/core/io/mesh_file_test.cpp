#include "core/io/mesh_file.h"

#include <cstring>
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

#include "core/geometry/mesh_tools.h"
#include "core/geometry/primitives.h"
#include "tests/core/io/test_files.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using test::put;
using ::testing::HasSubstr;

std::string asciiStl(const TriangleMesh& mesh) {
    std::ostringstream text;
    text.precision(9);
    text << "solid made by a test\n";
    for (const Triangle& t : mesh.triangles) {
        text << "  facet normal 0 0 0\n    outer loop\n";
        for (const std::int32_t v : t) {
            text << "      vertex " << mesh.vertices[static_cast<std::size_t>(v)].transpose() << "\n";
        }
        text << "    endloop\n  endfacet\n";
    }
    text << "endsolid\n";
    return text.str();
}

std::string objText(const TriangleMesh& mesh, bool backwards) {
    std::ostringstream text;
    text.precision(17);
    text << "# a test\nmtllib none.mtl\no thing\n";
    for (const Vector3& v : mesh.vertices)
        text << "v " << v.transpose() << "\nvn 0 0 1\n";
    for (const Triangle& t : mesh.triangles) {
        text << "f";
        for (const std::int32_t v : t) {
            const int shift = backwards ? -static_cast<int>(mesh.vertices.size()) : 1;
            text << " " << v + shift << (backwards ? "//1" : "");
        }
        text << "\n";
    }
    return text.str();
}

template <class T>
void append(std::string& bytes, T value, bool big) {
    char raw[sizeof(T)];
    std::memcpy(raw, &value, sizeof(T));
    if (big) std::reverse(raw, raw + sizeof(T));
    bytes.append(raw, sizeof(T));
}

std::string ply(const TriangleMesh& mesh, const std::string& format) {
    std::ostringstream header;
    header << "ply\nformat " << format << " 1.0\ncomment a test\nelement vertex " << mesh.vertices.size()
           << "\nproperty double x\nproperty double y\nproperty double z\nproperty uchar red\nelement face "
           << mesh.triangles.size() << "\nproperty float quality\nproperty list uchar int vertex_indices\nend_header\n";
    std::string content = header.str();
    if (format == "ascii") {
        std::ostringstream text;
        text.precision(17);
        for (const Vector3& v : mesh.vertices)
            text << v.transpose() << " 255\n";
        for (const Triangle& t : mesh.triangles)
            text << "0.5 3 " << t[0] << " " << t[1] << " " << t[2] << "\n";
        return content + text.str();
    }
    const bool big = format == "binary_big_endian";
    for (const Vector3& v : mesh.vertices) {
        for (int axis = 0; axis < 3; ++axis)
            append(content, v[axis], big);
        append(content, std::uint8_t{255}, big);
    }
    for (const Triangle& t : mesh.triangles) {
        append(content, 0.5f, big);
        append(content, std::uint8_t{3}, big);
        for (const std::int32_t v : t)
            append(content, v, big);
    }
    return content;
}

TEST(MeshFileTest, EveryFormatGivesTheSameSolid) {
    const test::ScratchFolder scratch;
    const TriangleMesh mesh = makeEllipsoid({30, 20, 10}, 3);
    const MeshProperties expected = meshProperties(mesh);
    ASSERT_OK(writeMesh(scratch / "binary.stl", mesh));
    put(scratch / "ascii.stl", asciiStl(mesh));
    put(scratch / "a.obj", objText(mesh, false));
    put(scratch / "backwards.obj", objText(mesh, true));
    put(scratch / "a.ply", ply(mesh, "ascii"));
    put(scratch / "little.ply", ply(mesh, "binary_little_endian"));
    put(scratch / "big.ply", ply(mesh, "binary_big_endian"));
    for (const auto& [name, format] : std::vector<std::pair<std::string, std::string>>{{"binary.stl", "binary STL"},
                                                                                       {"ascii.stl", "ASCII STL"},
                                                                                       {"a.obj", "OBJ"},
                                                                                       {"backwards.obj", "OBJ"},
                                                                                       {"a.ply", "ASCII PLY"},
                                                                                       {"little.ply", "binary PLY"},
                                                                                       {"big.ply", "binary PLY"}}) {
        const Result<MeshFile> file = readMesh(scratch / name);
        ASSERT_OK(file);
        EXPECT_EQ(file->info.format, format);
        EXPECT_TRUE(file->info.properties.closedManifold()) << name;
        EXPECT_EQ(file->mesh.vertices.size(), mesh.vertices.size()) << name;
        EXPECT_EQ(file->mesh.triangles.size(), mesh.triangles.size()) << name;
        // floats of up to 30 mm: 2e-6 mm per coordinate, 1e-7 of the volume
        EXPECT_NEAR(file->info.properties.volume_mm3, expected.volume_mm3, 1e-6 * expected.volume_mm3) << name;
        EXPECT_TRUE(file->info.notes.empty()) << file->info.notes.front();
    }
}

TEST(MeshFileTest, PolygonsBecomeTriangles) {
    const test::ScratchFolder scratch;
    put(scratch / "cube.obj",
        "v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\nv 0 0 10\nv 10 0 10\nv 10 10 10\nv 0 10 10\n"
        "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
    const Result<MeshFile> file = readMesh(scratch / "cube.obj");
    ASSERT_OK(file);
    EXPECT_EQ(file->mesh.triangles.size(), 12u);
    EXPECT_NEAR(file->info.properties.volume_mm3, 1000, 1e-9);
}

TEST(MeshFileTest, TurnsAMeshThatIsInsideOut) {
    const test::ScratchFolder scratch;
    ASSERT_OK(writeMesh(scratch / "a.stl", flipped(makeBox({10, 20, 30}))));
    const Result<MeshFile> file = readMesh(scratch / "a.stl");
    ASSERT_OK(file);
    EXPECT_NEAR(file->info.properties.volume_mm3, 6000, 1e-9);
    EXPECT_TRUE(file->info.was_inside_out);
    EXPECT_THAT(file->info.notes, testing::ElementsAre(HasSubstr("inside out")));
}

TEST(MeshFileTest, NamesMetres) {
    const test::ScratchFolder scratch;
    ASSERT_OK(writeMesh(scratch / "m.stl", makeBox({0.04, 0.05, 0.182})));
    const Result<MeshFile> refused = readMesh(scratch / "m.stl");
    ASSERT_FALSE(refused.ok());
    EXPECT_THAT(refused.error().message(), HasSubstr("0.182"));
    EXPECT_THAT(refused.error().message(), HasSubstr("looks like metres; pass --mesh-unit m"));
    const Result<MeshFile> read = readMesh(scratch / "m.stl", {LengthUnit::m});
    ASSERT_OK(read);
    EXPECT_NEAR(read->info.properties.volume_mm3, 40 * 50 * 182, 1);

    ASSERT_OK(writeMesh(scratch / "mm.stl", makeBox({40, 50, 182})));
    const Result<MeshFile> kilometres = readMesh(scratch / "mm.stl", {LengthUnit::m});
    ASSERT_FALSE(kilometres.ok());
    EXPECT_THAT(kilometres.error().message(), HasSubstr("looks like millimetres"));
    ASSERT_OK(writeMesh(scratch / "huge.stl", makeBox({40, 50, 5001})));
    EXPECT_FALSE(readMesh(scratch / "huge.stl").ok());
    ASSERT_OK(writeMesh(scratch / "tiny.stl", makeBox({0.001, 0.002, 0.003})));
    EXPECT_FALSE(readMesh(scratch / "tiny.stl").ok());
}

TEST(MeshFileTest, RefusesAnOpenMeshAndCanDescribeIt) {
    const test::ScratchFolder scratch;
    TriangleMesh open = makeBox({10, 20, 30});
    open.triangles.pop_back();
    ASSERT_OK(writeMesh(scratch / "open.stl", open));
    const Result<MeshFile> refused = readMesh(scratch / "open.stl");
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::invalidInput);
    EXPECT_THAT(refused.error().message(), HasSubstr("open.stl"));
    const Result<MeshFile> described = readMesh(scratch / "open.stl", {LengthUnit::mm, false});
    ASSERT_OK(described);
    EXPECT_EQ(described->info.properties.boundary_edges, 3u);
    EXPECT_EQ(described->info.notes.size(), 1u);

    TriangleMesh turned = makeBox({10, 20, 30});
    std::swap(turned.triangles[3][0], turned.triangles[3][1]);
    ASSERT_OK(writeMesh(scratch / "turned.stl", turned));
    EXPECT_FALSE(readMesh(scratch / "turned.stl").ok());
}

TEST(MeshFileTest, ReadsRealBones) {
    SKIP_WITHOUT_SHARED_DATA();
    for (const char* name : {"mesh/m3_lfemur_mm.stl", "mesh/m4_rfemur_mm.stl"}) {
        const Result<MeshFile> file = readMesh(test::sharedData() / name);
        ASSERT_OK(file);
        EXPECT_TRUE(file->info.properties.closedManifold());
        EXPECT_GT(file->info.properties.triangles, 70000u);
        // a proximal femur: 100 to 400 mm long, 50 to 500 ml
        EXPECT_GT(file->info.properties.volume_mm3, 5e4);
        EXPECT_LT(file->info.properties.volume_mm3, 5e5);
    }
}

TEST(MeshFileTest, LyingCountsAndBrokenTextAreRefusedInWords) {
    const test::ScratchFolder scratch;
    const auto message = [&](const std::string& name, const std::string& content) {
        put(scratch / name, content);
        const Result<MeshFile> file = readMesh(scratch / name);
        EXPECT_FALSE(file.ok()) << content.substr(0, 80);
        if (file.ok()) return std::string();
        EXPECT_EQ(file.error().code, ErrorCode::invalidInput);
        EXPECT_THAT(file.error().message(), HasSubstr((scratch / name).string()));
        return file.error().message();
    };
    std::string lying(84 + 50, '\0');
    std::memset(lying.data() + 80, 0xff, 4);
    EXPECT_THAT(message("a.stl", lying), HasSubstr("triangles"));
    lying[80] = 2, lying[81] = lying[82] = lying[83] = 0;
    EXPECT_THAT(message("a.stl", lying), HasSubstr("2 triangles declared, 1 in the file"));
    EXPECT_THAT(message("a.stl", std::string(84, '\0')), HasSubstr("no triangles"));
    EXPECT_THAT(message("a.stl", "solid x\nfacet normal 0 0 1 outer loop vertex 0 0 nan"), HasSubstr("line 2"));
    EXPECT_THAT(message("a.stl", "solid x\n"), HasSubstr("endsolid"));
    EXPECT_THAT(message("a.stl", "short"), HasSubstr("5 bytes"));
    EXPECT_THAT(message("a.stl", ""), HasSubstr("empty"));
    EXPECT_THAT(message("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n"), HasSubstr("line 4"));
    EXPECT_THAT(message("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -9223372036854775808\n"), HasSubstr("line 4"));
    EXPECT_THAT(message("a.obj", "v 0 0 1e400\n"), HasSubstr("finite"));
    EXPECT_THAT(message("a.obj", "f 1 2\n"), HasSubstr("line 1"));
    const std::string header =
        "ply\nformat ascii 1.0\nelement vertex 99999999999\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n0 0 0\n";
    EXPECT_THAT(message("a.ply", header), HasSubstr("bytes of data"));
    EXPECT_THAT(message("a.ply", "ply\nformat ascii 1.0\n"), HasSubstr("end_header"));
    EXPECT_THAT(message("a.ply", "ply\nformat ascii 1.0\nelement vertex -1\nend_header\n"), HasSubstr("line 3"));
    std::string face = ply(makeBox({10, 10, 10}), "ascii");
    face[face.rfind("\n0.5 3 ") + 7] = '9';
    EXPECT_THAT(message("a.ply", face), HasSubstr("vertex number"));
}

}  // namespace
}  // namespace fluorocut
