// A corkscrew cut into short straight pieces of round bar, as its predicted image is drawn: wires of rings and helix
// joined at mitres, so that neighbours neither overlap nor gape; shaft and rod with flat ends; beads as spheres. No
// mesh: the simulated fiducial (a mesh) and this share nothing but the layout.
//
// A piece is what lies in its cylinder about the line a-b between the planes through a and b with normals normal_a and
// normal_b (both along a-b). Nodes of a ring lie on a slightly larger circle, so that the pieces' mean radius is the
// ring's.
#pragma once

#include <array>
#include <vector>

#include "core/fiducial/corkscrew_layout.h"

namespace fluorocut::corkscrew {

enum Part { wire = 0, shaft = 1, beads = 2, rod = 3, kParts = 4 };

// What of a layout moves when one of its dimensions changes: the wire of a ring or of the helix, or a bead.
struct Group {
    int first_parameter = 0;  // among the layout's dimensions
    int parameters = 0;
};

constexpr int kMostOfGroup = 4;  // as kMostMotions

using Velocities = std::array<Vector3, kMostOfGroup>;
inline const Velocities kStill{Vector3::Zero(), Vector3::Zero(), Vector3::Zero(), Vector3::Zero()};

struct Piece {
    Vector3 a, b;                // corkscrew; of a sphere both are its centre
    Vector3 normal_a, normal_b;  // unit
    double radius_mm = 0;
    Part part = wire;
    bool flat_a = false, flat_b = false;  // the end at a, at b is one of the solid, not a joint
    bool sphere = false;
    bool in_rod = true;  // displaces the rod's material
    int group = -1;
    Velocities velocity = kStill;  // of the piece with each of the group's dimensions
};

struct SolidPieces {
    std::vector<Piece> pieces;
    std::vector<Group> groups;  // rings, helix, beads
    int dimensions = 0;         // number of the layout's dimensions

    explicit SolidPieces(const CorkscrewLayout& layout);
};

}  // namespace fluorocut::corkscrew
