// The middle lines of a corkscrew's wires as an imager sees them, and where an image shows them: how far the dark ridge
// lies from its place, across the line.
//
// Left out are stretches that say little: seen (nearly) end on, near another wire or another stretch of the same, near
// the shaft's shadow.
#pragma once

#include <vector>

#include "core/fiducial/corkscrew_layout.h"
#include "core/fiducial/corkscrew_refinement/ray_map.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"

namespace fluorocut::corkscrew {

struct LinePoint {
    Vector3 point, tangent;  // corkscrew
    int branch = 0;          // ring 0, 1, ..., then the helix
    double along_mm = 0;
    double length_mm = 0;  // of a closed branch; 0: open
};

std::vector<LinePoint> wirePoints(const CorkscrewLayout& layout);
std::vector<Vector3> shaftPoints(const CorkscrewLayout& layout);

// log of the image, smoothed, in a region of it.
struct LogImage {
    PixelRegion region;
    Image values;

    // In pixels of the whole image; NaN outside the region.
    float at(double x, double y) const;
};

struct SeenPoint {
    Vector3 point;         // corkscrew
    Vector2 place;         // ideal pixel where it was expected
    Vector2 across;        // unit
    double offset_px = 0;  // of what is seen, along `across`
};

struct SeenLines {
    std::vector<SeenPoint> wire, shaft;
    int looked_at = 0;   // points of wires that are inside the image and not left out
    int on_place = 0;    // of them seen within kOnPlacePx
    double rms_px = 0;   // of those
    double visible = 0;  // share of the wires' points inside the image
};

constexpr double kOnPlacePx = 1.5;

// `reach_px`: how far to either side.
SeenLines findLines(const LogImage& seen, const CArm& carm, const CorkscrewLayout& layout,
                    const std::vector<LinePoint>& wires, const std::vector<Vector3>& shaft,
                    const Rigid3& imager_from_corkscrew, double reach_px);

}  // namespace fluorocut::corkscrew
