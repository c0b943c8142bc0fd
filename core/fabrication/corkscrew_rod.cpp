#include "core/fabrication/corkscrew_rod.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include <fmt/format.h>

#include "core/geometry/mesh_properties.h"
#include "core/geometry/mesh_tools.h"

namespace fluorocut {
namespace {

constexpr double kPi = std::numbers::pi;

// Where a column of the rod's surface (a line of constant angle) crosses grooves: `x_mm` of the groove's middle.
struct Crossing {
    double x_mm = 0;
    double radius_mm = 0;       // of the wire's middle line
    double half_across_mm = 0;  // of the groove, along x
    double depth_mm = 0;        // of the round bottom below the middle line; 0: no groove here
};

// Points of a column through one groove, from low x to high: the same number for every groove. Outside [low, high]
// nothing is cut: points beyond are moved to the end, where they fall together.
void addCrossing(const Crossing& c, double rod_radius_mm, double low_mm, double high_mm,
                 std::vector<std::pair<double, double>>& column) {
    constexpr std::array<double, 9> kAcross{-1, -0.92, -0.7, -0.38, 0, 0.38, 0.7, 0.92, 1};
    const auto put = [&](double across, double radius_mm) {
        column.emplace_back(std::clamp(c.x_mm + across * c.half_across_mm, low_mm, high_mm),
                            c.depth_mm > 0 ? radius_mm : rod_radius_mm);
    };
    put(-1, rod_radius_mm);
    for (const double u : kAcross)
        put(u, c.radius_mm - c.depth_mm * std::sqrt(1 - u * u));
    put(1, rod_radius_mm);
}

struct RodShape {
    const CorkscrewLayout& layout;
    double helix_low_mm = 0, helix_high_mm = 0;  // the part of the surface that the helix' grooves may use
    int slots = 0;                               // crossings of the helix in a column, real ones or not

    explicit RodShape(const CorkscrewLayout& of) : layout(of) {
        const CorkscrewHelix& helix = layout.helix;
        helix_low_mm = layout.rod_x_mm[0];
        helix_high_mm = layout.rod_x_mm[1];
        for (const CorkscrewRing& ring : layout.rings) {
            if (ring.x_mm < helix.x_start_mm) helix_low_mm = std::max(helix_low_mm, ring.x_mm + ring.wire_radius_mm);
            if (ring.x_mm > helix.x_end_mm) helix_high_mm = std::min(helix_high_mm, ring.x_mm - ring.wire_radius_mm);
        }
        // From a whole turn beyond the low end to a whole turn beyond the high one.
        slots = static_cast<int>(std::ceil((helix_high_mm - helix_low_mm) / pitch())) + 4;
    }

    double pitch() const { return (layout.helix.x_end_mm - layout.helix.x_start_mm) / layout.helix.turns; }
    // Turns in the helix' own sense from its start to a column, in [0, 1].
    Crossing helixCrossing(double turn, int slot) const {
        const CorkscrewHelix& helix = layout.helix;
        const double first = std::floor((helix_low_mm - helix.x_start_mm) / pitch()) - 1;
        const double turns = turn + slot + first;
        // Along x a groove is wider than across, by the slope of the helix.
        const double slope = pitch() / (2 * kPi * helix.radius_mm);
        Crossing c;
        c.x_mm = helix.x_start_mm + turns * pitch();
        c.radius_mm = helix.radius_mm;
        c.half_across_mm = helix.wire_radius_mm * std::sqrt(1 + slope * slope);
        c.depth_mm = turns >= 0 && turns <= helix.turns ? helix.wire_radius_mm : 0;
        return c;
    }

    // (x, radius) along the column, from one end of the rod to the other.
    std::vector<std::pair<double, double>> column(double turn) const {
        std::vector<std::pair<double, double>> points{{layout.rod_x_mm[0], layout.rod_radius_mm}};
        const auto addRings = [&](bool beyond_helix) {
            for (const CorkscrewRing& ring : layout.rings) {
                if ((ring.x_mm > layout.helix.x_start_mm) != beyond_helix) continue;
                addCrossing({ring.x_mm, ring.radius_mm, ring.wire_radius_mm, ring.wire_radius_mm}, layout.rod_radius_mm,
                            layout.rod_x_mm[0], layout.rod_x_mm[1], points);
            }
        };
        addRings(false);
        for (int slot = 0; slot < slots; ++slot)
            addCrossing(helixCrossing(turn, slot), layout.rod_radius_mm, helix_low_mm, helix_high_mm, points);
        addRings(true);
        points.emplace_back(layout.rod_x_mm[1], layout.rod_radius_mm);
        return points;
    }
};

Result<void> checkGrooves(const RodShape& shape) {
    const CorkscrewHelix& helix = shape.layout.helix;
    const double across = shape.helixCrossing(0, 0).half_across_mm;
    if (!(shape.pitch() > 2.2 * across)) {
        return invalidOption("helix.turns", fmt::format("{} in {} mm", helix.turns, helix.x_end_mm - helix.x_start_mm),
                             fmt::format("grooves of {} mm beside each other", 2 * helix.wire_radius_mm));
    }
    if (!(helix.x_start_mm - across > shape.helix_low_mm && helix.x_end_mm + across < shape.helix_high_mm)) {
        return invalidOption(
            "helix.x_start_mm, x_end_mm", fmt::format("{}, {}", helix.x_start_mm, helix.x_end_mm),
            fmt::format("a groove between {:.4g} and {:.4g} mm", shape.helix_low_mm, shape.helix_high_mm));
    }
    return {};
}

}  // namespace

Result<TriangleMesh> corkscrewRod(const CorkscrewLayout& layout, int segments) {
    if (const Result<void> good = layout.validate(); !good) return good.error();
    const RodShape shape(layout);
    if (const Result<void> good = checkGrooves(shape); !good) return good.error();

    // Columns at equal angles from the helix' start, in its own sense, and one at either side of each of its ends:
    // there the groove's end wall stands.
    constexpr double kWall = 2e-5;  // turns: 2 um
    std::vector<double> turns;
    for (int i = 0; i < segments; ++i)
        turns.push_back(static_cast<double>(i) / segments);
    turns.push_back(1 - kWall);  // before the start
    const double end = layout.helix.turns - std::floor(layout.helix.turns);
    turns.push_back(end);
    turns.push_back(end + kWall);
    std::sort(turns.begin(), turns.end());
    turns.erase(std::unique(turns.begin(), turns.end(), [](double a, double b) { return b - a < 0.5 * kWall; }),
                turns.end());
    while (turns.back() > 1 - 0.5 * kWall)
        turns.pop_back();

    TriangleMesh mesh;
    std::vector<std::vector<std::int32_t>> columns;
    std::vector<std::int32_t> bore_low, bore_high;
    const double sense = layout.helix.handedness == Handedness::right ? 1 : -1;
    const auto addVertex = [&](double x, double radius, double turn) {
        const double angle = layout.helix.phase_rad + sense * 2 * kPi * turn;
        mesh.vertices.emplace_back(x, radius * std::cos(angle), radius * std::sin(angle));
        return static_cast<std::int32_t>(mesh.vertices.size() - 1);
    };
    const auto addFace = [&](std::int32_t a, std::int32_t b, std::int32_t c) {
        mesh.triangles.push_back(sense > 0 ? Triangle{a, b, c} : Triangle{a, c, b});
    };
    for (const double turn : turns) {
        columns.emplace_back();
        for (const auto& [x, radius] : shape.column(turn))
            columns.back().push_back(addVertex(x, radius, turn));
        bore_low.push_back(addVertex(layout.rod_x_mm[0], layout.shaft_radius_mm, turn));
        bore_high.push_back(addVertex(layout.rod_x_mm[1], layout.shaft_radius_mm, turn));
    }
    // After a full turn a column is the first one again, its crossings of the helix counted from one further on.
    columns.emplace_back();
    for (const auto& [x, radius] : shape.column(1))
        columns.back().push_back(addVertex(x, radius, 1));
    bore_low.push_back(bore_low.front());
    bore_high.push_back(bore_high.front());
    for (std::size_t i = 0; i + 1 < columns.size(); ++i) {
        const auto &here = columns[i], &next = columns[i + 1];
        for (std::size_t j = 0; j + 1 < here.size(); ++j) {
            addFace(here[j], next[j], next[j + 1]);
            addFace(here[j], next[j + 1], here[j + 1]);
        }
        const auto quad = [&](std::int32_t a, std::int32_t b, std::int32_t c, std::int32_t d) {
            addFace(a, b, c);
            addFace(a, c, d);
        };
        quad(bore_low[i], bore_low[i + 1], next.front(), here.front());
        quad(here.back(), next.back(), bore_high[i + 1], bore_high[i]);
        quad(bore_high[i], bore_high[i + 1], bore_low[i + 1], bore_low[i]);
    }
    // Points that fell together, and the seam.
    mesh = weldVertices(mesh, 1e-6);
    if (const Result<void> solid = requireSolid(mesh, "rod"); !solid) return solid.error();
    return mesh;
}

}  // namespace fluorocut
