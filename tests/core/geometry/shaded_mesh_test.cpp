#include "core/geometry/shaded_mesh.h"

#include <gtest/gtest.h>

#include "core/geometry/primitives.h"

namespace fluorocut {
namespace {

TEST(ShadedMesh, ASphereKeepsItsVerticesAndPointsOutward) {
    const TriangleMesh sphere = makeSphere(20, 4);
    const ShadedMesh shaded = shadedMesh(sphere);
    ASSERT_EQ(shaded.vertices.size(), sphere.vertices.size());
    ASSERT_EQ(shaded.normals.size(), shaded.vertices.size());
    EXPECT_EQ(shaded.triangles, sphere.triangles);
    for (std::size_t i = 0; i < shaded.vertices.size(); ++i) {
        // Triangles of 1.4 mm on a radius of 20 mm: 4 degrees apart, their mean far nearer.
        EXPECT_GT(shaded.normals[i].dot(shaded.vertices[i] / 20), std::cos(0.01));
    }
}

TEST(ShadedMesh, ABoxHasThreeNormalsAtEachCorner) {
    const ShadedMesh shaded = shadedMesh(makeBox({10, 20, 30}));
    EXPECT_EQ(shaded.vertices.size(), 24u);
    EXPECT_EQ(shaded.triangles.size(), 12u);
    for (const Triangle& triangle : shaded.triangles) {
        const auto at = [&](std::size_t i) { return static_cast<std::size_t>(triangle[i]); };
        const Vector3 flat = (shaded.vertices[at(1)] - shaded.vertices[at(0)])
                                 .cross(shaded.vertices[at(2)] - shaded.vertices[at(0)])
                                 .normalized();
        for (std::size_t i = 0; i < 3; ++i)
            EXPECT_NEAR((shaded.normals[at(i)] - flat).norm(), 0, 1e-12);
    }
}

TEST(ShadedMesh, TheCreaseAngleDecidesWhatIsAnEdge) {
    EXPECT_EQ(shadedMesh(makeBox({1, 1, 1}), radiansFromDegrees(91)).vertices.size(), 8u);
    EXPECT_EQ(shadedMesh(makeBox({1, 1, 1}), radiansFromDegrees(89)).vertices.size(), 24u);
}

TEST(ShadedMesh, ATriangleWithoutAreaIsKeptAndHarmless) {
    const TriangleMesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {2, 0, 0}}, {{0, 1, 2}, {0, 1, 3}}};
    const ShadedMesh shaded = shadedMesh(mesh);
    EXPECT_EQ(shaded.triangles.size(), 2u);
    EXPECT_EQ(shaded.normals[0], Vector3(0, 0, 1));
    EXPECT_EQ(shaded.normals[3], Vector3(0, 0, 0));
}

TEST(ShadedMesh, ACornerThatIsNoVertexThrows) {
    EXPECT_THROW((void)shadedMesh({{{0, 0, 0}}, {{0, 1, 2}}}), std::out_of_range);
}

TEST(FirstHit, IsTheNearerWallOfABox) {
    const ShadedMesh box = shadedMesh(makeBox({10, 20, 30}));
    EXPECT_NEAR(firstHit(box, {1, 2, 100}, {0, 0, -1}).value(), 85, 1e-12);
    EXPECT_NEAR(firstHit(box, {1, 2, 100}, {0, 0, -2}).value(), 42.5, 1e-12);
    EXPECT_NEAR(firstHit(box, {1, 2, 3}, {1, 0, 0}).value(), 4, 1e-12);  // from inside
    EXPECT_FALSE(firstHit(box, {1, 2, 100}, {0, 0, 1}));                 // behind
    EXPECT_FALSE(firstHit(box, {5.1, 2, 100}, {0, 0, -1}));              // beside
}

}  // namespace
}  // namespace fluorocut
