// What lies in a picture beside the corkscrew: a CT of a hip, steel screws, a clamp, a cutter's spindle, a retractor's
// blade, each drawn with a likelihood.
//
// Frames: `imager` of the C-arm that takes the picture, `corkscrew`; mm, rad. The spindle goes with the corkscrew, all
// else stays where it was drawn.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/progress.h"
#include "core/base/random.h"
#include "core/base/result.h"
#include "core/fiducial/corkscrew_layout.h"
#include "core/imaging/carm.h"
#include "core/imaging/volume_projector.h"
#include "core/simulation/virtual_operating_room.h"

namespace fluorocut {

// How likely each thing lies in the picture, 0 to 1.
struct CorkscrewClutter {
    double hip = 0;        // femur, pelvis and soft tissue, as in core/simulation/femur_phantom.h
    double screws = 0;     // one to three of 4.5 mm, anywhere
    double clamp = 0;      // anywhere
    double spindle = 0;    // a steel cylinder of 12 to 16 mm, in line with the shaft or beside it
    double retractor = 0;  // an opaque blade over a part of the corkscrew

    static CorkscrewClutter none() { return {}; }
    // What an operation may have, together in most pictures.
    static CorkscrewClutter surgery() { return {1, 0.7, 0.5, 0.5, 0.3}; }

    Result<void> validate() const;
};

struct PlacedClutter {
    std::optional<Rigid3> imager_from_hip;
    std::vector<std::pair<PathLengths, Rigid3>> steel;      // imager_from_object
    std::optional<std::pair<PathLengths, Rigid3>> spindle;  // corkscrew_from_spindle
    std::string objects;                                    // "hip, 2 screws, clamp"
};

class ClutterStock {
  public:
    // Generates the hip's CT (some seconds) when it may be drawn.
    static Result<ClutterStock> prepare(const CorkscrewClutter& likelihoods, std::uint64_t seed,
                                        Progress& progress = Progress::none());

    PlacedClutter draw(const CArm& carm, const CorkscrewLayout& layout, const Rigid3& imager_from_corkscrew,
                       Random& random) const;

    // Line integrals through the hip; 0 without one.
    Image tissue(const PlacedClutter& placed, const CArm& carm) const;
    // Path lengths through steel, mm, once per pixel.
    Image steelMm(const PlacedClutter& placed, const CArm& carm, const Rigid3& imager_from_corkscrew) const;

  private:
    CorkscrewClutter likelihoods_;
    std::optional<VolumeProjector> hip_;
    Vector3 hip_center_ = Vector3::Zero();  // near the lesser trochanter, in `femur`
    PathLengths screw_, clamp_, retractor_;
};

// In front of the imager: the point that pixel `at_px` sees at that depth.
Vector3 placeAt(const CArm& carm, const Vector2& at_px, double depth_mm);
// Anywhere in the middle `share` of the picture's width and height.
Vector2 anyPixel(const CArm& carm, double share, Random& random);
PathLengths pathsThrough(TriangleMesh mesh);
void addScaled(Image& sum, const Image& image, double factor);

}  // namespace fluorocut
