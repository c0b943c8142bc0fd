#include "core/fabrication/bead_sheets.h"

#include <array>
#include <cmath>
#include <numbers>

#include <gmock/gmock.h>

#include "core/fabrication/plate_drawing.h"
#include "core/geometry/mesh_properties.h"
#include "core/geometry/polygon.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using testing::HasSubstr;

BeadLayout twoPlanes(int per_side, double spacing_mm) {
    BeadLayout layout;
    for (const double z : {-40.0, 40.0})
        for (int j = 0; j < per_side; ++j)
            for (int i = 0; i < per_side; ++i)
                layout.beads.push_back({"bead " + std::to_string(layout.beads.size() + 1),
                                        {i * spacing_mm + 0.1 * j + (z > 0 ? 3 : 0), j * spacing_mm, z},
                                        z > 0 ? 2.0 : 3.0});
    return layout;
}

// Box less holes, whose prisms have the circles' areas.
double closedForm(const BeadSheet& sheet) {
    const Vector2 size = sheet.high - sheet.low;
    double volume = size.prod() * sheet.thickness_mm;
    const auto circle = [](double diameter) { return 0.25 * std::numbers::pi * diameter * diameter; };
    for (const Bead& bead : sheet.beads)
        volume -= circle(bead.diameter_mm + kHoleFitMm) * (0.5 * sheet.thickness_mm + 0.5 * bead.diameter_mm);
    return volume - static_cast<double>(sheet.posts.size()) * circle(kPostHoleMm) * sheet.thickness_mm;
}

TEST(BeadSheets, OneForEachPlaneWithTheBeadsInItsMiddle) {
    const auto sheets = beadSheets(twoPlanes(5, 20));
    ASSERT_OK(sheets);
    ASSERT_EQ(sheets->size(), 2u);
    EXPECT_EQ((*sheets)[0].plane_mm, -40);
    EXPECT_EQ((*sheets)[1].plane_mm, 40);
    for (const BeadSheet& sheet : *sheets) {
        EXPECT_EQ(sheet.beads.size(), 25u);
        EXPECT_EQ(sheet.low, (*sheets)[0].low);  // edges flush
        for (const Bead& bead : sheet.beads) {
            // Bottom of the hole: where the bead, its centre in the plane, ends.
            const double floor = sheet.plane_mm + 0.5 * sheet.thickness_mm - sheet.holeDepth(bead);
            EXPECT_NEAR(floor, bead.center_mm.z() - 0.5 * bead.diameter_mm, 1e-12);
            EXPECT_GT(floor - (sheet.plane_mm - 0.5 * sheet.thickness_mm), 1);  // it is a blind hole
            for (const Vector2& post : sheet.posts)
                EXPECT_GT((post - bead.center_mm.head<2>()).norm(), 8);
        }
    }
}

TEST(BeadSheets, AreSolidsOfTheirDrawingsVolume) {
    for (const auto& [per_side, spacing] :
         {std::pair(1, 20.0), std::pair(2, 9.0), std::pair(5, 20.0), std::pair(9, 7.0)}) {
        const auto sheets = beadSheets(twoPlanes(per_side, spacing));
        ASSERT_OK(sheets);
        for (const BeadSheet& sheet : *sheets) {
            const auto solid = sheetSolid(sheet);
            ASSERT_OK(solid);
            const MeshProperties properties = meshProperties(*solid);
            EXPECT_OK(requireSolid(properties, "sheet"));
            EXPECT_TRUE(properties.closedManifold());
            EXPECT_EQ(properties.components, 1u);
            EXPECT_NEAR(properties.volume_mm3, closedForm(sheet), 1e-9 * closedForm(sheet));
        }
    }
}

TEST(BeadSheets, RefuseWhatNoSheetCanHold) {
    BeadLayout layout = twoPlanes(2, 20);
    layout.beads[5].center_mm.z() = 36;
    EXPECT_THAT(beadSheets(layout).error().message(), HasSubstr("planes at z = 36 and 40 mm"));
    layout = twoPlanes(2, 20);
    layout.beads[1].center_mm = layout.beads[0].center_mm + Vector3(3.5, 0, 0);
    EXPECT_THAT(beadSheets(layout).error().message(), HasSubstr("beads \"bead 1\" and \"bead 2\""));
    layout.beads.clear();
    EXPECT_FALSE(beadSheets(layout).ok());
    for (int n = 0; n < 9; ++n)
        layout.beads.push_back({std::to_string(n), {0, 0, 30.0 * n}, 2});
    EXPECT_THAT(beadSheets(layout).error().message(), HasSubstr("8 planes"));
}

// Area and count: n points and h holes give n + 2 h - 2 triangles.
TEST(Polygon, TrianglesFillItOnce) {
    std::vector<Vector2> points{{0, 0}, {10, 0}, {10, 8}, {5, 3}, {0, 8}};  // an M upside down
    std::vector<std::vector<std::int32_t>> holes;
    for (const Vector2& center : {Vector2(2, 2), Vector2(5, 1.5), Vector2(8, 2), Vector2(8.5, 4)}) {
        holes.emplace_back();
        for (const Vector2& corner : {Vector2(-0.5, 0), Vector2(0, 0.5), Vector2(0.5, 0), Vector2(0, -0.5)}) {
            holes.back().push_back(static_cast<std::int32_t>(points.size()));
            points.push_back(center + corner);
        }
    }
    const auto triangles = triangulate(points, {0, 1, 2, 3, 4}, holes);
    ASSERT_OK(triangles);
    EXPECT_EQ(triangles->size(), points.size() + 2 * holes.size() - 2);
    double area = 0;
    for (const auto& [a, b, c] : *triangles) {
        const auto at = [&](std::int32_t i) { return points[static_cast<std::size_t>(i)]; };
        const Vector2 u = at(b) - at(a), v = at(c) - at(a);
        EXPECT_GT(u.x() * v.y() - u.y() * v.x(), 0);
        area += 0.5 * (u.x() * v.y() - u.y() * v.x());
    }
    EXPECT_NEAR(area, 80 - 25 - 4 * 0.5, 1e-12);
    // An outline that crosses itself.
    EXPECT_FALSE(triangulate(points, {0, 2, 1, 3}, {}).ok());
}

struct Box {
    Vector2 low, high;
};

// Around a text: capitals are 0.75 of its height; its width is estimated a little generously.
Box boxOf(const Drawing::Text& text) {
    const double width = 0.93 * Drawing::textWidth(text.text, text.height), height = 0.75 * text.height;
    const double left = text.align == Align::left ? 0 : text.align == Align::middle ? -0.5 * width : -width;
    if (text.rotation_rad == 0) return {text.at + Vector2(left, 0), text.at + Vector2(left + width, height)};
    return {text.at + Vector2(-height, left), text.at + Vector2(0, left + width)};
}

void expectLegible(const Drawing& drawing) {
    std::vector<Box> boxes;
    for (const Drawing::Text& text : drawing.texts()) {
        boxes.push_back(boxOf(text));
        const double border = Drawing::kBorderMm;
        EXPECT_GT(boxes.back().low.minCoeff(), border) << text.text;
        EXPECT_LT(boxes.back().high.x(), drawing.size().x() - border) << text.text;
        EXPECT_LT(boxes.back().high.y(), drawing.size().y() - border) << text.text;
        EXPECT_GE(text.height, 2) << text.text;
    }
    for (std::size_t i = 0; i < boxes.size(); ++i)
        for (std::size_t j = 0; j < i; ++j) {
            const bool apart = (boxes[i].low.array() > boxes[j].high.array()).any() ||
                               (boxes[j].low.array() > boxes[i].high.array()).any();
            EXPECT_TRUE(apart) << drawing.texts()[i].text << " | " << drawing.texts()[j].text;
        }
}

TEST(WorkshopDrawings, OfPlatesAreLegible) {
    for (const std::array<int, 2>& grooves : {std::array{49, 49}, std::array{35, 20}, std::array{4, 5}}) {
        for (const double pitch : {6.35, 5.0, 12.0}) {
            GroovedPlate plate;
            plate.grooves = grooves;
            plate.pitch_mm = pitch;
            if (pitch != 6.35) {
                plate.groove_width_mm = 1.2;
                plate.groove_depth_mm = 0.8;
                plate.thickness_mm = 3;
            }
            const auto drawing = drawPlate(plate);
            ASSERT_OK(drawing);
            expectLegible(*drawing);
        }
    }
}

TEST(WorkshopDrawings, OfThePapersPlateGiveInches) {
    const auto drawing = drawPlate({});
    ASSERT_OK(drawing);
    std::vector<std::string> words;
    for (const Drawing::Text& text : drawing->texts())
        words.push_back(text.text);
    for (const char* dimension : {"6.35 [1/4\"]", "1.5875 [1/16\"]", "4.7625 [3/16\"]", "311.15 [12 1/4\"]",
                                  "48 x 6.35 [1/4\"] = 304.8 [12\"]"}) {
        EXPECT_THAT(words, testing::Contains(dimension));
    }
    GroovedPlate metric;
    metric.pitch_mm = 6;
    const auto without = drawPlate(metric);
    ASSERT_OK(without);
    EXPECT_THAT(without->svg(), testing::Not(HasSubstr("&quot;]")));
}

TEST(WorkshopDrawings, OfBeadPhantomsAreLegibleAndHoldEveryBead) {
    for (const auto& [per_side, spacing] : {std::pair(1, 20.0), std::pair(5, 22.0), std::pair(9, 12.0)}) {
        const BeadLayout layout = twoPlanes(per_side, spacing);
        const auto sheets = beadSheets(layout);
        ASSERT_OK(sheets);
        const Drawing assembly = drawAssembly(layout, *sheets);
        expectLegible(assembly);
        for (const Bead& bead : layout.beads)
            EXPECT_THAT(assembly.svg(), HasSubstr(">" + bead.name + "<"));
        for (std::size_t n = 0; n < 2; ++n) {
            const BeadSheet& sheet = (*sheets)[n];
            const Drawing drawing = drawSheet(sheet, static_cast<int>(n) + 1, 2);
            expectLegible(drawing);
            // Holes on paper lie as in the sheet, in true size.
            const auto& circles = drawing.circles();
            ASSERT_GE(circles.size(), sheet.beads.size() + 4);
            for (std::size_t b = 1; b < sheet.beads.size(); ++b) {
                const Vector2 expected = (sheet.beads[b].center_mm - sheet.beads[0].center_mm).head<2>();
                EXPECT_LT((circles[b].center - circles[0].center - expected).norm(), 1e-9);
                EXPECT_NEAR(2 * circles[b].radius, sheet.beads[b].diameter_mm + kHoleFitMm, 1e-12);
            }
        }
    }
}

}  // namespace
}  // namespace fluorocut
