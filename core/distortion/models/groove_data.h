// What the models' fits share: groove points as the values of one coordinate at pixels.
#pragma once

#include <array>
#include <span>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "core/base/result.h"
#include "core/distortion/groove_points.h"
#include "core/distortion/models/robust_fit.h"
#include "core/io/json_file.h"

namespace fluorocut {

struct GrooveData {
    std::vector<Vector2> pixels;
    Eigen::VectorXd values_mm;  // index * pitch
    Eigen::VectorXd sigmas_mm;
    int grooves = 0;  // different ones

    Eigen::Index size() const { return values_mm.size(); }
    GrooveData only(const std::vector<char>& used) const;
};

// x from the grooves along y, y from those along x. noSolution, in words, for fewer than 4 grooves or 20 points of
// either; throws std::logic_error for points that are not finite, without a sigma, or without a pitch or image size.
Result<std::array<GrooveData, 2>> grooveData(const GroovePoints& points);

// Which points agree with one smooth surface: a robust polynomial, of order 5 if the points carry it.
RobustFit agreeingPoints(const GroovePoints& points, const GrooveData& data);

// mm per pixel across the grooves, roughly: from planes through the points.
double roughScale(const GroovePoints& points);

// A whole number that a model's parameters hold as an array of one. least - 1 when it has failed.
int wholeNumber(JsonObject& parameters, std::string_view field, int least, int most);

// Upper triangular matrices as they stand in files: row by row from the diagonal.
std::vector<double> packedUpper(const Eigen::MatrixXd& upper);
Eigen::MatrixXd unpackedUpper(std::span<const double> packed, Eigen::Index size);
Eigen::MatrixXd readUpper(JsonObject& parameters, std::string_view field, int size);

// The highest degree of a polynomial in two variables for which there are 3 points to each coefficient.
int highestDegree(Eigen::Index points);

}  // namespace fluorocut
