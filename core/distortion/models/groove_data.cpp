#include "core/distortion/models/groove_data.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include <Eigen/QR>
#include <fmt/format.h>

#include "core/distortion/models/triangle_polynomial.h"

namespace fluorocut {
namespace {

constexpr int kLeastGrooves = 4, kLeastPoints = 20;

// mm per pixel along the gradient of a plane through the points' values.
double planeScale(const std::vector<GroovePoint>& points, double pitch_mm) {
    Eigen::MatrixXd design(static_cast<Eigen::Index>(points.size()), 3);
    Eigen::VectorXd values(design.rows());
    for (Eigen::Index i = 0; i < design.rows(); ++i) {
        const GroovePoint& point = points[static_cast<std::size_t>(i)];
        design.row(i) << 1, point.pixel.x(), point.pixel.y();
        values[i] = point.index * pitch_mm;
    }
    const Eigen::VectorXd plane = design.colPivHouseholderQr().solve(values);
    return std::hypot(plane[1], plane[2]);
}

int countGrooves(const std::vector<GroovePoint>& points) {
    std::set<int> indices;
    for (const GroovePoint& point : points)
        indices.insert(point.index);
    return static_cast<int>(indices.size());
}

}  // namespace

GrooveData GrooveData::only(const std::vector<char>& used) const {
    GrooveData result;
    result.grooves = grooves;
    const auto count = std::count_if(used.begin(), used.end(), [](char one) { return one != 0; });
    result.values_mm.resize(count);
    result.sigmas_mm.resize(count);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
        if (!used[i]) continue;
        const auto to = static_cast<Eigen::Index>(result.pixels.size());
        result.values_mm[to] = values_mm[static_cast<Eigen::Index>(i)];
        result.sigmas_mm[to] = sigmas_mm[static_cast<Eigen::Index>(i)];
        result.pixels.push_back(pixels[i]);
    }
    return result;
}

Result<std::array<GrooveData, 2>> grooveData(const GroovePoints& points) {
    if (!(points.pitch_mm > 0) || points.columns < 1 || points.rows < 1) {
        throw std::logic_error("grooveData: no pitch or no image size");
    }
    std::array<GrooveData, 2> data;
    for (std::size_t c = 0; c < 2; ++c) {
        const std::vector<GroovePoint>& from = c == 0 ? points.along_y : points.along_x;
        GrooveData& to = data[c];
        to.grooves = countGrooves(from);
        if (to.grooves < kLeastGrooves || from.size() < kLeastPoints) {
            return noSolution(c == 0 ? "grooves along y" : "grooves along x",
                              fmt::format("{} points on {} grooves", from.size(), to.grooves),
                              fmt::format("at least {} points on {} grooves", kLeastPoints, kLeastGrooves),
                              "move the plate or what hides it so that more of it is seen");
        }
        const double scale = planeScale(from, points.pitch_mm);
        to.values_mm.resize(static_cast<Eigen::Index>(from.size()));
        to.sigmas_mm.resize(static_cast<Eigen::Index>(from.size()));
        for (std::size_t i = 0; i < from.size(); ++i) {
            if (!from[i].pixel.allFinite() || !(from[i].sigma_px > 0 && std::isfinite(from[i].sigma_px))) {
                throw std::logic_error("grooveData: a point that is not finite or without a sigma");
            }
            to.pixels.push_back(from[i].pixel);
            to.values_mm[static_cast<Eigen::Index>(i)] = from[i].index * points.pitch_mm;
            to.sigmas_mm[static_cast<Eigen::Index>(i)] = from[i].sigma_px * scale;
        }
    }
    return data;
}

RobustFit agreeingPoints(const GroovePoints& points, const GrooveData& data) {
    const BernsteinTriangle triangle = BernsteinTriangle::around(points.columns, points.rows);
    const int order = std::min({5, data.grooves - 1, highestDegree(data.size())});
    return fitRobustly(triangle.design(order, data.pixels), data.values_mm, data.sigmas_mm);
}

double roughScale(const GroovePoints& points) {
    return 0.5 * (planeScale(points.along_y, points.pitch_mm) + planeScale(points.along_x, points.pitch_mm));
}

int wholeNumber(JsonObject& parameters, std::string_view field, int least, int most) {
    const std::vector<double> value = parameters.numbers(field, 1);
    if (parameters.failed()) return least - 1;
    if (!(value[0] >= least && value[0] <= most && value[0] == std::floor(value[0]))) {
        parameters.fail(field, fmt::format("{}", value[0]), fmt::format("[a whole number from {} to {}]", least, most));
        return least - 1;
    }
    return static_cast<int>(value[0]);
}

std::vector<double> packedUpper(const Eigen::MatrixXd& upper) {
    std::vector<double> packed;
    for (Eigen::Index i = 0; i < upper.rows(); ++i) {
        for (Eigen::Index j = i; j < upper.cols(); ++j)
            packed.push_back(upper(i, j));
    }
    return packed;
}

Eigen::MatrixXd unpackedUpper(std::span<const double> packed, Eigen::Index size) {
    Eigen::MatrixXd upper = Eigen::MatrixXd::Zero(size, size);
    std::size_t next = 0;
    for (Eigen::Index i = 0; i < size; ++i) {
        for (Eigen::Index j = i; j < size; ++j)
            upper(i, j) = packed[next++];
    }
    return upper;
}

Eigen::MatrixXd readUpper(JsonObject& parameters, std::string_view field, int size) {
    const std::size_t count = static_cast<std::size_t>(size) * static_cast<std::size_t>(size + 1) / 2;
    const std::vector<double> packed = parameters.numbers(field, count);
    return parameters.failed() ? Eigen::MatrixXd() : unpackedUpper(packed, size);
}

int highestDegree(Eigen::Index points) {
    int degree = 0;
    while (3 * BernsteinTriangle::size(degree + 1) <= points)
        ++degree;
    return degree;
}

}  // namespace fluorocut
