#include "core/distortion/distortion_map.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <fmt/format.h>

#include "core/distortion/models/groove_data.h"
#include "core/distortion/models/table_model.h"

namespace fluorocut {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kFallbacsteps = 64;    // of the table that stands in for a model with holes
constexpr double kMarginPitches = 0.5;  // of the support beyond the outermost points

}  // namespace

Result<DistortionMap> DistortionMap::create(DistortionMapParts parts) {
    if (!parts.model || parts.columns < 1 || parts.rows < 1 || !(parts.pixel_mm > 0) || !(parts.pitch_mm > 0) ||
        parts.support.radii().empty()) {
        throw std::logic_error("DistortionMap: a part is missing");
    }
    DistortionMap map;
    map.rotation_ = parts.detector_from_plate.rotation();
    map.parts_ = std::move(parts);
    const DistortionModel& model = map.model();
    if (model.answersEverywhere()) return map;
    map.fallback_ = TableModel::sampled(
        map.columns(), map.rows(), std::max(map.columns(), map.rows()) / kFallbacsteps,
        [&](const Vector2& pixel) { return model.plateFromPixel(pixel); },
        [](const Vector2&) { return Matrix2::Zero(); });
    if (!map.fallback_) {
        return noSolution("distortion model " + std::string(model.name()),
                          "an answer for less than a fifth of the image", "more",
                          "show more of the plate, or take the model \"polynomial\"");
    }
    return map;
}

DistortionMap DistortionMap::measured(std::optional<CArmPosition> position, std::string measured_at) const {
    DistortionMap map = *this;
    map.parts_.position = std::move(position);
    map.parts_.measured_at = std::move(measured_at);
    return map;
}

// Shift to (0, 0) and turn to the identity in the middle of the image.
void DistortionMap::placeDetector(double pixel_mm) {
    const Matrix2 jacobian = rotation_.transpose() * detectorJacobian(middle());
    // The rotation closest to J is that by atan2(J21 - J12, J11 + J22); it is undone.
    PlaneMotion& motion = parts_.detector_from_plate;
    motion.rotation_rad = -std::atan2(jacobian(1, 0) - jacobian(0, 1), jacobian(0, 0) + jacobian(1, 1));
    motion.shift_mm = -(motion.rotation() * plateFromPixel(middle()));
    rotation_ = motion.rotation();
    parts_.pixel_mm = std::isnan(pixel_mm) ? std::sqrt(std::abs(jacobian.determinant())) : pixel_mm;
}

bool DistortionMap::covers(const Vector2& pixel, double margin_px) const {
    if (!parts_.support.contains(pixel, margin_px)) return false;
    return model().answersEverywhere() || model().plateFromPixel(pixel).allFinite();
}

Vector2 DistortionMap::plateFromPixel(const Vector2& pixel) const {
    const DistortionModel& answers = smoothModel();
    if (!pixel.allFinite()) return Vector2::Constant(kNaN);
    if (parts_.support.contains(pixel)) return answers.plateFromPixel(pixel);
    const Vector2 rim = parts_.support.rimToward(pixel);
    return answers.plateFromPixel(rim) + answers.jacobian(rim) * (pixel - rim);
}

Vector2 DistortionMap::detectorFromPixel(const Vector2& pixel) const {
    return rotation_ * plateFromPixel(pixel) + parts_.detector_from_plate.shift_mm;
}

Matrix2 DistortionMap::detectorJacobian(const Vector2& pixel) const {
    if (!pixel.allFinite()) return Matrix2::Constant(kNaN);
    const bool inside = parts_.support.contains(pixel);
    return rotation_ * smoothModel().jacobian(inside ? pixel : parts_.support.rimToward(pixel));
}

Matrix2 DistortionMap::covariance(const Vector2& pixel) const {
    if (!pixel.allFinite()) return Matrix2::Constant(kNaN);
    const bool inside = parts_.support.contains(pixel);
    return rotation_ * model().covariance(inside ? pixel : parts_.support.rimToward(pixel)) * rotation_.transpose();
}

DistortionMap::Linear DistortionMap::linearised(const Vector2& pixel) const {
    const bool inside = parts_.support.contains(pixel);
    const Vector2 at = inside ? pixel : parts_.support.rimToward(pixel);
    const Matrix2 jacobian = rotation_ * smoothModel().jacobian(at);
    return {
        rotation_ * smoothModel().plateFromPixel(at) + jacobian * (pixel - at) + parts_.detector_from_plate.shift_mm,
        jacobian};
}

Vector2 DistortionMap::pixelFromDetector(const Vector2& detector_mm) const {
    // Far below 1e-9 mm, above the rounding of the sums behind it.
    return pixelFromDetector(detector_mm, middle() + detector_mm / parts_.pixel_mm, 1e-12 * (1 + detector_mm.norm()));
}

Vector2 DistortionMap::pixelFromDetector(const Vector2& detector_mm, const Vector2& guess_px,
                                         double tolerance_mm) const {
    if (!detector_mm.allFinite() || !guess_px.allFinite()) return Vector2::Constant(kNaN);
    Vector2 pixel = guess_px;
    Linear at = linearised(pixel);
    Vector2 miss = at.detector_mm - detector_mm;
    // Beyond the rim the Jacobian is the rim's and convergence only linear; the map is close to a similarity, so it is
    // quick all the same. A step that makes it worse is halved.
    for (int iteration = 0; iteration < 100 && !(miss.norm() <= tolerance_mm); ++iteration) {
        Vector2 step = at.jacobian.inverse() * miss;
        const double before = miss.norm();
        for (int half = 0; half < 30; ++half, step *= 0.5) {
            at = linearised(pixel - step);
            miss = at.detector_mm - detector_mm;
            if (miss.norm() < before) break;
        }
        if (!(miss.norm() < before)) break;  // at rounding
        pixel -= step;
    }
    return pixel;
}

Vector2 DistortionMap::idealPixel(const Vector2& pixel) const {
    return middle() + detectorFromPixel(pixel) / parts_.pixel_mm;
}

Vector2 DistortionMap::distortedPixel(const Vector2& ideal_px) const {
    return pixelFromDetector((ideal_px - middle()) * parts_.pixel_mm);
}

void DistortionMap::detectorRow(const Vector2& first, double step, std::span<Vector2> detector_mm) const {
    // The support's part of a row in one piece of the model's batch call; pixel by pixel beyond.
    const auto at = [&](std::size_t i) { return Vector2(first + Vector2(step * static_cast<double>(i), 0)); };
    std::size_t i = 0;
    while (i < detector_mm.size()) {
        std::size_t end = i;
        while (end < detector_mm.size() && parts_.support.contains(at(end)))
            ++end;
        smoothModel().plateFromRow(at(i), step, detector_mm.subspan(i, end - i));
        for (; i < end; ++i)
            detector_mm[i] = rotation_ * detector_mm[i] + parts_.detector_from_plate.shift_mm;
        for (; i < detector_mm.size() && !parts_.support.contains(at(i)); ++i)
            detector_mm[i] = detectorFromPixel(at(i));
    }
}

namespace {

std::vector<Vector2> usedPixels(const std::vector<GroovePoint>& points, const std::vector<char>& used) {
    std::vector<Vector2> pixels;
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (used[i]) pixels.push_back(points[i].pixel);
    }
    return pixels;
}

// A map must not fold over or stretch one way out of all reason: the worst of its Jacobians over the support.
Result<void> requireSound(const DistortionMap& map) {
    const double scale = std::sqrt(map.detectorJacobian(map.middle()).determinant());
    const Support& support = map.parts().support;
    for (const double share : {0.0, 0.3, 0.6, 0.8, 0.9, 1.0}) {
        for (const Vector2& rim : support.polygon()) {
            const Vector2 pixel = support.centre() + share * (rim - support.centre());
            const Matrix2 jacobian = map.detectorJacobian(pixel);
            const Vector2 stretch = jacobian.jacobiSvd().singularValues() / scale;
            if (!(jacobian.determinant() > 0 && stretch[0] < 2 && stretch[1] > 0.5)) {
                return noSolution(
                    "distortion fit",
                    fmt::format("a map that folds or stretches at pixel ({:.0f}, {:.0f})", pixel.x(), pixel.y()),
                    "a scale within a factor of 2 of that in the middle",
                    "take a lower order, or an image that shows more of the plate");
            }
        }
    }
    return {};
}

DistortionQuality qualityOf(const DistortionMap& map, const GroovePoints& points, const FittedModel& fitted) {
    DistortionQuality quality;
    quality.warnings = fitted.warnings;
    quality.coverage = coverage(map);
    double sum_mm = 0, sum_px = 0;
    const GrooveResiduals residuals = grooveResiduals(map, points);
    for (const int axis : {0, 1}) {
        const std::vector<GroovePoint>& all = axis == 0 ? points.along_y : points.along_x;
        const std::vector<double>& misses = axis == 0 ? residuals.along_y_mm : residuals.along_x_mm;
        const std::vector<char>& used = axis == 0 ? fitted.used_along_y : fitted.used_along_x;
        std::set<int> grooves;
        for (std::size_t i = 0; i < all.size(); ++i) {
            if (!used[i]) {
                ++quality.points_rejected;
                continue;
            }
            ++quality.points_used;
            grooves.insert(all[i].index);
            sum_mm += misses[i] * misses[i];
            // mm per pixel in the direction the point was measured in; the gradient's length is near it.
            const double slope = map.detectorJacobian(all[i].pixel).row(axis).norm();
            sum_px += misses[i] * misses[i] / (slope * slope);
        }
        (axis == 0 ? quality.columns_found : quality.rows_found) = static_cast<int>(grooves.size());
    }
    quality.rms_mm = std::sqrt(sum_mm / quality.points_used);
    quality.rms_px = std::sqrt(sum_px / quality.points_used);
    return quality;
}

}  // namespace

Result<DistortionMap> fitDistortion(const GroovePoints& points, const DistortionFitOptions& options,
                                    Progress& progress) {
    if (const Result<void> good = options.validate(); !good) return good.error();
    const Result<FittedModel> fitted = findDistortionModel(options.model)->fit(points, options, progress);
    if (!fitted) return fitted.error();

    DistortionMapParts parts;
    parts.model = fitted->model;
    parts.columns = points.columns;
    parts.rows = points.rows;
    parts.pitch_mm = points.pitch_mm;
    parts.pixel_mm = roughScale(points);
    const Result<Support> support = Support::around(
        {usedPixels(points.along_y, fitted->used_along_y), usedPixels(points.along_x, fitted->used_along_x)},
        kMarginPitches * points.pitch_mm / parts.pixel_mm);
    if (!support) return support.error();
    parts.support = *support;
    Result<DistortionMap> map = DistortionMap::create(std::move(parts));
    if (!map) return map;
    map->placeDetector(options.pixel_mm);
    if (const Result<void> sound = requireSound(*map); !sound) return sound.error();
    map->parts_.quality = qualityOf(*map, points, *fitted);
    return map;
}

double coverage(const DistortionMap& map) {
    const int step = std::max(1, std::max(map.columns(), map.rows()) / 100);
    int covered = 0, all = 0;
    for (int y = step / 2; y < map.rows(); y += step) {
        for (int x = step / 2; x < map.columns(); x += step, ++all)
            covered += map.covers(Vector2(x, y));
    }
    return all == 0 ? kNaN : static_cast<double>(covered) / all;
}

GrooveResiduals grooveResiduals(const DistortionMap& map, const GroovePoints& points) {
    GrooveResiduals residuals;
    for (const GroovePoint& point : points.along_y)
        residuals.along_y_mm.push_back(map.plateFromPixel(point.pixel).x() - point.index * points.pitch_mm);
    for (const GroovePoint& point : points.along_x)
        residuals.along_x_mm.push_back(map.plateFromPixel(point.pixel).y() - point.index * points.pitch_mm);
    return residuals;
}

namespace {

class MapDistortion final : public Distortion {
  public:
    MapDistortion(const DistortionMap& map, const CArm& carm)
        : map_(map),
          pixel_mm_(carm.pixel_mm),
          principal_px_(carm.principal_point_px),
          principal_mm_((carm.principal_point_px - map.middle()).cwiseProduct(carm.pixel_mm)) {}

    Vector2 distorted(const Vector2& undistorted_mm) const override {
        const Vector2 pixel = map_.pixelFromDetector(undistorted_mm + principal_mm_);
        return (pixel - principal_px_).cwiseProduct(pixel_mm_);
    }
    Vector2 undistorted(const Vector2& distorted_mm) const override {
        return map_.detectorFromPixel(distorted_mm.cwiseQuotient(pixel_mm_) + principal_px_) - principal_mm_;
    }
    void undistortedRow(const Vector2& first_mm, double step_mm, std::span<Vector2> undistorted_mm) const override {
        const Vector2 first = first_mm.cwiseQuotient(pixel_mm_) + principal_px_;
        map_.detectorRow(first, step_mm / pixel_mm_.x(), undistorted_mm);
        for (Vector2& point : undistorted_mm)
            point -= principal_mm_;
    }
    const DistortionMap& map() const { return map_; }

  private:
    DistortionMap map_;
    Vector2 pixel_mm_, principal_px_, principal_mm_;
};

}  // namespace

Result<std::shared_ptr<const Distortion>> distortionOf(const DistortionMap& map, const CArm& carm) {
    if (carm.columns != map.columns() || carm.rows != map.rows()) {
        return invalidInput("distortion map", fmt::format("a map of {} x {} pixels", map.columns(), map.rows()),
                            fmt::format("{} x {}, as the C-arm has", carm.columns, carm.rows));
    }
    for (int axis = 0; axis < 2; ++axis) {
        if (!(std::abs(carm.pixel_mm[axis] / map.pixelMm() - 1) <= 0.1)) {
            return invalidInput("distortion map", fmt::format("pixel_mm {:.4f}", map.pixelMm()),
                                fmt::format("within 10 % of the C-arm's {:.4f}", carm.pixel_mm[axis]),
                                "take the map of this C-arm, or correct pixel_mm in the C-arm's file");
        }
    }
    return std::shared_ptr<const Distortion>(std::make_shared<MapDistortion>(map, carm));
}

const DistortionMap* mapOf(const Distortion& distortion) {
    const auto* of_map = dynamic_cast<const MapDistortion*>(&distortion);
    return of_map ? &of_map->map() : nullptr;
}

DistortionReaders distortionReaders() {
    return {{"fluorocut/distortion/1",
             [](const std::filesystem::path& path, const CArm& carm) -> Result<std::shared_ptr<const Distortion>> {
                 const Result<DistortionMap> map = readDistortionMap(path);
                 if (!map) return map.error();
                 Result<std::shared_ptr<const Distortion>> distortion = distortionOf(*map, carm);
                 if (!distortion) {
                     Error error = distortion.error();
                     error.where = "distortion file " + path.string();
                     return error;
                 }
                 return distortion;
             }}};
}

}  // namespace fluorocut
