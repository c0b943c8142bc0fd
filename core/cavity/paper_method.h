// The paper's cavity location (Yao, Taylor et al. 2000, "Cavity Location Algorithm"), view by view:
//
//   1. the image before is laid upon the image after by a shift, a turn and a scale (plane_images.h)
//   2. their difference gives the cut cavity's outline (cavity_outline.h): once for each view
//   3. the apparent contour of the cavity where it is thought to be is laid upon that outline: (dx, dy), dtheta
//   4. put back into space, d being the cavity's depth, f the focal length, s the pixel:
//          delta = T2^-1 R1 T2 T1,  T1 a shift by (dx s d / f, dy s d / f, 0),  R1 a turn by dtheta about the viewing
//          axis,  T2 a shift that takes the turn's middle to the axis
//          femur_from_cavity' = femur_from_imager delta imager_from_femur femur_from_cavity
//      (the paper's printed update of F_m mixes frames)
//   5. again with the next view, until nothing changes.
//
// Turns about viewing axes never turn a cavity about the direction across all of them: with views around a stem, that
// is the stem's own axis. Its rotation stays as planned, and the covariance says so.
#pragma once

#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/cavity/cavity_location.h"
#include "core/cavity/plane_contours.h"

namespace fluorocut::cavity {

// Step 4: the motion in the frame `imager` of what lies at `depth_mm`, seen to move by `seen` (ideal pixels).
Rigid3 backProjected(const PlaneRigid& seen, const CArm& carm, double depth_mm);

Result<CavityLocation> locateByPaper(const std::vector<CavityView>& views, const TriangleMesh& mesh,
                                     const Rigid3& planned_femur_from_cavity, const CavityLocationOptions& options,
                                     Progress& progress);

}  // namespace fluorocut::cavity
