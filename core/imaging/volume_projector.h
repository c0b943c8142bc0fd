// Line integrals of attenuation through a CT: digitally reconstructed radiographs, the engine of registration, cavity
// location and planning overlays.
//
//     image(pixel) = integral of mu ds from the source to the detector,    mu = max(0, mu_water (1 + HU / 1000)) [1/mm]
//
// as a float32 image without unit (a pure number), in the pixels of the given C-arm. `imager_from_volume` is the pose
// of the volume's frame (for a CT: imager_from_femur). Outside the volume there is air.
//
// Two methods:
//  * fast   Slice by slice. The volume axis nearest to the central ray is the main axis; a central projection of one
//  slice
//           onto a base plane parallel to it is a scale and a shift, so each slice is added to the base image with
//           separable bilinear weights, and one perspective warp (cubic) takes the base image to the detector. Joseph's
//           rule (Joseph 1982) up to that last interpolation. Falls back to `exact` where a ray is more than 75 degrees
//           from the main axis, so any direction and any place of the source is allowed.
//  * exact  Ray by ray: the integral of the trilinear interpolant of mu, to rounding (the interpolant is a cubic
//           polynomial inside each cell, and two Gauss points integrate cubics exactly). The reference.
//
// The fast method's result depends on the main axis by about its own error. An optimisation that must see a smooth
// function holds the axis with ProjectionOptions::main_axis (mainAxis() names it for a start).
#pragma once

#include <array>
#include <memory>
#include <optional>

#include "core/base/result.h"
#include "core/geometry/rigid3.h"
#include "core/image/image.h"
#include "core/image/volume.h"
#include "core/imaging/carm.h"

namespace fluorocut {

struct AttenuationOptions {
    double mu_water_per_mm = 0.02;
    double air_below_hu = -1000;  // voxels below are empty; a noisy CT's air is skipped with -950

    Result<void> validate() const;
};

enum class ProjectionMethod { fast, exact };

struct ProjectionOptions {
    ProjectionMethod method = ProjectionMethod::fast;
    int binning = 1;               // 1, 2, 4 or 8: each result pixel is the mean over binning x binning detector pixels
    std::optional<int> main_axis;  // fast: hold this volume axis (0, 1 or 2)
};

// d(image)/d(pose): one image for each of (tx ty tz) [1/mm] and (rx ry rz) [1/rad], the perturbation of
// Rigid3::perturbed applied to imager_from_volume.
struct ProjectionWithGradient {
    Image image;
    std::array<Image, 6> gradient;
};

class VolumeProjector {
  public:
    // Prepares the copies that the fast method streams through. The volume is kept for the exact one.
    // Refuses options outside their limits and voxels that are not finite.
    static Result<VolumeProjector> prepare(std::shared_ptr<const Volume> hounsfield,
                                           const AttenuationOptions& options = {});

    Image project(const CArm& carm, const Rigid3& imager_from_volume, const ProjectionOptions& options = {}) const;

    // The fast method's image and its derivatives.
    ProjectionWithGradient projectWithGradient(const CArm& carm, const Rigid3& imager_from_volume,
                                               const ProjectionOptions& options = {}) const;

    // The volume axis nearest to the central ray.
    int mainAxis(const CArm& carm, const Rigid3& imager_from_volume) const;

    const VolumeGrid& grid() const;

    VolumeProjector(VolumeProjector&&) noexcept;
    VolumeProjector& operator=(VolumeProjector&&) noexcept;
    ~VolumeProjector();

  private:
    struct Prepared;
    explicit VolumeProjector(std::unique_ptr<const Prepared> prepared);
    std::unique_ptr<const Prepared> prepared_;
};

}  // namespace fluorocut
