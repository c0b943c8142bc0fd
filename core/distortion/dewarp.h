// Dewarper: makes straight images with a DistortionMap: the pixel of the straight image at ideal_px shows what the
// distorted image has at distortedPixel(ideal_px). Same size, one square pixel of map.pixelMm().
//
// Where an algorithm can work on points or contours, map those (DistortionMap::idealPixel) and leave the image alone:
// resampling smooths noise unevenly.
//
// The inverse map is solved on a coarse grid when the Dewarper is made and interpolated between (to 0.002 px); one
// Dewarper serves any number of images and threads. Methods:
//   bspline    cubic B-spline interpolation (prefiltered, Unser 1999): one two-dimensional resampling
//   two-pass   the paper's: cubic splines along each row into an intermediate image, then along each of its columns
//              (Catmull and Smith 1980). The default for the model `bernstein`; right for every map that turns the
//              picture by well under 45 degrees, which a DistortionMap's ideal pixels never do
//   linear     bilinear: for a display in a hurry
//
// Pixels that see outside the distorted image, or farther than two pitches beyond the support of the map, have no
// answer: they are 0 here and 0 in the mask.
#pragma once

#include <memory>
#include <optional>

#include "core/base/result.h"
#include "core/distortion/distortion_map.h"
#include "core/image/image.h"

namespace fluorocut {

enum class Resampling { bspline, twoPass, linear };

class Dewarper {
  public:
    explicit Dewarper(const DistortionMap& map, std::optional<Resampling> method = {});
    ~Dewarper();
    Dewarper(Dewarper&&) noexcept;
    Dewarper& operator=(Dewarper&&) noexcept;

    // invalidInput when the image is not of the map's size.
    Result<Image> dewarped(const Image& distorted) const;

    Resampling method() const;
    // 1: has an answer.
    const Mask& answered() const;
    std::size_t pixelsWithoutAnswer() const;
    // Where the straight pixel looks in the distorted image, as interpolated.
    Vector2 distortedPixel(int x, int y) const;

  private:
    struct Implementation;
    std::unique_ptr<const Implementation> implementation_;
};

// The C-arm whose pixels a dewarped image has: no distortion, the map's square pixels about the image's middle.
CArm straightened(const DistortionMap& map, const CArm& carm);

}  // namespace fluorocut
