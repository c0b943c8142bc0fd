#include "core/fiducial/corkscrew_layout.h"

#include <cmath>
#include <functional>
#include <numbers>

#include <gmock/gmock.h>

#include "core/io/resources.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::ScratchFolder;
using testing::HasSubstr;

Result<CorkscrewLayout> shipped(const std::string& name) {
    const auto file = findResource("fiducials", name);
    if (!file) return file.error();
    return readCorkscrew(*file);
}

TEST(CorkscrewLayout, TheShippedOnesAreReadAndGoThereAndBack) {
    const ScratchFolder folder;
    for (const char* file : {"corkscrew", "corkscrew-paper"}) {
        const auto layout = shipped(file);
        ASSERT_OK(layout);
        EXPECT_EQ(layout->rings.size(), 4U);
        EXPECT_EQ(layout->helix.turns, 1.25);
        ASSERT_OK(writeCorkscrew(folder / file, *layout));
        const auto copy = readCorkscrew(folder / file);
        ASSERT_OK(copy);
        EXPECT_EQ(copy->rod_x_mm, layout->rod_x_mm);
        EXPECT_EQ(copy->shaft_x_mm, layout->shaft_x_mm);
        EXPECT_EQ(copy->rings[2].x_mm, layout->rings[2].x_mm);
        EXPECT_EQ(copy->helix.x_end_mm, layout->helix.x_end_mm);
        ASSERT_EQ(copy->beads.size(), layout->beads.size());
        for (std::size_t i = 0; i < copy->beads.size(); ++i)
            EXPECT_EQ(copy->beads[i].center_mm, layout->beads[i].center_mm);
        EXPECT_EQ(copy->wire, Material::copper);
    }
}

TEST(CorkscrewLayout, TheHelixIsTheDocumentedCurve) {
    CorkscrewHelix helix{-16, 16, 1.25, 9, 0.3, Handedness::right, 0.5};
    EXPECT_LT((helix.point(0) - Vector3(-16, 9 * std::cos(0.3), 9 * std::sin(0.3))).norm(), 1e-12);
    const double quarter = 0.3 + 2.5 * std::numbers::pi * 0.2;  // a quarter turn is a fifth of 5/4 turns
    EXPECT_LT((helix.point(0.2) - Vector3(-9.6, 9 * std::cos(quarter), 9 * std::sin(quarter))).norm(), 1e-12);
    // Right-handed: advancing along +x it turns from y to z.
    EXPECT_GT(Vector3(0, 1, 0).cross(helix.point(0.05) - helix.point(0)).x(), 0);
    helix.handedness = Handedness::left;
    EXPECT_LT(Vector3(0, 1, 0).cross(helix.point(0.05) - helix.point(0)).x(), 0);
    for (const double t : {0.0, 0.31, 1.0}) {
        const Vector3 difference = (helix.point(t + 1e-6) - helix.point(t - 1e-6)) / 2e-6;
        EXPECT_LT((difference.normalized() - helix.tangent(t)).norm(), 1e-8);
        EXPECT_NEAR(difference.norm(), helix.length_mm(), 1e-5);  // it is walked at even speed
    }
}

TEST(CorkscrewLayout, ARingsTangentIsItsDerivative) {
    const CorkscrewRing ring{5, 9, 0.5};
    const Vector3 difference = (ring.point(1 + 1e-6) - ring.point(1 - 1e-6)) / 2e-6;
    EXPECT_LT((difference.normalized() - ring.tangent(1)).norm(), 1e-8);
}

TEST(CorkscrewLayout, RefusesInWords) {
    const auto good = shipped("corkscrew-paper");
    ASSERT_OK(good);
    const auto message = [&](const std::function<void(CorkscrewLayout&)>& spoil) {
        CorkscrewLayout layout = *good;
        spoil(layout);
        const auto valid = layout.validate();
        return valid ? std::string("no error") : valid.error().message();
    };
    EXPECT_THAT(message([](auto& l) { l.rings.resize(1); }), HasSubstr("rings: found 1, expected 2 to 20"));
    EXPECT_THAT(message([](auto& l) { l.rings[1].x_mm = -33; }),
                HasSubstr("rings[1].x_mm: found -33, expected beyond"));
    EXPECT_THAT(message([](auto& l) { l.rings[1].x_mm = -21; }), HasSubstr("clear of the helix"));
    EXPECT_THAT(message([](auto& l) { l.rings[0].radius_mm = 11; }), HasSubstr("rings[0].radius_mm: found 11"));
    EXPECT_THAT(message([](auto& l) { l.rings[3].x_mm = 40; }), HasSubstr("rings[3].x: found 39.5 to 40.5 mm"));
    EXPECT_THAT(message([](auto& l) { l.helix.x_end_mm = -30; }), HasSubstr("helix.x_start_mm, x_end_mm: found"));
    EXPECT_THAT(message([](auto& l) {
                    l.beads.push_back({{0, 0, 0}, 1});
                }),
                HasSubstr("beads[0].center_mm: found 0 mm"));
    EXPECT_THAT(message([](auto& l) { l.shaft_x_mm = {5, 5}; }), HasSubstr("shaft_x_mm: found [5, 5]"));
    EXPECT_THAT(message([](auto& l) { l.rod_radius_mm = NAN; }), HasSubstr("rod_radius_mm: found nan"));
}

}  // namespace
}  // namespace fluorocut
