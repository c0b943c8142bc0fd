// DistortionModel: where on the plate (mm) a pixel of the distorted image lies: what a fit to groove points leaves.
//
// Pixels are (u, v) of the distorted image, centres at integers; the plate's frame is that of the groove points
// (core/distortion/groove_points.h). A model answers with NaN where it has no answer; whether an answer is supported by
// points nearby is another question, which DistortionMap::covers answers.
//
// The models:
//   polynomial           one global polynomial in the Bernstein basis, robustly fitted to all points (the default)
//   bernstein            the paper's: a 5th-order Bernstein polynomial per groove (eq. 5), cubic splines across them
//   thin-plate-spline    a smoothing thin-plate regression spline
//   table                bicubic B-splines on a coarse grid: maps that were computed from others, not fitted to points
//
// To add one: a pair of files in models/ with a class that implements this interface, a function that fits it to
// GroovePoints and a function that reads `parameters` back; then one line in distortion_model.cpp. The contract test
// (tests/core/distortion/distortion_model_test.cpp) then runs over it: accuracy, jacobian, covariance, file.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/distortion/groove_points.h"
#include "core/geometry/rigid3.h"
#include "core/io/json_file.h"

namespace fluorocut {

struct DistortionFitOptions {
    std::string model = "polynomial";  // one of those that can be fitted
    // Of the polynomial, 1 to 9. 0: chosen from the points; on simulated intensifiers that is a third better than
    // always 5.
    int order = 0;
    // Of the straight image; NaN: the scale in the middle of the distorted one.
    double pixel_mm = std::numeric_limits<double>::quiet_NaN();

    // Names the field, the value and the limit.
    Result<void> validate() const;
};

class DistortionModel {
  public:
    virtual ~DistortionModel() = default;
    virtual std::string_view name() const = 0;

    virtual Vector2 plateFromPixel(const Vector2& pixel) const = 0;
    // d plate / d pixel, mm per pixel.
    virtual Matrix2 jacobian(const Vector2& pixel) const = 0;
    // Of plateFromPixel, mm^2: what the points' noise, as the residuals show it, does to the answer.
    virtual Matrix2 covariance(const Vector2& pixel) const = 0;
    // plate[i] = plateFromPixel(first + i * (step, 0)): rows of pixels, quickly.
    virtual void plateFromRow(const Vector2& first, double step, std::span<Vector2> plate) const;
    // A smooth answer for every pixel of the image and some way beyond (good or not); otherwise there may be holes.
    virtual bool answersEverywhere() const = 0;

    // What its file holds of it under "parameters", and what read() gets back: fields of numbers, in this order.
    using Fields = std::vector<std::pair<std::string, std::vector<double>>>;
    virtual Fields parameters() const = 0;
};

struct FittedModel {
    std::shared_ptr<const DistortionModel> model;
    std::vector<char> used_along_y, used_along_x;  // per point: 0 when it was rejected
    std::vector<std::string> warnings;             // sentences for the person at the screen
};

struct DistortionModelKind {
    std::string_view name;
    std::string_view summary;
    // Null: not fitted to points. noSolution, in words, when the points are too few or too unevenly spread.
    Result<FittedModel> (*fit)(const GroovePoints&, const DistortionFitOptions&, Progress&);
    // What is wrong is told to `parameters`; then null comes back.
    std::shared_ptr<const DistortionModel> (*read)(JsonObject& parameters);
};

// Every model there is.
const std::vector<DistortionModelKind>& distortionModels();
// Null when there is none of this name.
const DistortionModelKind* findDistortionModel(std::string_view name);

}  // namespace fluorocut
