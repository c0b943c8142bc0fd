// What the X-ray will look like: a view's real image with the planned bone taken away and the implant put in.
//
//     line integrals    change = sum over parts (mu_part - mu_displaced) path - integral of mu through the bone removed
//     primary light     P' = P * B(exp(-change))           B: the detector's blur, on intensities
//     smooth light      S' = S * G(P') / G(P)              scatter and glare follow what reaches the detector, widely
//                                                          blurred; S = smooth_fraction * G(level), at most 90 % of it
//     levels            L = offset + P + S, in as out
//
// The ratio stands for gain and beam, which need not be known; the offset (level of no photons) must be. Where nothing
// is planned the image is the one that came in, to the last bit.
//
// Bone removed, with a CT: the CT's own line integral through the cavity (and through the parts of the implant above
// the resection), partial voxels counted. Without a CT: path lengths times a stated mean attenuation of spongiosa and
// marrow; what its spread does to the levels is reported. Where the cavity is wider than the stem, `fill_hu` is
// between.
//
// Three steps, so that moving the implant repeats only what it must: PlannedSolids (once for each implant and cavity),
// placePlan (each time it moves), PredictedView (once for each image; predict() each time it moves).
// Frames: solids in `cavity`, CT in `femur`. mm.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/image/image.h"
#include "core/image/volume.h"
#include "core/imaging/carm.h"
#include "core/imaging/materials.h"
#include "core/imaging/mesh_projector.h"
#include "core/imaging/silhouette.h"
#include "core/imaging/volume_projector.h"
#include "core/planning/implant.h"

namespace fluorocut {

struct PredictionOptions {
    double energy_kev = kEffectiveEnergyKev;
    double offset_level = 0;        // of the image: level of no photons
    double detector_blur_px = 0.7;  // standard deviation
    double smooth_fraction = 0.25;  // scatter and glare, of the mean level around
    double smooth_sigma_mm = 30;    // in the detector plane
    double fill_hu = 30;            // between cavity and stem: blood and fluid; -1000 air; cement is 1000 and more
    // Without a CT, the mean along a ray through what is removed and how far it may be off: fatty marrow is -50 to 0
    // HU, spongiosa 100 to 500, and a stem that fills its canal takes some endosteal cortex (1200 and more) with it.
    double bone_hu = 300;
    double bone_hu_sigma = 200;
    double soft_tissue_hu = 40;  // what neck and head displace

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

// An implant and the cavity for it, or one of them.
class PlannedSolids {
  public:
    // Null: none. An implant without cavity displaces the bone that its stem fills.
    static Result<PlannedSolids> prepare(const Implant* implant, const TriangleMesh* cavity);

    struct Solid {
        std::string name;
        MeshProjector projector;
        enum class Role { stemInBone, neck, head, cavity } role;  // head: every part but the stem
        Material material = Material::air;                        // of the cavity: none
    };
    const std::vector<Solid>& solids() const { return solids_; }

  private:
    std::vector<Solid> solids_;
};

// The plan in its place.
struct PlacedPlan {
    Rigid3 femur_from_cavity;
    std::shared_ptr<const VolumeProjector> removed;  // the CT's attenuation that goes; null without a CT
    std::vector<std::string> warnings;
};

// `ct` in Hounsfield units, or null.
Result<PlacedPlan> placePlan(const PlannedSolids& solids, const Rigid3& femur_from_cavity, const Volume* ct,
                             const PredictionOptions& options = {});

struct PredictedImage {
    Image image;   // levels
    Image change;  // of the line integral, not blurred
    // One standard deviation of a level (as a fraction of it) that the unknown density of the removed bone leaves, at
    // the worst pixel: 0 with a CT.
    double level_uncertainty = std::numeric_limits<double>::quiet_NaN();
    double elapsed_ms = std::numeric_limits<double>::quiet_NaN();
};

class PredictedView {
  public:
    // `image` has the size of `carm` and finite levels.
    static Result<PredictedView> prepare(Image image, const CArm& carm, const Rigid3& imager_from_femur,
                                         const PredictionOptions& options = {});

    Result<PredictedImage> predict(const PlannedSolids& solids, const PlacedPlan& plan) const;

    const Image& image() const { return image_; }
    const CArm& carm() const { return carm_; }
    const Rigid3& imagerFromFemur() const { return imager_from_femur_; }

  private:
    PredictedView() = default;
    Image wide(const Image& light) const;

    Image image_, primary_, smooth_, wide_primary_;
    CArm carm_;
    Rigid3 imager_from_femur_;
    PredictionOptions options_;
};

}  // namespace fluorocut
