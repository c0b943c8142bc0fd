// Finds the round shadows of beads (steel spheres of 1.5 to 4 mm) in an image and measures their centres to a few
// hundredths of a pixel. Pixels, centres at integers; bright means more photons.
//
// 1. Candidates: maxima over place and scale of s^2 times the smaller eigenvalue of the Hessian of log intensity
//    (Lindeberg 1998; the smaller one, so that neither an edge nor a line answers). Scale s = radius / sqrt(2).
// 2. Background around each candidate, outside of it and of its neighbours: in log intensity a plane, and where that
//    explains much more, a plane plus p(x') + q(y') along the axes of a lattice: the grooves of a plate. What lies
//    below the bead follows from what is seen of the same grooves beside it.
// 3. Shape, by weighted, robust least squares over the intensities divided by that background:
//        J(d) = (c0 + cx x + cy y) (1 - A g(d)),  g = Gaussian(blur) * (1 - exp(-k sqrt(1 - (d/R)^2))) / (1 - exp(-k))
//    A sphere of attenuation mu and radius r has k = 2 mu r and A = 1 - exp(-k); scatter lowers A alone; k to infinity
//    is a disk: a bead that lets nothing through, or one drawn by a program. Blur acts on intensities.
// 4. Noise: variance a + b * intensity and its correlation between neighbouring pixels, measured on what the fits of
//    all beads leave. Then each fit once more with those weights. The covariance of a centre is that of the weighted
//    fit under this noise: detector blur correlates the noise, and leaving that out would promise too much.
// 5. Beads over a lattice, once they are known for beads, once more with what happens where grooves cross
//    (detection/bead_background.h) and with the blur of the product of background and bead: where a groove's edge
//    passes below the rim, blur^2 grad(background) . grad(bead) is added to g. Without these two a centre over a deep
//    milled plate is off by up to 0.08 px. Not before: a dark square between grooves, whose row and column are hidden
//    by beads, would be left without a background and look like a bead.
//
// The centre is that of the shadow, which is not where the sphere's centre projects to (sphere_shadow.h).
// Fails for options outside their limits and an image that is empty or holds NaN. No bead is no failure: the list is
// empty. Nothing is random; the result does not depend on the number of threads.
#pragma once

#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/geometry/rigid3.h"
#include "core/image/image.h"

namespace fluorocut {

struct BeadDetectionOptions {
    double least_diameter_px = 3;  // of the shadow
    double most_diameter_px = 45;
    bool bright = false;          // beads that are brighter than what lies around them
    double least_contrast = 0.1;  // of a bead against its background, natural logarithm of intensity
    // From 0 to 1. A round shadow on a plain background has more than 0.9; texture that happens to be roundish less
    // than 0.5.
    double least_score = 0.6;
    int most_beads = 400;  // the best ones, when more are found: the time spent is bounded

    Result<void> validate() const;
};

struct BeadDetection {
    Vector2 center_px;
    Matrix2 covariance_px2;  // of center_px
    double radius_px;
    double contrast;  // log of background over the bead's middle, without blur; negative for a bright bead
    double blur_px;   // standard deviation of the edge's blur
    double score;     // 0 to 1: how much of what is there the round shape explains, and how evenly all round

    BeadDetection();  // all NaN: not found
};

struct BeadDetections {
    std::vector<BeadDetection> beads;  // best first
    int columns = 0;                   // size of the image
    int rows = 0;
    int candidates = 0;  // that were looked at
    int on_lattice = 0;  // beads for which the background was that of a grooved plate
    double elapsed_ms;   // wall clock
    std::vector<std::string> warnings;

    BeadDetections();
};

Result<BeadDetections> detectBeads(const Image& image, const BeadDetectionOptions& options = {},
                                   Progress& progress = Progress::none());

}  // namespace fluorocut
