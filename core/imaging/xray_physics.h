// From line integrals to the picture that a C-arm shows: what photons, matter and the detector do to an image.
//
// In the order in which nature does it (t = line integral, without unit; all images in the C-arm's pixels):
//
//     primary   P = F * (N0 exp(-t))                   Beer-Lambert, blurred by the focal spot's penumbra F
//     scatter   S = s G_scatter * (N0 exp(-t) t)       forward scatter: in proportion to what was crossed and to what
//                                                      came through (Ohnesorge et al. 1999); none in the open beam
//     quanta    Q ~ Poisson(P + S)
//     spread    D = (1 - g) B * Q + g G_glare * B * Q  light and electrons spread in the detector (B), veiling glare
//     levels    L = offset + gain (D + e),  e ~ Normal(0, electronic noise);  saturated, rounded to `bits`
//
// Blur acts on intensities, never on their logarithm, and quanta are counted before the detector spreads them: the
// noise of a picture is correlated over the detector's blur. All kernels sum to 1: scatter adds s t of the primary
// below a uniform slab of line integral t, glare moves a fraction g of the light elsewhere and adds none.
//
// The same seed gives the same picture on any number of threads (one random stream per row).
#pragma once

#include <cstdint>
#include <optional>

#include "core/base/result.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"

namespace fluorocut {

struct XrayOptions {
    double photons_per_pixel = 20000;  // N0: detected per pixel in the open beam

    double focal_spot_mm = 0.6;         // width of the (square, uniform) spot; standard deviation width / sqrt(12)
    double object_depth_mm = 650;       // source to the object plane in which the penumbra is right
    std::optional<Image> focal_kernel;  // a measured penumbra in detector pixels (odd size), instead of focal_spot_mm

    double scatter_per_attenuation = 0.1;  // s: scatter to primary below a slab of line integral 1
    double scatter_sigma_mm = 30;          // in the detector plane

    // An image intensifier's window is round: no quanta beyond this radius from the middle of the picture. Unset: none.
    std::optional<double> field_radius_mm;

    double detector_blur_px = 0.7;         // standard deviation of B
    std::optional<Image> detector_kernel;  // a measured B in pixels (odd size), instead of detector_blur_px
    double glare_fraction = 0.05;          // g
    double glare_sigma_mm = 20;

    bool quantum_noise = true;            // false: the expected number of photons in every pixel
    bool correlated_noise = true;         // false: the noise is drawn after the spread, white
    double electronic_noise_photons = 5;  // standard deviation, in photons

    // Levels per photon. Unset: automatic brightness, the geometric mean of the noise-free picture comes to
    // `brightness` of the full scale (and 1 when bits is 0).
    std::optional<double> gain;
    double brightness = 0.25;
    double offset = 0;  // level of no photons
    int bits = 12;      // 8 to 16; 0: real numbers, neither saturated nor rounded

    std::uint64_t seed = 1;

    // No blur, no scatter, no glare, no noise, no rounding: N0 exp(-t).
    static XrayOptions ideal(double photons_per_pixel = 1);

    Result<void> validate() const;
};

struct Exposure {
    Image image;                    // levels, whole numbers unless bits is 0
    double gain = 0;                // levels per photon, as used
    double mean_photons = 0;        // expected, over the picture
    double saturated_fraction = 0;  // of the pixels, at the upper limit
};

// `line_integrals` has the size of `carm`. Refuses options outside their limits and line integrals that are not finite.
Result<Exposure> expose(const Image& line_integrals, const CArm& carm, const XrayOptions& options);

// Parts of the chain, for those who need one alone. Options are taken as valid.
Image penumbraBlurred(const Image& beam, const CArm& carm, const XrayOptions& options);           // F *
Image expectedQuanta(const Image& line_integrals, const CArm& carm, const XrayOptions& options);  // P + S
Image detectorSpread(Image quanta, const CArm& carm, const XrayOptions& options);                 // D

// Standard deviation (px) of the focal spot's penumbra for objects at `object_depth_mm`.
double penumbraSigmaPx(const CArm& carm, double focal_spot_mm, double object_depth_mm);

}  // namespace fluorocut
