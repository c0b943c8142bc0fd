// What a C-arm would see of a corkscrew: the transmission of its wires, shaft, beads and rod,
//
//     I = mean over the pixel of exp(-sum over parts k of gain_k mu_k L_k),
//
// L_k the path lengths of the pixel's (distorted) rays, and its derivatives. Not blurred yet: the detector blurs
// intensities, so I and its derivatives are blurred alike afterwards. Materials' mu are those at the working energy
// (materials.h); what a real beam makes of them, the gains follow.
//
// Derivatives come from how chords change when the solid moves (row_kernels.h), except on the rod: plastic pulls at
// nothing.
//
// Does not depend on the number of threads.
#pragma once

#include <array>
#include <vector>

#include "core/fiducial/corkscrew_refinement/ray_map.h"
#include "core/fiducial/corkscrew_refinement/solid_pieces.h"
#include "core/image/image.h"

namespace fluorocut::corkscrew {

enum class Derivatives {
    none,
    pose,  // and gains
    all,   // and what images share
};

// How often a pixel is looked at: so that the image is right to the noise of a thousand photons, or once, for steps and
// derivatives that need not be, at a third of the time.
enum class Sampling { fine, coarse };

// d I / d dimensions of one group, in its part of the region (columns and rows multiples of 4).
struct GroupDerivatives {
    PixelRegion box;  // of the predictor's region
    std::vector<Image> planes;
};

struct PredictedImage {
    Image transmission;                     // I, of the region
    std::vector<std::array<int, 2>> drawn;  // every kStripRows rows: columns [begin, end) with anything of the solid
    std::vector<Image> pose;                // d I / d (pose as Rigid3::perturbed has it): 6
    std::array<Image, kParts> gains;        // d I / d gain_k
    std::vector<Image> imager;              // d I / d (relative focal length, principal point u, v px): 3
    std::vector<GroupDerivatives> groups;   // as SolidPieces::groups has them
};

constexpr int kStripRows = 8;

class CorkscrewPredictor {
  public:
    // The region's width and height are multiples of 4.
    CorkscrewPredictor(const CArm& carm, const CorkscrewLayout& layout, const PixelRegion& region);

    PredictedImage predict(const Rigid3& imager_from_corkscrew, const std::array<double, kParts>& gains,
                           Derivatives derivatives, Sampling sampling = Sampling::fine) const;
    // Into the memory of an earlier one.
    void predict(const Rigid3& imager_from_corkscrew, const std::array<double, kParts>& gains, Derivatives derivatives,
                 Sampling sampling, PredictedImage& out) const;
    // Path lengths of the parts, mean over each pixel (for tests). The rod's leaves out what lies in it.
    std::array<Image, kParts> pathLengths(const Rigid3& imager_from_corkscrew) const;

    const RayMap& rays() const { return rays_; }
    const SolidPieces& solid() const { return solid_; }

    static constexpr int kGroupMargin = 20;  // px about a group, beyond its own extent

  private:
    struct Placed;
    class Strip;
    std::vector<Placed> place(const Rigid3& imager_from_corkscrew, const std::array<double, kParts>& attenuation,
                              int samples) const;

    RayMap rays_;
    SolidPieces solid_;
    Vector2 pixel_mm_;
    std::array<double, kParts> attenuation_;  // of parts, per mm
    int samples_ = 2;                         // per pixel along each axis, when fine
};

// The rectangle of the image that holds the fiducial and `margin_px` about it, cut to multiples of 4; may be empty.
PixelRegion regionAround(const CArm& carm, const CorkscrewLayout& layout, const Rigid3& imager_from_corkscrew,
                         double margin_px);

}  // namespace fluorocut::corkscrew
