// A hypothetical pose against the ridges of an image, wire by wire: its score, its best twists, and the pose nearby
// that fits better.
#pragma once

#include <span>
#include <vector>

#include "core/fiducial/corkscrew/ridge_map.h"
#include "core/fiducial/corkscrew_layout.h"

namespace fluorocut::corkscrew {

struct WireSample {
    Vector3 point;
    Vector3 tangent;
};

// Places along rings and helix, evenly by length, and along the shaft.
struct WireSamples {
    std::vector<WireSample> wires;  // of the helix from `first_of_helix` on
    std::size_t first_of_helix = 0;
    std::vector<WireSample> shaft;

    std::span<const WireSample> rings() const { return std::span(wires).first(first_of_helix); }

    explicit WireSamples(const CorkscrewLayout& layout);
};

// What is looked at.
struct RidgeImage {
    WorkingImage image;
    RidgeMap wires;
    RidgeMap wires_dilated;
    RidgeMap shafts;
    std::vector<RidgePoint> shaft_points;

    bool sees(double x, double y) const {
        return wires.contains(x, y) && image.sees(static_cast<int>(x + 0.5), static_cast<int>(y + 0.5));
    }
};

// mm at the detector: of a working grid on which a wire is about two pixels wide.
double workingPixel(const CorkscrewLayout& layout);

RidgeImage ridgeImage(WorkingImage image, const CorkscrewLayout& layout);

struct WireScore {
    double score = 0;     // 0 to 1: mean strength where a wire would show
    double visible = 0;   // share of that
    double evidence = 0;  // above chance, times what is visible: what hypotheses compare by
};

WireScore wireScore(const RidgeImage& ridges, std::span<const WireSample> samples, const Rigid3& imager_from_corkscrew);

struct Twist {
    double angle_rad = 0;  // pose * Rx(angle)
    double score = 0;      // of the helix, above chance, times what is visible
};
// Local maxima of a scan, best first, at most `most`.
std::vector<Twist> bestTwists(const RidgeImage& ridges, const WireSamples& samples, const Rigid3& pose, int most);

// Least squares of the distances to the nearest ridges that run the right way; the reach shrinks from `reach_px`.
// Without the helix the twist stays.
enum class Wires { all, rings };
Rigid3 polished(const RidgeImage& ridges, const WireSamples& samples, Rigid3 pose, double reach_px,
                Wires wires = Wires::all);

}  // namespace fluorocut::corkscrew
