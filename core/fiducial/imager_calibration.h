// The imager's intrinsics from pictures of a phantom of known beads: focal length, image centre and, if wanted, the
// pixel's aspect, after Schreiner et al. (two parallel planes of beads), from one or more views solved jointly.
//
// One view of two planes tells the focal length from its perspective: a change of f by 1 % with the depth scaled along
// changes the planes' relative size by (plane distance / depth) %. It tells the image centre from the tilt only through
// the perspective within a plane. Views with different tilts share the intrinsics and part what one view confuses.
// The centre is the harder one, whatever the phantom: a turn by t of all that is seen, about the source, moves the
// picture by f t and bends it by t x^2 / f only, so that a centre wrong by e shows as e (x/f)^2: 0.5 % of e at the rim
// of a 150 mm field. More beads, more views and a wider field help; errors of the distortion map of the form x^2 do not
// go away (0.01 mm of it moves the centre by 2 mm; with it the pose turns, and what is computed from both hardly
// changes).
//
// Pixels alone tell f / p, never f. Millimetres come from a distortion map (the plate's), from the picture's header,
// from the user, or are assumed; a wrong pixel size scales the focal length and every depth by the same factor.
//
// Distortion: detected centres are mapped, images are never resampled. The map is taken as exact; what it leaves shows
// in `unexplained_px`, which enters the covariance as noise that is independent from bead to bead. Smooth errors are
// not: then the standard deviations are too small by a factor of two or so.
//
// Fails, in words, when no view shows the phantom, and when the views determine the focal length to worse than
// `worst_focal_sigma`: one plane of beads seen face on has no answer. Whether a result is good enough for use is told
// by `acceptance`.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/base/acceptance.h"
#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/fiducial/bead_detection.h"
#include "core/fiducial/bead_layout.h"
#include "core/fiducial/bead_pose.h"
#include "core/imaging/carm.h"

namespace fluorocut {

struct PhantomView {
    std::string name;  // for messages: the image's file
    std::vector<BeadDetection> detections;
};

enum class PixelScaleSource { distortionMap, header, stated, assumed };
std::string_view name(PixelScaleSource source);

struct ImagerAcceptanceLimits {
    double most_focal_sigma = 0.001;    // of the focal length
    double most_center_sigma_mm = 0.5;  // at the detector, each axis
    double most_rms_px = 0.3;
    double least_share = 0.6;  // of the beads inside a view's image that were found, in the worst view

    Result<void> validate() const;
};

struct ImagerCalibrationOptions {
    // Size of the image, pixel_mm, and the rough focal length and centre that the search starts from. Its distortion is
    // not used: see below.
    CArm nominal;
    PixelScaleSource pixel_scale_source = PixelScaleSource::assumed;
    // The distortion of an imager with the given intrinsics; none: the image is straight. A map's: the ideal pixel of a
    // pixel may not depend on where the principal point is taken to be.
    std::function<Result<std::shared_ptr<const Distortion>>(const CArm&)> distortion;
    double focal_sigma = 0.1;  // how rough: relative, one standard deviation
    double center_sigma_px = 20;
    bool estimate_aspect = false;     // p_y / p_x; otherwise that of nominal.pixel_mm
    double worst_focal_sigma = 0.03;  // relative: above it there is no answer
    ImagerAcceptanceLimits limits;
    std::uint64_t seed = 1;

    Result<void> validate() const;
};

struct CalibratedView {
    std::string name;
    Rigid3 imager_from_phantom;
    Matrix6 covariance;
    std::vector<BeadMatch> matches;
    int expected = 0;     // beads whose shadow should lie inside the image
    int unexplained = 0;  // round shadows that are no bead
    double rms_px = 0;
    double focal_depth_correlation = 0;                 // of f and t_z
    Vector2 center_tilt_correlation = Vector2::Zero();  // of c_x and the turn about y, of c_y and the turn about x
};

struct ImagerCalibration {
    CArm carm;  // the answer, with its distortion
    PixelScaleSource pixel_scale_source = PixelScaleSource::assumed;
    double focal_sigma_mm;  // given the pixel scale
    Vector2 center_sigma_px;
    double aspect;  // p_y / p_x
    double aspect_sigma = 0;
    Eigen::Matrix4d covariance;  // of f (mm), c_x, c_y (px), p_x / p_y
    std::vector<CalibratedView> views;
    std::vector<std::string> rejected_views;  // sentences
    double rms_px;
    double unexplained_px;                     // what a detection's own covariance does not explain, per coordinate
    std::vector<std::string> weak_directions;  // in words, with what to do about them
    std::vector<std::string> warnings;
    Acceptance acceptance;
    double elapsed_ms;

    ImagerCalibration();  // NaN: not run
};

Result<ImagerCalibration> calibrateImager(const std::vector<PhantomView>& views, const BeadLayout& layout,
                                          const ImagerCalibrationOptions& options,
                                          Progress& progress = Progress::none());

}  // namespace fluorocut
