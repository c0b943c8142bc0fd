// The view of a C-arm in the index coordinates of a volume: where the source is and where a pixel's ray ends. What the
// projectors share.
//
// Index coordinates: voxel (i, j, k) has its centre at (i, j, k); a step of 1 along axis a is spacing_mm[a] long.
#pragma once

#include <memory>
#include <vector>

#include "core/geometry/rigid3.h"
#include "core/image/volume.h"
#include "core/imaging/carm.h"

namespace fluorocut {

// Where the pixels of a distorted imager lie in the ideal image.
struct IdealPixels {
    std::vector<Eigen::Vector2f> pixels;  // row by row
    Vector2 low, high;                    // the box round those that are known
};

struct ProjectionGeometry {
    int columns = 0;
    int rows = 0;
    Vector3 spacing_mm;
    Vector3 source;                                   // index coordinates
    Vector3 corner;                                   // the detector point of ideal pixel (0, 0), index coordinates
    Vector3 step_column;                              // its change for one pixel along a row
    Vector3 step_row;                                 // ... and down a column
    Vector3 central;                                  // the detector point in the middle of the image
    std::shared_ptr<const IdealPixels> ideal_pixels;  // of a distorted imager; null otherwise

    Vector3 detectorPoint(double ideal_x, double ideal_y) const {
        return corner + ideal_x * step_column + ideal_y * step_row;
    }
    // The ideal coordinates of pixel (x, y).
    Eigen::Vector2f idealPixel(int x, int y) const {
        if (!ideal_pixels) return {static_cast<float>(x), static_cast<float>(y)};
        return ideal_pixels
            ->pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(x)];
    }
};

ProjectionGeometry projectionGeometry(const CArm& carm, const Rigid3& imager_from_volume, const VolumeGrid& grid);

}  // namespace fluorocut
