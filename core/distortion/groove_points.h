// GroovePoints: where the middle lines of a plate's grooves were seen in one image: what detection hands to the models.
//
// A point of a groove along y says where x = index * pitch_mm is, and nothing about y; a point of a groove along x the
// same for y (core/distortion/grooved_plate.h). Indices count from the crossing nearest to the middle of the image; x
// is the plate's axis nearest to the image's columns (+x within 45 degrees of +u), y the one nearest to its rows (+y
// within 45 degrees of +v). A plate that is seen mirrored looks the same, so the frame is never mirrored.
#pragma once

#include <vector>

#include "core/geometry/rigid3.h"

namespace fluorocut {

struct GroovePoint {
    Vector2 pixel = Vector2::Zero();   // (u, v), pixel centres at integers
    Vector2 across = Vector2::Zero();  // unit vector in the image, across the groove toward larger indices
    int index = 0;                     // which groove
    double sigma_px = 0;               // standard deviation of the place, along `across`
};

struct GroovePoints {
    int columns = 0;  // size of the image
    int rows = 0;
    double pitch_mm = 0;
    std::vector<GroovePoint> along_y;  // each fixes x
    std::vector<GroovePoint> along_x;  // each fixes y
};

}  // namespace fluorocut
