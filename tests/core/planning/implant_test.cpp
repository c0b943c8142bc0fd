#include <algorithm>
#include <cmath>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/units.h"
#include "core/geometry/mesh_properties.h"
#include "core/geometry/mesh_section.h"
#include "core/io/mesh_file.h"
#include "core/io/resources.h"
#include "core/planning/implant_family.h"
#include "core/planning/implant_file.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using ::testing::HasSubstr;

ImplantFamily family(const std::string& name) {
    const auto path = findResource("implants", name);
    EXPECT_OK(path);
    const auto result = readImplantFamily(*path);
    EXPECT_OK(result);
    return *result;
}

Implant made(const ImplantFamily& of, const ImplantChoice& choice = {}) {
    Result<Implant> implant = makeImplant(of, choice);
    EXPECT_OK(implant);
    return std::move(*implant);
}

// Widths along x and y of the section at a level.
Vector2 widthsAt(const TriangleMesh& mesh, double z) {
    const auto half_edges = HalfEdgeMesh::build(mesh);
    EXPECT_OK(half_edges);
    const auto polygons = sectionPolygons(*half_edges, {{0, 0, z}, Vector3::UnitZ()});
    EXPECT_EQ(polygons.size(), 1U);
    Vector2 low(1e9, 1e9), high = -low;
    for (const Vector3& p : polygons.at(0)) {
        low = low.cwiseMin(p.head<2>());
        high = high.cwiseMax(p.head<2>());
    }
    return high - low;
}

TEST(ImplantLibrary, EveryEntryIsMadeInItsExtremeChoices) {
    const auto names = resourceNames("implants");
    EXPECT_THAT(names, ::testing::IsSupersetOf({"anatomic", "revision", "straight"}));
    for (const std::string& entry : names) {
        const ImplantFamily of = family(entry);
        EXPECT_EQ(of.name, entry);
        EXPECT_FALSE(of.basis.empty());
        for (const StemSize& size : {of.sizes.front(), of.sizes.back()}) {
            for (const double neck : {of.necks_mm.front(), of.necks_mm.back()}) {
                for (const double head : {of.heads_mm.front(), of.heads_mm.back()}) {
                    const Implant implant = made(of, {size.name, Side::right, head, neck});
                    ASSERT_EQ(implant.parts.size(), 2U);
                    for (const ImplantPart& part : implant.parts) {
                        const MeshProperties properties = meshProperties(part.mesh);
                        EXPECT_TRUE(properties.closedManifold()) << entry << size.name << part.name;
                        EXPECT_EQ(properties.components, 1U);
                        EXPECT_EQ(properties.degenerate_triangles, 0U);
                        EXPECT_GT(properties.volume_mm3, 5000);
                    }
                    EXPECT_TRUE(meshProperties(implant.in_bone).closedManifold());
                }
            }
        }
    }
}

TEST(ImplantLibrary, SizesGrowInEveryDimension) {
    for (const std::string name : {"straight", "anatomic"}) {
        const ImplantFamily of = family(name);
        for (std::size_t i = 1; i < of.sizes.size(); ++i) {
            EXPECT_NEAR((of.sizes[i].distal_mm - of.sizes[i - 1].distal_mm).x(), 1, 1e-9);
            EXPECT_GT(of.sizes[i].length_mm, of.sizes[i - 1].length_mm);
            EXPECT_GT(of.sizes[i].proximal_mm.x(), of.sizes[i - 1].proximal_mm.x());
            EXPECT_GT(of.sizes[i].offset_mm, of.sizes[i - 1].offset_mm);
        }
    }
}

TEST(Implant, HasTheDimensionsOfItsTable) {
    for (const std::string name : {"straight", "anatomic", "revision"}) {
        const ImplantFamily of = family(name);
        const StemSize& size = of.sizes[3];
        const Implant implant = made(of, {size.name, Side::left, 36, 0});
        EXPECT_EQ(implant.size, size.name);
        EXPECT_EQ(implant.stem_length_mm, size.length_mm);
        EXPECT_EQ(implant.resection_z_mm, 0);
        EXPECT_EQ(implant.head_radius_mm, 18);
        const MeshProperties bone = meshProperties(implant.in_bone);
        EXPECT_NEAR(bone.min_corner.z(), -size.length_mm, 1e-9);
        EXPECT_NEAR(bone.max_corner.z(), 0, 1e-9);
        const TriangleMesh& stem = implant.parts[0].mesh;
        // At the resection and just above the tip's rounding. A ring of the mesh lies within 1.5 mm of any level; the
        // widths change by 0.15 mm/mm there, and the polygon lies up to w (1 - cos(pi / 64)) / 2 = 0.02 mm inside.
        EXPECT_NEAR(widthsAt(stem, -1e-6).x(), size.proximal_mm.x(), 0.02);
        EXPECT_NEAR(widthsAt(stem, -1e-6).y(), size.proximal_mm.y(), 0.02);
        const double above = 0.75 * size.distal_mm.maxCoeff(), t = above / size.length_mm;
        const Vector2 growth = size.proximal_mm - size.distal_mm;
        const Vector2 distal = widthsAt(stem, above - size.length_mm);
        EXPECT_NEAR(distal.x(), size.distal_mm.x() + of.even_taper * growth.x() * t, 0.03);
        EXPECT_NEAR(distal.y(), size.distal_mm.y() + growth.y() * t, 0.03);

        // The head's centre: offset in the neck's plane, which the anteversion turns about the body's middle.
        const Vector3 head = implant.head_center - Vector3(0, -of.posterior_curve_mm, 0);
        EXPECT_NEAR(head.head<2>().norm(), size.offset_mm, 1e-9);
        EXPECT_NEAR(std::atan2(head.y(), head.x()), of.anteversion_rad, 1e-9);
        EXPECT_NEAR(head.z(), size.head_height_mm, 1e-9);
        // The sphere is where it should be: its pole lies a radius from the centre, no point lies farther but a skirt.
        double farthest = 0;
        for (const Vector3& v : implant.parts[1].mesh.vertices)
            farthest = std::max(farthest, (v - implant.head_center).norm());
        EXPECT_NEAR(farthest, 18, 1e-9);
    }
}

TEST(Implant, ANeckLengthMovesTheHeadAlongTheNeck) {
    for (const std::string name : {"straight", "anatomic"}) {
        const ImplantFamily of = family(name);
        const Implant zero = made(of, {"12", Side::left, 32, 0});
        for (const double neck : of.necks_mm) {
            const Implant other = made(of, {"12", Side::left, 32, neck});
            const Vector3 moved = other.head_center - zero.head_center;
            EXPECT_NEAR(moved.norm(), std::abs(neck), 1e-9);
            if (neck > 0) {  // the angle between neck and shaft (which runs down)
                EXPECT_NEAR(std::acos(-moved.normalized().z()), of.neck_shaft_angle_rad, 1e-9);
            }
            EXPECT_EQ(other.parts[0].mesh.vertices, zero.parts[0].mesh.vertices);  // the stem is the same
        }
    }
}

TEST(Implant, HeadAndTaperShareNoSpace) {
    // A place in the bore at the taper's wall: beyond the stem's surface and before the head's. Both meshes are turned
    // about the neck with the same corners, so the gap is 0.02 mm everywhere along the taper.
    const Implant implant = made(family("straight"), {"12", Side::left, 32, 4});
    const MeshProperties stem = meshProperties(implant.parts[0].mesh), head = meshProperties(implant.parts[1].mesh);
    const double sphere = 4.0 / 3 * M_PI * std::pow(16, 3);
    // What is missing of the sphere: the bore (7 mm wide, some 13 mm deep) and the flat's cap.
    EXPECT_LT(head.volume_mm3, sphere - 1500);
    EXPECT_GT(head.volume_mm3, sphere - 3500);
    EXPECT_GT(stem.volume_mm3, 0);
    // No vertex of the stem lies in the head's metal: those within the sphere stay inside the bore's radius.
    const Vector3 along = (made(family("straight"), {"12", Side::left, 32, 8}).head_center - implant.head_center) / 4;
    for (const Vector3& v : implant.parts[0].mesh.vertices) {
        const Vector3 from = v - implant.head_center;
        if (from.norm() > 16) continue;
        EXPECT_LT((from - from.dot(along) * along).norm(), 7.001);
    }
}

TEST(Implant, ARightStemIsTheMirrorImageOfTheLeft) {
    const ImplantFamily of = family("anatomic");
    const Implant left = made(of, {"13", Side::left, 32, 4}), right = made(of, {"13", Side::right, 32, 4});
    ASSERT_EQ(left.parts[0].mesh.vertices.size(), right.parts[0].mesh.vertices.size());
    double furthest = 0;
    for (std::size_t i = 0; i < left.parts[0].mesh.vertices.size(); ++i) {
        const Vector3 &l = left.parts[0].mesh.vertices[i], &r = right.parts[0].mesh.vertices[i];
        EXPECT_EQ(r, Vector3(l.x(), -l.y(), l.z()));
        furthest = std::max(furthest, std::abs(l.y()));
    }
    EXPECT_EQ(right.head_center, Vector3(left.head_center.x(), -left.head_center.y(), left.head_center.z()));
    EXPECT_GT(left.head_center.y(), 2);  // anteverted: a left stem's head lies in front
    EXPECT_EQ(right.side, Side::right);
    EXPECT_GT(meshProperties(right.in_bone).volume_mm3, 0);
    EXPECT_EQ(mirrored(right).parts[0].mesh.vertices, left.parts[0].mesh.vertices);
}

TEST(Implant, PartInBoneAndRestMakeTheWholeStem) {
    const Implant implant = made(family("revision"), {.size = "18x230"});
    const auto half_edges = HalfEdgeMesh::build(implant.parts[0].mesh);
    const auto above = partBelow(*half_edges, {Vector3::Zero(), {0, 0, -1}});
    ASSERT_OK(above);
    const double whole = meshProperties(implant.parts[0].mesh).volume_mm3;
    EXPECT_NEAR(meshProperties(implant.in_bone).volume_mm3 + meshProperties(*above).volume_mm3, whole, 1e-6 * whole);
    // A cone of round sections: V = pi L (r0^2 + r0 r1 + r1^2) / 3 without rounding of the tip and flutes, which take
    // some 3 %: 0.8 mm deep on average 0.4 mm of 10 mm radius over half of the length is 4 %, the tip 0.5 %.
    const StemSize size = family("revision").sizes[15];
    ASSERT_EQ(size.name, "18x230");
    const double r0 = 9, r1 = 0.25 * (size.proximal_mm.x() + size.proximal_mm.y());
    const double cone = M_PI * 230 * (r0 * r0 + r0 * r1 + r1 * r1) / 3;
    EXPECT_LT(meshProperties(implant.in_bone).volume_mm3, 1.02 * cone);  // sections are a little square: 2 % more
    EXPECT_GT(meshProperties(implant.in_bone).volume_mm3, 0.93 * cone);
}

TEST(Implant, TrianglesAreAsManyAsAskedForAndTheShapeConverges) {
    const ImplantFamily of = family("straight");
    const Implant coarse = made(of, {"12", Side::left, 32, 0, 6000}), fine = made(of, {"12", Side::left, 32, 0, 50000});
    EXPECT_NEAR(static_cast<double>(fine.parts[0].mesh.triangles.size()), 50000, 5000);
    EXPECT_NEAR(static_cast<double>(coarse.parts[0].mesh.triangles.size()), 6000, 600);
    const double a = meshProperties(coarse.parts[0].mesh).volume_mm3, b = meshProperties(fine.parts[0].mesh).volume_mm3;
    EXPECT_NEAR(a / b, 1, 0.006);
    EXPECT_LT(a, b);  // inscribed
}

// Where a surface folds over, neighbouring facets face away from each other. The sharpest edges there are: 90 degrees
// (the end of the taper).
TEST(Implant, TheNeckGrowsOutOfTheBodyWithoutFolds) {
    for (const std::string name : {"straight", "anatomic", "revision"}) {
        const ImplantFamily of = family(name);
        for (const StemSize& size : {of.sizes.front(), of.sizes.back()}) {
            const Implant implant = made(of, {size.name, Side::left, 32, 0, 50000});
            const auto mesh = HalfEdgeMesh::build(implant.parts[0].mesh);
            ASSERT_OK(mesh);
            double sharpest = 1;
            for (const HalfEdgeMesh::Edge& e : mesh->edges()) {
                const Vector3& a = mesh->faceNormals()[static_cast<std::size_t>(e.f0)];
                sharpest = std::min(sharpest, a.dot(mesh->faceNormals()[static_cast<std::size_t>(e.f1)]));
            }
            EXPECT_GT(sharpest, -0.1) << name << size.name;
        }
    }
}

TEST(Implant, RefusesWhatTheFamilyDoesNotOffer) {
    const ImplantFamily of = family("straight");
    EXPECT_THAT(makeImplant(of, {.size = "99"}).error().message(), HasSubstr("8, 9, 10"));
    EXPECT_THAT(makeImplant(of, {"12", Side::left, 30}).error().message(), HasSubstr("28, 32, 36"));
    EXPECT_THAT(makeImplant(of, {"12", Side::left, 32, 5}).error().message(), HasSubstr("-4, 0, 4, 8"));
    EXPECT_FALSE(makeImplant(of, {"12", Side::left, 32, 0, 10}).ok());
    ImplantFamily low = of;
    low.sizes[2].head_height_mm = 12;
    EXPECT_THAT(low.validate().error().message(), HasSubstr("head_height_mm"));
}

TEST(ImplantFile, NamesTheFieldThatIsWrong) {
    const test::ScratchFolder scratch;
    const auto path = findResource("implants", "straight");
    std::ifstream in(*path);
    const std::string good((std::istreambuf_iterator<char>(in)), {});
    const auto tried = [&](const std::string& from, const std::string& to) {
        std::string text = good;
        const auto at = text.find(from);
        EXPECT_NE(at, std::string::npos);
        text.replace(at, from.size(), to);
        std::ofstream(scratch / "family.json") << text;
        const auto result = readImplantFamily(scratch / "family.json");
        EXPECT_FALSE(result.ok());
        return result.ok() ? std::string() : result.error().message();
    };
    EXPECT_THAT(tried("\"titanium\"", "\"unobtainium\""), HasSubstr("materials"));
    EXPECT_THAT(tried("\"length_mm\": 115", "\"length_mm\": -115"), HasSubstr("length_mm"));
    EXPECT_THAT(tried("\"necks_mm\"", "\"neks_mm\""), HasSubstr("necks_mm"));
    EXPECT_THAT(tried("\"flare_power\"", "\"flares\": 1, \"flare_power\""), HasSubstr("flares"));
}

}  // namespace
}  // namespace fluorocut
