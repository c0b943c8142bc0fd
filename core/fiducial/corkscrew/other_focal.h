// A corkscrew's lines met with another focal length in pixels: a pixel size or focal length that is wrong by a factor
// is made up for by the depth, but for the perspective within the corkscrew, which tells the right factor to about 2 %.
#pragma once

#include "core/fiducial/corkscrew_layout.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"

namespace fluorocut::corkscrew {

// Focal length in pixels times a factor; only the ratio of focal length and pixel size counts.
CArm withFocalFactor(const CArm& carm, double factor);

// Lines as fitted with the focal length times `factor`.
struct ScaledFit {
    double factor = 1;
    Rigid3 imager_from_corkscrew;
    double rms_px = 0;
    double score = 0;
};

// From a fit with another factor. rms_px is infinite when fewer lines are seen. `image`: metal dark.
ScaledFit scaledFit(const Image& image, const CArm& carm, const CorkscrewLayout& layout, const ScaledFit& from,
                    double factor);

// The factor that meets the lines best, downhill from there.
ScaledFit bestScaledFit(const Image& image, const CArm& carm, const CorkscrewLayout& layout, ScaledFit from);

}  // namespace fluorocut::corkscrew
