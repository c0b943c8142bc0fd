// CArm: the imager as a pinhole camera with a distorted image, equations 2-4 of the paper.
//
//     x_u = f x_c / z_c,             y_u = f y_c / z_c              (2) perspective; imager frame -> mm in the detector
//     plane (x_d, y_d) = M(x_u, y_u)                                      (3) distortion, mm in the detector plane x_f
//     = x_d / p_x + c_x,         y_f = y_d / p_y + c_y          (4) mm -> pixels
//
// Equation 1, the rigid motion from the world to the imager, is the pose imager_from_<object>; it is not part of the
// CArm. Frame `imager`: origin at the X-ray source, +z toward the detector, x along columns, y down the rows, mm. PIXEL
// CENTRES ARE AT INTEGER COORDINATES; (0, 0) is the centre of the first pixel. This is the one place that says so.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "core/base/result.h"
#include "core/geometry/rigid3.h"
#include "core/imaging/distortion.h"

namespace fluorocut {

struct CArm {
    std::string name = "C-arm";
    int columns = 512;
    int rows = 512;
    Vector2 pixel_mm{0.32, 0.32};                  // (p_x, p_y), at the detector
    double focal_length_mm = 1000;                 // source to detector
    Vector2 principal_point_px{255.5, 255.5};      // (c_x, c_y)
    std::shared_ptr<const Distortion> distortion;  // null: none

    // Names the field, the value and the limit.
    Result<void> validate() const;

    // Pixel coordinates of a point in front of the source (z > 0; otherwise both are NaN).
    Vector2 project(const Vector3& point_in_imager) const;
    // Ideal (undistorted) pixel coordinates: equations 2 and 4 alone.
    Vector2 projectIdeal(const Vector3& point_in_imager) const;
    // Where the ray through a (distorted) pixel meets the detector, in the imager frame: (x_u, y_u, f).
    Vector3 detectorPoint(const Vector2& pixel) const;
    // Unit vector from the source through a (distorted) pixel, in the imager frame.
    Vector3 rayDirection(const Vector2& pixel) const { return detectorPoint(pixel).normalized(); }

    // Pixel coordinates with and without distortion.
    Vector2 idealPixel(const Vector2& distorted_px) const;
    Vector2 distortedPixel(const Vector2& ideal_px) const;
    // ideal_px[x] = idealPixel({x, y}) for the pixels of a row.
    void idealRow(int y, std::span<Vector2> ideal_px) const;
    PixelGrid pixelGrid() const { return {columns, rows, pixel_mm, principal_point_px}; }

    // The same imager without its distortion.
    CArm ideal() const;
    // The same imager with factor x factor pixels averaged into one: pixel centres move by (factor - 1) / 2.
    CArm binned(int factor) const;
    // The part of the image that starts at (x, y): a region of interest.
    CArm cropped(int x, int y, int width, int height) const;
};

}  // namespace fluorocut
