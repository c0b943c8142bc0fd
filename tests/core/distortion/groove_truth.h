// What detected groove points are worth, against the field the picture was rendered with.
#pragma once

#include <array>
#include <vector>

#include "core/distortion/groove_points.h"
#include "tests/core/distortion/plate_images.h"

namespace fluorocut::test {

struct GrooveTruth {
    // Of all points, after the one motion of the lattice onto itself (a turn by quarters, a mirror image, a shift by
    // whole pitches) that suits them best: largest distance from the groove that the label names, pitches. A single
    // wrong label gives 1 or more.
    double worst_label_error = 0;
    // Measured minus true place across the groove, px, and the same over the stated standard deviation.
    std::vector<double> errors_px;
    std::vector<double> normalized;
    std::array<double, 2> mean_error_px = {0, 0};  // of points on grooves along y, along x
};

GrooveTruth compareWithTruth(const GroovePoints& points, const BentField& field, double pitch_mm);

double rootMeanSquare(const std::vector<double>& values);

}  // namespace fluorocut::test
