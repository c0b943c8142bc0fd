#include "core/fiducial/corkscrew_solid.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/base/option_checks.h"
#include "core/geometry/mesh_tools.h"
#include "core/geometry/primitives.h"

namespace fluorocut {
namespace {

// A cylinder about the x axis; nothing when it has no length.
TriangleMesh alongX(double radius_mm, double from_mm, double to_mm, int sides, double piece_mm) {
    if (!(from_mm < to_mm)) return {};
    const int pieces = static_cast<int>(std::ceil((to_mm - from_mm) / piece_mm));
    std::vector<TubePoint> line;
    for (int i = 0; i <= pieces; ++i) {
        const double x = from_mm + (to_mm - from_mm) * i / pieces;
        line.push_back({{x, 0, 0}, Vector3::UnitX(), Vector3::UnitZ()});
    }
    return makeTube(line, radius_mm, sides, false);
}

// Chords lie within the circle that they are drawn in, by up to radius * a^2 / 2 (a: half a chord's angle), on average
// by a third of radius * a^2. Moved out by that much, a wire lies where it should on average: a ring's size is what
// tells how far away it is.
Vector3 balanced(const Vector3& on_circle, double half_angle_rad) {
    const double grow = 1 + half_angle_rad * half_angle_rad / 3;
    return {on_circle.x(), grow * on_circle.y(), grow * on_circle.z()};
}

// Across the wire one direction lies along the axis: it is never along a ring's or the helix's tangent.
TriangleMesh ringOf(const CorkscrewRing& ring, const CorkscrewFineness& fineness) {
    std::vector<TubePoint> line;
    for (int i = 0; i < fineness.around_axis; ++i) {
        const double angle = 2 * std::numbers::pi * i / fineness.around_axis;
        line.push_back({balanced(ring.point(angle), std::numbers::pi / fineness.around_axis), ring.tangent(angle),
                        Vector3::UnitX()});
    }
    return makeTube(line, ring.wire_radius_mm, fineness.around_wire, true);
}

TriangleMesh helixOf(const CorkscrewHelix& helix, const CorkscrewFineness& fineness) {
    const int chords = std::max(2, static_cast<int>(std::ceil(helix.turns * fineness.around_axis)));
    std::vector<TubePoint> line;
    for (int i = 0; i <= chords; ++i) {
        const double t = static_cast<double>(i) / chords;
        line.push_back(
            {balanced(helix.point(t), std::numbers::pi * helix.turns / chords), helix.tangent(t), Vector3::UnitX()});
    }
    return makeTube(line, helix.wire_radius_mm, fineness.around_wire, false);
}

}  // namespace

Result<void> CorkscrewFineness::validate() const {
    return requireRanges({{"around_axis", static_cast<double>(around_axis), 8, 4096, ""},
                          {"around_shaft", static_cast<double>(around_shaft), 3, 4096, ""},
                          {"around_wire", static_cast<double>(around_wire), 3, 512, ""},
                          {"bead_subdivisions", static_cast<double>(bead_subdivisions), 0, 7, ""},
                          {"piece_mm", piece_mm, 0.1, 10000, "mm"}});
}

Result<CorkscrewSolid> corkscrewSolid(const CorkscrewLayout& layout, const CorkscrewFineness& fineness) {
    if (const Result<void> good = layout.validate(); !good) return good.error();
    if (const Result<void> good = fineness.validate(); !good) return good.error();
    const auto [rod_low, rod_high] = layout.rod_x_mm;
    const auto [shaft_low, shaft_high] = layout.shaft_x_mm;
    const auto shaft = [&](double from_mm, double to_mm) {
        return alongX(layout.shaft_radius_mm, from_mm, to_mm, fineness.around_shaft, fineness.piece_mm);
    };
    CorkscrewSolid solid;
    solid.rod = alongX(layout.rod_radius_mm, rod_low, rod_high, fineness.around_axis, fineness.piece_mm);
    solid.shaft_inside = shaft(std::max(shaft_low, rod_low), std::min(shaft_high, rod_high));
    solid.shaft_outside =
        merged(shaft(shaft_low, std::min(shaft_high, rod_low)), shaft(std::max(shaft_low, rod_high), shaft_high));
    for (const CorkscrewRing& ring : layout.rings)
        solid.rings.push_back(ringOf(ring, fineness));
    solid.helix = helixOf(layout.helix, fineness);
    for (const CorkscrewBead& bead : layout.beads) {
        solid.beads.push_back(transformed(makeSphere(bead.radius_mm, fineness.bead_subdivisions),
                                          Rigid3::fromTranslation(bead.center_mm)));
    }
    return solid;
}

}  // namespace fluorocut
