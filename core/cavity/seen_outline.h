// What a view shows of a cavity's outline, and how far that lies from where the cavity was found: for every method the
// same. Ideal pixels of the whole image.
#pragma once

#include <optional>

#include "core/base/result.h"
#include "core/cavity/cavity_location.h"
#include "core/cavity/cavity_outline.h"
#include "core/cavity/plane_images.h"
#include "core/imaging/volume_projector.h"

namespace fluorocut::cavity {

// Where the image before comes to lie upon the image after by their poses, by what lies about the cavity.
PlaneSimilarity similarityByPoses(const CavityView& view, const TriangleMesh& mesh, const Rigid3& femur_from_cavity);

struct AlignedView {
    Region region;                // around the planned cavity's shadow
    Mask mask;                    // of the region: in the shadow or near it
    Image log_before, log_after;  // whole images
    PlaneSimilarity before_from_after;
};
// noSolution, in words.
Result<AlignedView> alignView(const CavityView& view, const TriangleMesh& mesh, const Silhouette& silhouette,
                              const Rigid3& planned_femur_from_cavity, double margin_mm, int block_px);

// From the image before the cut, laid upon the one after by its bone's contours (what lies in the shadow of the
// planned cavity or a few mm from it is not looked at). noSolution, in words: no image before; it cannot be laid upon;
// no outline is found near `expected`, where the cavity may lie.
Result<Contour> outlineFromBefore(const CavityView& view, const TriangleMesh& mesh, const Silhouette& silhouette,
                                  const Rigid3& planned_femur_from_cavity, const Rigid3& expected_femur_from_cavity);

// From the CT's projection at this pose. Nothing where no outline is found.
std::optional<Contour> outlineFromCt(const CavityView& view, const Rigid3& imager_from_femur, const VolumeProjector& ct,
                                     const TriangleMesh& mesh, const Silhouette& silhouette,
                                     const Rigid3& expected_femur_from_cavity);

// Root mean square distance (px) of the seen outline from the one that the cavity has there.
double contourResidual(const Contour& seen, const Silhouette& silhouette, const CArm& carm,
                       const Rigid3& imager_from_cavity);

}  // namespace fluorocut::cavity
