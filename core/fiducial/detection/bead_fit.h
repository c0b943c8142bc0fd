// One bead's shadow fitted in its patch: the model, weights and covariance that bead_detection.h describes. Pixels.
#pragma once

#include <array>
#include <vector>

#include "core/fiducial/detection/bead_background.h"
#include "core/fiducial/detection/bead_profile.h"

namespace fluorocut::detection {

// Of the intensities: variance = constant + per_intensity * intensity; correlation by offset in columns and rows.
struct NoiseModel {
    static constexpr int kReach = 3;
    double constant = 0;
    double per_intensity = 0;
    std::array<std::array<double, 2 * kReach + 1>, 2 * kReach + 1> correlation{};  // [dy + reach][dx + reach]

    // Uncorrelated.
    static NoiseModel white(double constant, double per_intensity);
    double variance(double intensity) const { return constant + per_intensity * intensity; }
};

struct ShapePrior {
    double log_blur = -0.2;  // 0.8 px
    double log_blur_sigma = 0.6;
    double log_steepness = 0.9;  // k = 2.5: 2.6 mm of steel
    double log_steepness_sigma = 1.0;
};

struct BeadFit {
    bool ok = false;
    Vector2 center_px = Vector2::Zero();
    Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Zero();
    BeadShape shape{};
    double depth = 0;        // A
    double depth_sigma = 0;  // of A
    double score = 0;
    // What the fit leaves, for the noise model: residuals and expected intensities of the window, NaN outside of it.
    Image residuals;
    Image expected;
};

// `blurred_product`: with the term blur^2 grad(background) . grad(bead).
BeadFit fitBead(const Image& image, const BackgroundPatch& patch, const Vector2& center_px, const BeadShape& start,
                double start_depth, const ShapePrior& prior, const NoiseModel& noise, bool blurred_product = false);

// Variance and correlation of what many fits left. Falls back on `otherwise` when there is too little.
NoiseModel measureNoise(const std::vector<const BeadFit*>& fits, const NoiseModel& otherwise);

}  // namespace fluorocut::detection
