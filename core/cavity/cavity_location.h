// Where is the cavity that was cut? X-rays after the cut, with the C-arm's poses, tell where in the femur it really
// lies: the correction that the next, larger cut is made with.
//
// Method `full`: all views at once, six degrees of freedom of the cavity, each view's own small pose error, and what a
// view does not know of its beam,
//
//     log I = log blur( exp( -g D(view) + h K(view, cavity) ) ) + polynomial + s softness
//
//     D   line integral of the CT                     K   that of its part inside the cavity, which is gone
//     g, h, polynomial, s   linear: attenuation scales, what scatter and gain do slowly over the image, blur
//
// fitted to the after-images' pixels around the cavity (Gauss-Newton, robust weights after the first iterations).
// Without a CT the images before the cut stand in its place, each laid upon its image after (core/cavity/without_ct.h).
//
// Method `paper`: Yao, Taylor et al. (2000), the baseline that tables show. View by view, again and again: the image
// before is laid upon the one after (shift, turn, scale), their difference gives the cavity's outline, the planned
// cavity's apparent contour is laid upon that, and the plane motion is put back into space. It needs the images before.
//
// Frames: `femur` (patient), `cavity` (planned cavity), `imager` (one per view). mm, rad. The poses of views are
// imager_from_femur; their standing uncertainty is given as standard deviations or with the pose.
//
// noSolution: the fit does not converge; what is in the images is no such cavity; the views do not tell its place.
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/acceptance.h"
#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/geometry/pose.h"
#include "core/geometry/triangle_mesh.h"
#include "core/image/image.h"
#include "core/image/volume.h"
#include "core/imaging/carm.h"

namespace fluorocut {

// Something that the CT does not have as the image shows it: a bead, a screw's head.
struct CoveredDisc {
    Vector2 center_px = Vector2::Zero();
    double radius_px = 0;
};

struct CavityView {
    std::string name;
    Image after;
    CArm carm;
    Rigid3 after_imager_from_femur;
    Image before = {};  // of the same C-arm, before the cut; empty: none
    Rigid3 before_imager_from_femur = {};
    std::vector<CoveredDisc> covered = {};  // of the image after: these pixels say nothing (method full with a CT)
};

enum class CavityMethod { full, paper };

// Standard deviations of a view's pose as it is given, at the cavity: where the femur is seen in the image corrects the
// pose, so that generous values cost little.
struct ViewPoseUncertainty {
    double in_plane_mm = 0.5;
    double depth_mm = 1.0;
    double rotation_rad = 0.0035;  // 0.2 degrees, about each axis

    // Of one of (tx ty tz rx ry rz), as Rigid3::perturbed has them.
    double sigma(int j) const { return j < 2 ? in_plane_mm : j == 2 ? depth_mm : rotation_rad; }

    Result<void> validate() const;
};

struct CavityLocationLimits {
    double most_sigma_mm = 0.3;       // of the cavity's origin, in the worst direction
    double most_sigma_rad = 0.0175;   // 1 degree, about the worst axis
    double most_offset_mm = 8;        // from the plan
    double most_rotation_rad = 0.14;  // 8 degrees
    double most_view_sigmas = 4;      // by which a view's pose was corrected
    double least_evidence = 0.2;      // see ViewResidual
    double most_contour_px = 4;       // method paper: residual of a view's contour

    Result<void> validate() const;
};

struct CavityLocationOptions {
    CavityMethod method = CavityMethod::full;
    ViewPoseUncertainty view_pose;
    double mu_water_per_mm = 0.02;  // that the CT's HU stand for
    double blur_px = 0.8;           // to start with
    CavityLocationLimits limits;

    Result<void> validate() const;
};

struct ViewResidual {
    std::string name;
    double rms_log = std::numeric_limits<double>::quiet_NaN();  // of the logarithm of the levels, robust
    Vector6 pose_correction = Vector6::Zero();  // as Rigid3::perturbed has it, about the cavity's middle
    double pose_sigmas = std::numeric_limits<double>::quiet_NaN();  // the largest part of it, in standard deviations
    // Share of the contrast which the cavity was expected to make that the image shows: 0 where the image knows nothing
    // of it, about 1 where it is there.
    double evidence = std::numeric_limits<double>::quiet_NaN();
    // Root mean square distance (px) between the cavity's outline as the image shows it and the outline of the cavity
    // where it was found; NaN where no outline is found in the image.
    double contour_px = std::numeric_limits<double>::quiet_NaN();
};

struct CavityLocation {
    Pose femur_from_cavity;  // where it really is, with covariance
    std::vector<ViewResidual> views;
    int rank = 6;                              // of the motions of a body, how many the images tell
    std::vector<std::string> weak_directions;  // in words
    std::vector<std::string> warnings;
    Acceptance acceptance;
    int iterations = 0;
    bool converged = false;
    double elapsed_ms = std::numeric_limits<double>::quiet_NaN();
};

// `mesh`: the cavity's, closed. `ct`: Hounsfield units, before the cut; null: none, then every view has its image
// before.
Result<CavityLocation> locateCavity(const std::vector<CavityView>& views, const TriangleMesh& mesh,
                                    const Rigid3& planned_femur_from_cavity, std::shared_ptr<const Volume> ct,
                                    const CavityLocationOptions& options = {}, Progress& progress = Progress::none());

}  // namespace fluorocut
