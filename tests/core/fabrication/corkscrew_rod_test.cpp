// The corkscrew's rod with its grooves, and its drawings.
#include "core/fabrication/corkscrew_rod.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "core/geometry/mesh_properties.h"
#include "core/io/resources.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

constexpr double kPi = std::numbers::pi;

CorkscrewLayout layoutNamed(const char* name) {
    return readCorkscrew(findResource("fiducials", name).value()).value();
}

// A groove is a wall-sided part from the wire's middle line to the surface and half the wire's section below it; both
// turned round the axis at their centroids (Pappus). A helix' groove has the same volume per mm of its line.
double grooveVolume(const CorkscrewLayout& layout, double radius, double wire, double turn_length) {
    const double up = (layout.rod_radius_mm - radius) * 2 * wire * 0.5 * (layout.rod_radius_mm + radius);
    const double down = 0.5 * kPi * wire * wire * (radius - 4 * wire / (3 * kPi));
    return turn_length / radius * (up + down);
}

TEST(CorkscrewRod, IsASolidWithTheGroovesVolumeTakenOut) {
    for (const char* name : {"corkscrew", "corkscrew-paper"}) {
        for (const Handedness handedness : {Handedness::right, Handedness::left}) {
            CorkscrewLayout layout = layoutNamed(name);
            layout.helix.handedness = handedness;
            const auto rod = corkscrewRod(layout);
            ASSERT_OK(rod);
            const MeshProperties p = meshProperties(*rod);
            EXPECT_TRUE(p.closedManifold())
                << p.boundary_edges << " " << p.flipped_edges << " " << p.non_manifold_edges;
            EXPECT_EQ(p.components, 1u);
            const double length = layout.rod_x_mm[1] - layout.rod_x_mm[0];
            const double full =
                kPi * (std::pow(layout.rod_radius_mm, 2) - std::pow(layout.shaft_radius_mm, 2)) * length;
            double grooves =
                grooveVolume(layout, layout.helix.radius_mm, layout.helix.wire_radius_mm, layout.helix.length_mm());
            for (const CorkscrewRing& ring : layout.rings)
                grooves += grooveVolume(layout, ring.radius_mm, ring.wire_radius_mm, 2 * kPi * ring.radius_mm);
            // 360 facets inscribe the rod: (2 pi / 360)^2 / 6 = 5e-5 of its volume; the grooves' round bottoms have
            // ten facets.
            EXPECT_NEAR(p.volume_mm3, full * (1 - 5.08e-5) - grooves, 0.03 * grooves);
        }
    }
}

// Wires fit: no vertex of the rod lies inside a wire, and the grooves' floors touch them.
TEST(CorkscrewRod, TheWiresLieInTheirGrooves) {
    CorkscrewLayout layout = layoutNamed("corkscrew");
    layout.helix.phase_rad = 0.4;
    const auto rod = corkscrewRod(layout);
    ASSERT_OK(rod);
    const CorkscrewHelix& helix = layout.helix;
    double nearest_ring = 9, nearest_helix = 9;
    for (const Vector3& v : rod->vertices) {
        const double radius = std::hypot(v.y(), v.z());
        for (const CorkscrewRing& ring : layout.rings)
            nearest_ring = std::min(nearest_ring, std::hypot(radius - ring.radius_mm, v.x() - ring.x_mm));
        for (double t = 0; t <= 1; t += 1e-3) {
            if (std::abs(helix.point(t).x() - v.x()) > 1) continue;
            nearest_helix = std::min(nearest_helix, (helix.point(t) - v).norm());
        }
    }
    EXPECT_NEAR(nearest_ring, 0.5, 1e-9);
    // The floor's curvature along the groove, and places every 0.09 mm.
    EXPECT_NEAR(nearest_helix, 0.5, 0.01);
}

TEST(CorkscrewRod, RefusesGroovesThatCutIntoEachOther) {
    CorkscrewLayout layout = layoutNamed("corkscrew");
    layout.helix.turns = 20;
    layout.helix.wire_radius_mm = 2;
    layout.helix.radius_mm = 12;
    EXPECT_THAT(corkscrewRod(layout).error().message(), testing::HasSubstr("helix.turns"));
}

std::vector<std::string> textsOf(const Drawing& drawing) {
    std::vector<std::string> all;
    for (const Drawing::Text& text : drawing.texts())
        all.push_back(text.text);
    return all;
}

// Boxes around texts, about as wide as Drawing says texts are.
int overlaps(const Drawing& drawing) {
    struct Box {
        Vector2 low, high;
    };
    std::vector<Box> boxes;
    for (const Drawing::Text& text : drawing.texts()) {
        const double width = Drawing::textWidth(text.text, text.height);
        const double left = text.align == Align::left ? 0 : text.align == Align::middle ? -0.5 * width : -width;
        const Eigen::Rotation2Dd turn(text.rotation_rad);
        const Vector2 a = text.at + turn * Vector2(left, 0), b = text.at + turn * Vector2(left + width, text.height);
        boxes.push_back({a.cwiseMin(b), a.cwiseMax(b)});
    }
    int count = 0;
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        EXPECT_GE(boxes[i].low.minCoeff(), Drawing::kBorderMm) << drawing.texts()[i].text;
        EXPECT_LE((boxes[i].high - drawing.size()).maxCoeff(), -Drawing::kBorderMm) << drawing.texts()[i].text;
        for (std::size_t j = 0; j < i; ++j) {
            if (!((boxes[i].low.array() < boxes[j].high.array()).all() &&
                  (boxes[j].low.array() < boxes[i].high.array()).all()))
                continue;
            ++count;
            ADD_FAILURE() << drawing.texts()[i].text << " lies over " << drawing.texts()[j].text;
        }
    }
    return count;
}

TEST(CorkscrewDrawing, SaysEveryPlaceAndNothingOverlaps) {
    for (const char* name : {"corkscrew", "corkscrew-paper"}) {
        const CorkscrewLayout layout = layoutNamed(name);
        const auto drawing = drawCorkscrew(layout);
        ASSERT_OK(drawing);
        EXPECT_EQ(overlaps(*drawing), 0);
        EXPECT_LE(drawing->size().x(), 420);  // A3
        const auto texts = textsOf(*drawing);
        for (std::size_t i = 0; i < layout.rings.size(); ++i) {
            EXPECT_THAT(texts, testing::Contains(fmt::format("ring {} {}", i + 1,
                                                             millimetres(layout.rings[i].x_mm - layout.rod_x_mm[0]))));
        }
        EXPECT_THAT(texts, testing::Contains("helix starts at 0\xC2\xB0"));
        EXPECT_THAT(texts, testing::Contains("helix ends at 90\xC2\xB0"));  // 450
    }
    CorkscrewLayout left = layoutNamed("corkscrew");
    left.helix.handedness = Handedness::left;
    EXPECT_THAT(textsOf(*drawCorkscrew(left)), testing::Contains("helix ends at 270\xC2\xB0"));
}

// Wrapped round the rod, the template's line is the helix.
TEST(CorkscrewDrawing, TheTemplatesLineIsTheHelix) {
    CorkscrewLayout layout = layoutNamed("corkscrew");
    layout.helix.phase_rad = 1;
    for (const Handedness handedness : {Handedness::right, Handedness::left}) {
        layout.helix.handedness = handedness;
        const auto drawing = drawCorkscrewTemplate(layout);
        ASSERT_OK(drawing);
        EXPECT_EQ(overlaps(*drawing), 0);
        EXPECT_LE(drawing->size().x(), 297);  // A4
        // The paper's place of (x = rod's end, 0 degrees): the outline is the first rectangle.
        const Vector2 corner(drawing->lines()[0].from.x(), drawing->lines()[2].from.y());
        double length = 0;
        for (const Drawing::Line& line : drawing->lines()) {
            const Vector2 along = line.to - line.from;
            if (line.pen != Pen::outline || along.x() == 0 || along.y() == 0) continue;
            length += along.norm();
            for (const double t : {0.0, 0.3, 1.0}) {
                const Vector2 at = line.from + t * along - corner;
                const double angle = -at.y() / layout.rod_radius_mm;
                const double x = at.x() + layout.rod_x_mm[0];
                const double part = (x - layout.helix.x_start_mm) / (layout.helix.x_end_mm - layout.helix.x_start_mm);
                const Vector3 on_helix = layout.helix.point(part);
                EXPECT_NEAR(std::cos(angle) * layout.helix.radius_mm, on_helix.y(), 1e-9);
                EXPECT_NEAR(std::sin(angle) * layout.helix.radius_mm, on_helix.z(), 1e-9);
            }
        }
        EXPECT_NEAR(length, std::hypot(74, 2 * kPi * 1.25 * layout.rod_radius_mm), 1e-6);
    }
}

}  // namespace
}  // namespace fluorocut
