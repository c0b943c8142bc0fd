#include "core/fiducial/corkscrew_refinement/solid_pieces.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fluorocut::corkscrew {
namespace {

constexpr double kWireStepMm = 0.4, kBarStepMm = 5;
constexpr double kRodStepMm = 60;  // it is wide: short pieces of it would be looked for far beyond their ends

struct Node {
    Vector3 point;
    Velocities velocity = kStill;
};

// Pieces along nodes; of a closed line the first node is repeated at the end.
void addWire(std::vector<Piece>& pieces, const std::vector<Node>& nodes, bool closed, double radius_mm, int group) {
    const std::size_t count = nodes.size() - 1;
    std::vector<Vector3> along(count);
    for (std::size_t k = 0; k < count; ++k)
        along[k] = (nodes[k + 1].point - nodes[k].point).normalized();
    for (std::size_t k = 0; k < count; ++k) {
        const Vector3& before = k > 0 ? along[k - 1] : closed ? along[count - 1] : along[k];
        const Vector3& after = k + 1 < count ? along[k + 1] : closed ? along[0] : along[k];
        Piece piece{nodes[k].point, nodes[k + 1].point, (before + along[k]).normalized(),
                    (along[k] + after).normalized(), radius_mm};
        piece.group = group;
        piece.flat_a = !closed && k == 0;
        piece.flat_b = !closed && k + 1 == count;
        for (std::size_t p = 0; p < piece.velocity.size(); ++p)
            piece.velocity[p] = 0.5 * (nodes[k].velocity[p] + nodes[k + 1].velocity[p]);
        pieces.push_back(piece);
    }
}

// The mean distance from the middle of a chord over the angle `step` is 1 / chordStretch of its ends'.
double chordStretch(double step_rad) {
    return 1 / (1 - step_rad * step_rad / 12);
}

void addBar(std::vector<Piece>& pieces, double from_mm, double to_mm, double radius_mm, Part part, bool in_rod,
            double step_mm = kBarStepMm) {
    if (!(to_mm > from_mm)) return;
    const int count = std::max(1, static_cast<int>(std::ceil((to_mm - from_mm) / step_mm)));
    for (int k = 0; k < count; ++k) {
        Piece piece;
        piece.a = Vector3(from_mm + (to_mm - from_mm) * k / count, 0, 0);
        piece.b = Vector3(from_mm + (to_mm - from_mm) * (k + 1) / count, 0, 0);
        piece.normal_a = piece.normal_b = Vector3::UnitX();
        piece.radius_mm = radius_mm;
        piece.part = part;
        piece.in_rod = in_rod;
        piece.flat_a = k == 0;
        piece.flat_b = k + 1 == count;
        pieces.push_back(piece);
    }
}

}  // namespace

SolidPieces::SolidPieces(const CorkscrewLayout& layout) {
    const auto newGroup = [&](int parameters) {
        groups.push_back({dimensions, parameters});
        dimensions += parameters;
        return static_cast<int>(groups.size()) - 1;
    };
    for (const CorkscrewRing& ring : layout.rings) {
        const int count = static_cast<int>(std::ceil(2 * std::numbers::pi * ring.radius_mm / kWireStepMm));
        const double step = 2 * std::numbers::pi / count, stretch = chordStretch(step);
        std::vector<Node> nodes;
        for (int k = 0; k <= count; ++k) {
            const double angle = step * (k % count);
            const Vector3 outward(0, std::cos(angle), std::sin(angle));
            nodes.push_back({Vector3(ring.x_mm, 0, 0) + stretch * ring.radius_mm * outward,
                             {Vector3::UnitX(), outward, Vector3::Zero(), Vector3::Zero()}});
        }
        addWire(pieces, nodes, true, ring.wire_radius_mm, newGroup(2));
    }
    const CorkscrewHelix& helix = layout.helix;
    const int count = static_cast<int>(std::ceil(helix.length_mm() / kWireStepMm));
    const double stretch = chordStretch(2 * std::numbers::pi * helix.turns / count);
    std::vector<Node> nodes;
    for (int k = 0; k <= count; ++k) {
        const double t = static_cast<double>(k) / count;
        const Vector3 point = helix.point(t);
        const Vector3 outward = Vector3(0, point.y(), point.z()) / helix.radius_mm;
        const Vector3 around(0, -point.z(), point.y());
        nodes.push_back({Vector3(point.x(), 0, 0) + stretch * helix.radius_mm * outward,
                         {(1 - t) * Vector3::UnitX(), t * Vector3::UnitX(), outward, around}});
    }
    addWire(pieces, nodes, false, helix.wire_radius_mm, newGroup(4));
    for (const CorkscrewBead& bead : layout.beads) {
        Piece piece;
        piece.a = piece.b = bead.center_mm;
        piece.normal_a = piece.normal_b = Vector3::UnitX();
        piece.radius_mm = bead.radius_mm;
        piece.part = beads;
        piece.sphere = true;
        piece.group = newGroup(3);
        piece.velocity = {Vector3::UnitX(), Vector3::UnitY(), Vector3::UnitZ(), Vector3::Zero()};
        pieces.push_back(piece);
    }
    const auto [shaft_low, shaft_high] = layout.shaft_x_mm;
    const double rod_low = std::clamp(layout.rod_x_mm[0], shaft_low, shaft_high);
    const double rod_high = std::clamp(layout.rod_x_mm[1], shaft_low, shaft_high);
    const std::size_t first = pieces.size();
    addBar(pieces, shaft_low, rod_low, layout.shaft_radius_mm, shaft, false);
    addBar(pieces, rod_low, rod_high, layout.shaft_radius_mm, shaft, true);
    addBar(pieces, rod_high, shaft_high, layout.shaft_radius_mm, shaft, false);
    for (std::size_t k = first; k < pieces.size(); ++k) {  // where it enters the rod is no end
        pieces[k].flat_a = k == first;
        pieces[k].flat_b = k + 1 == pieces.size();
    }
    addBar(pieces, layout.rod_x_mm[0], layout.rod_x_mm[1], layout.rod_radius_mm, rod, false, kRodStepMm);
}

}  // namespace fluorocut::corkscrew
