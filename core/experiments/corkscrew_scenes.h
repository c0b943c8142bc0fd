// Pictures of a corkscrew as an operation has them, with what a navigation system would know of them and, apart, the
// truth: what detection, fits and accuracy are tested with.
//
// A picture: line integrals through the corkscrew (its exact solids, sampled 3 x 3 times in a pixel and averaged as
// intensities, as a detector does) plus those through what else is there (corkscrew_clutter.h; beads in a bone; once
// per pixel), then core/imaging/xray_physics.h: penumbra, scatter, quanta, blur, glare, levels of 16 bits. Exposure as
// automatic brightness does it: `photons` is the number detected per pixel where the picture is of middling brightness
// (the open beam when nothing else is there), and nothing saturates.
//
// Frames: `imager` of the C-arm as it is known (core/experiments/simulated_imager.h), `corkscrew`, mm, rad.
// Scene i of the same options is always the same, in whatever order and on however many threads scenes are made.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/base/units.h"
#include "core/experiments/corkscrew_clutter.h"
#include "core/experiments/simulated_imager.h"
#include "core/fiducial/bead_layout.h"
#include "core/fiducial/corkscrew_layout.h"
#include "core/image/image.h"

namespace fluorocut {

struct CorkscrewSceneOptions {
    CorkscrewLayout layout;  // the true one
    std::uint64_t seed = 1;

    std::optional<CArm> carm;  // this one, known exactly; otherwise:
    SimulatedImagerOptions imager;
    int imagers = 12;  // of them, when each differs from the others

    // Drawn uniformly (twist: any), until the corkscrew lies in the picture.
    double most_roll_rad = radiansFromDegrees(60);
    double most_pitch_rad = radiansFromDegrees(60);
    double least_depth_mm = 650, most_depth_mm = 740;
    // Of the wires' length within the lit picture, at least; 1: rings and helix in the field.
    double least_visible = 1;
    // Of the wires' visible length, behind metal that lets less than a tenth through: clutter is drawn until it is so.
    double most_covered = 0.35;

    double photons = 1000;
    double blur_px = 0.7;
    CorkscrewClutter clutter;
    // Steel beads, as in a bone, in every picture; in the known imager's frame.
    std::optional<BeadLayout> beads;
    Rigid3 imager_from_beads;
    double inverted = 0;         // likelihood that more photons are darker
    double dimension_error = 0;  // mm, standard deviation of each dimension of the layout that is handed out

    Result<void> validate() const;
};

struct CorkscrewScene {
    // For the estimator.
    Image image;
    CArm carm;
    CorkscrewLayout layout;

    // For scoring, never for the estimator.
    Rigid3 imager_from_corkscrew;
    double visible = 0;  // share of the wires' length inside the lit picture
    double covered = 0;  // share of the visible behind metal that lets less than a tenth through
    bool inverted = false;
    double map_error_mm = 0;  // of its imager's map
    std::size_t imager = 0;   // which of them
    std::string objects;      // "hip, 2 screws, clamp"
};

class CorkscrewScenes {
  public:
    // Makes what scenes share: the hip's CT (some seconds, when asked for), bent imagers and their maps (0.5 s each).
    static Result<CorkscrewScenes> prepare(const CorkscrewSceneOptions& options, Progress& progress = Progress::none());

    // noSolution when no pose within the options lies in the picture. Poses given: invalidOption when some of the
    // corkscrew does not lie between source and detector.
    Result<CorkscrewScene> scene(std::uint64_t index) const;

    // The same imager with the corkscrew here, clutter drawn about it.
    Result<CorkscrewScene> sceneAt(std::uint64_t index, const Rigid3& imager_from_corkscrew) const;
    // The same imager, dose and clutter with the corkscrew here (in the known imager's frame), in the picture or not;
    // other noise for another `exposure`. The spindle goes with the corkscrew, all else stays.
    Result<CorkscrewScene> sceneWith(std::uint64_t index, const Rigid3& imager_from_corkscrew,
                                     std::uint64_t exposure = 1) const;

    CorkscrewScenes(CorkscrewScenes&&) noexcept;
    CorkscrewScenes& operator=(CorkscrewScenes&&) noexcept;
    ~CorkscrewScenes();

  private:
    struct Shared;
    explicit CorkscrewScenes(std::unique_ptr<const Shared> shared);
    std::unique_ptr<const Shared> shared_;
};

// The share of the wires' length (rings and helix) at whose pixels `sees` holds. Below `least` the answer is only that
// it is below: the rest is not looked at.
double shareOfWires(const CorkscrewLayout& layout, const CArm& carm, const Rigid3& imager_from_corkscrew,
                    const std::function<bool(const Vector2&)>& sees, double least = 0);

}  // namespace fluorocut
