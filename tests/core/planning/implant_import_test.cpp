#include "core/planning/implant_import.h"

#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/base/units.h"
#include "core/geometry/mesh_properties.h"
#include "core/geometry/mesh_tools.h"
#include "core/geometry/primitives.h"
#include "core/io/mesh_file.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;

Implant stem(const std::string& family, const std::string& size, Side side = Side::left) {
    Result<Implant> implant = loadImplant(family, {size, side});
    EXPECT_OK(implant);
    return std::move(*implant);
}

double degreesBetween(const Vector3& a, const Vector3& b) {
    return degreesFromRadians(std::acos(std::clamp(a.normalized().dot(b.normalized()), -1.0, 1.0)));
}

Rigid3 somewhere(Random& random) {
    return Rigid3(expRotation(2 * Vector3(random.normal(), random.normal(), random.normal())),
                  300 * Vector3(random.normal(), random.normal(), random.normal()));
}

TEST(ImplantImport, WhatIsGivenIsTaken) {
    Random random(5);
    const test::ScratchFolder scratch;
    for (const Side side : {Side::left, Side::right}) {
        const Implant original = stem("anatomic", "13", side);
        const Rigid3 mesh_from_cavity = somewhere(random);
        TriangleMesh moved = transformed(original.parts[0].mesh, mesh_from_cavity);
        for (Vector3& v : moved.vertices)
            v /= 1000;  // metres
        ASSERT_OK(writeMesh(scratch / "stem.stl", moved));
        const auto read = readMesh(scratch / "stem.stl", {LengthUnit::mm, false});
        ASSERT_OK(read);
        ImportOptions options;
        options.mm_per_unit = 1000;
        options.proximal = mesh_from_cavity.rotate({0, 0, 1});
        options.medial = mesh_from_cavity.rotate({1, 0, 0.5});
        options.reference = mesh_from_cavity * Vector3::Zero() / 1000;
        options.side = side;
        auto imported = importImplant(read->mesh, options, "stem.stl");
        ASSERT_OK(imported);
        EXPECT_TRUE(imported->guessed.empty());
        // STL holds single precision: 300 mm to 2e-5 mm.
        const auto expectSame = [&](const Implant& implant, const Implant& reference) {
            EXPECT_EQ(implant.side, reference.side);
            EXPECT_NEAR(implant.stem_length_mm, reference.stem_length_mm, 2e-4);
            const MeshProperties a = meshProperties(implant.in_bone), b = meshProperties(reference.in_bone);
            EXPECT_NEAR(a.volume_mm3, b.volume_mm3, 1e-4 * b.volume_mm3);
            EXPECT_LT((a.centroid - b.centroid).norm(), 1e-2);
            EXPECT_LT((a.min_corner - b.min_corner).norm(), 1e-3);
            EXPECT_LT((a.max_corner - b.max_corner).norm(), 1e-3);
        };
        expectSame(imported->implant, original);

        // Through its file, and as the other side.
        imported->description.mesh = scratch / "stem.stl";
        ASSERT_OK(writeMeshImplant(scratch / "stem.json", imported->description));
        const auto loaded = loadImplant((scratch / "stem.json").string());
        ASSERT_OK(loaded);
        expectSame(*loaded, original);
        const Side other = side == Side::left ? Side::right : Side::left;
        const auto turned = loadImplant((scratch / "stem.json").string(), {.side = other});
        ASSERT_OK(turned);
        expectSame(*turned, mirrored(original));
    }
}

// The guess of the axis: the flare moves the sections' middles by up to (proximal - distal) / 4 t^4, 0.25 mm within the
// 40 mm that are looked at: 0.3 degrees. Of the reference: steps of 0.5 mm over 2 mm.
TEST(ImplantImport, GuessesUnitAxisEndsAndReferenceOfTheLibrarysStems) {
    Random random(7);
    for (const auto& [family, size] :
         {std::pair("straight", "9"), std::pair("straight", "17"), std::pair("anatomic", "12"),
          std::pair("revision", "16x190"), std::pair("revision", "20x265")}) {
        for (const double per_mm : {1.0, 1e-3, 0.1}) {
            const Implant original = stem(family, size);
            const Rigid3 mesh_from_cavity = somewhere(random);
            TriangleMesh moved = transformed(original.parts[0].mesh, mesh_from_cavity);
            for (Vector3& v : moved.vertices)
                v *= per_mm;
            const auto imported = importImplant(moved, {}, "stem.stl");
            ASSERT_OK(imported);
            EXPECT_NEAR(imported->description.mm_per_unit, 1 / per_mm, 1e-9);
            const Rigid3 error = imported->description.cavity_from_mesh * mesh_from_cavity;  // identity if perfect
            EXPECT_LT(degreesBetween(error.rotate({0, 0, 1}), {0, 0, 1}), 0.5) << family << size;
            const Vector3 reference = error * Vector3::Zero();
            EXPECT_LT(reference.head<2>().norm(), 1) << family << size;
            EXPECT_NEAR(reference.z(), 0, 3) << family << size;
            // Medial: the anatomic stem's head leans forward by its 10 degrees of version, and back by its curve.
            EXPECT_LT(degreesBetween(error.rotate({1, 0, 0}), {1, 0, 0}), 15) << family << size;
            EXPECT_THAT(imported->guessed,
                        Contains(AllOf(HasSubstr("unit"), HasSubstr(per_mm == 0.1 ? "UNSURE" : "sure"))));
            EXPECT_THAT(imported->guessed, Contains(AllOf(HasSubstr("distal end"), HasSubstr("(sure)"))));
            EXPECT_THAT(imported->uncertain, Contains(HasSubstr("side")));
            EXPECT_TRUE(meshProperties(imported->implant.in_bone).closedManifold());
        }
    }
}

TEST(ImplantImport, AStemWithoutNeckIsTakenFromItsTop) {
    const auto imported = importImplant(makeStem());
    ASSERT_OK(imported);
    EXPECT_NEAR(imported->implant.stem_length_mm, StemShape{}.length_mm, 0.1);
    EXPECT_THAT(imported->uncertain, Contains(HasSubstr("no neck")));
    EXPECT_FALSE(imported->implant.head_center.allFinite());
}

TEST(ImplantImport, TurnsWhatIsInsideOutAndRefusesWhatIsNoStem) {
    const auto turned = importImplant(flipped(makeStem()));
    ASSERT_OK(turned);
    EXPECT_GT(meshProperties(turned->implant.parts[0].mesh).volume_mm3, 0);
    EXPECT_THAT(turned->guessed, Contains(HasSubstr("inside out")));

    TriangleMesh open = makeStem();
    open.triangles.resize(open.triangles.size() - 5);
    EXPECT_FALSE(importImplant(open).ok());
    EXPECT_THAT(importImplant(makeSphere(50, 3)).error().message(), HasSubstr("as long as wide"));
    EXPECT_THAT(importImplant(makeBox({1, 1, 20000})).error().message(), HasSubstr("give the unit"));
    EXPECT_THAT(importImplant(makeStem(), {.mm_per_unit = 25.4}).error().message(), HasSubstr("check the unit"));
}

}  // namespace
}  // namespace fluorocut
