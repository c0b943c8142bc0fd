// CorkscrewLayout: the paper's fiducial, a rod with a steel shaft, rings of wire and a helix between them, whose single
// X-ray image tells its pose. Its dimensions are data, nominal or measured. Files: fluorocut/corkscrew/1
//     {"schema": "fluorocut/corkscrew/1", "rod_radius_mm": 10, "rod_x_mm": [-40, 40], "shaft_radius_mm": 1.5,
//      "shaft_x_mm": [-45, 45], "rings": [{"x_mm": -34, "radius_mm": 9, "wire_radius_mm": 0.5}, ...],
//      "helix": {"x_start_mm": -16, "x_end_mm": 16, "turns": 1.25, "radius_mm": 9, "phase_rad": 0,
//                "handedness": "right", "wire_radius_mm": 0.5},
//      "beads": [{"center_mm": [0, 0, 0], "radius_mm": 1.0}],
//      "materials": {"rod": "polyamide", "shaft": "steel", "wire": "copper"}}
//
// Frame `corkscrew`: x along the shaft. A ring of radius r at x: (x, r cos a, r sin a). The helix, t in [0, 1]:
//     x = x_start + t (x_end - x_start),  y = r cos a,  z = r sin a,  a = phase + s 2 pi turns t
// with s = +1 right-handed, -1 left-handed. Radii of rings and helix are to the middle of the wire. Beads are of the
// shaft's material.
#pragma once

#include <array>
#include <filesystem>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/rigid3.h"
#include "core/imaging/materials.h"

namespace fluorocut {

enum class Handedness { right, left };

struct CorkscrewRing {
    double x_mm = 0;
    double radius_mm = 9;
    double wire_radius_mm = 0.5;

    Vector3 point(double angle_rad) const;
    Vector3 tangent(double angle_rad) const;  // of unit length
};

struct CorkscrewHelix {
    double x_start_mm = -16;
    double x_end_mm = 16;
    double turns = 1.25;
    double radius_mm = 9;
    double phase_rad = 0;
    Handedness handedness = Handedness::right;
    double wire_radius_mm = 0.5;

    Vector3 point(double t) const;
    Vector3 tangent(double t) const;  // of unit length
    double length_mm() const;
};

struct CorkscrewBead {
    Vector3 center_mm = Vector3::Zero();
    double radius_mm = 1;
};

struct CorkscrewLayout {
    double rod_radius_mm = 10;
    std::array<double, 2> rod_x_mm{-40, 40};
    double shaft_radius_mm = 1.5;
    std::array<double, 2> shaft_x_mm{-45, 45};
    std::vector<CorkscrewRing> rings;
    CorkscrewHelix helix;
    std::vector<CorkscrewBead> beads;
    Material rod = Material::polyamide;
    Material shaft = Material::steel;
    Material wire = Material::copper;

    // Names the field, the value and the limit: rings in rising order of x, wires and beads in the rod and clear of
    // each other and of the shaft.
    Result<void> validate() const;
};

Result<CorkscrewLayout> readCorkscrew(const std::filesystem::path& path);
Result<void> writeCorkscrew(const std::filesystem::path& path, const CorkscrewLayout& layout);

}  // namespace fluorocut
