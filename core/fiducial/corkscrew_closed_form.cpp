#include "core/fiducial/corkscrew_closed_form.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "core/base/median.h"
#include "core/fiducial/corkscrew_refinement/fit_support.h"
#include "core/image/blur.h"

namespace fluorocut {
namespace {

using namespace corkscrew;

constexpr const char* kStep = "corkscrew, closed form";
constexpr double kReachPx = 5;        // to either side of where a wire is expected
constexpr double kMajorPrior = 0.05;  // relative: seen edge on, a ring does not tell how far it reaches
constexpr double kPointPx = 0.3;      // of a measured point, against that
constexpr std::size_t kLeastRingPoints = 6, kLeastShaftPoints = 8, kLeastHelixPoints = 12;
constexpr double kTurn = 2 * std::numbers::pi;
constexpr int kTwists = 120;
constexpr std::size_t kMostHelixPoints = 100;

struct Line {
    Vector2 point, direction;
};

// Total least squares, points far off left out step by step.
Line lineThrough(const std::vector<Vector2>& points, const Vector2& along) {
    std::vector<double> weights(points.size(), 1.0);
    Line line{Vector2::Zero(), along};
    for (int pass = 0; pass < 6; ++pass) {
        Vector2 mean = Vector2::Zero();
        double sum = 0;
        for (std::size_t i = 0; i < points.size(); ++i) {
            mean += weights[i] * points[i];
            sum += weights[i];
        }
        mean /= sum;
        Matrix2 scatter = Matrix2::Zero();
        for (std::size_t i = 0; i < points.size(); ++i)
            scatter += weights[i] * (points[i] - mean) * (points[i] - mean).transpose();
        const double angle = 0.5 * std::atan2(2 * scatter(0, 1), scatter(0, 0) - scatter(1, 1));
        const Vector2 direction(std::cos(angle), std::sin(angle));
        line = {mean, direction.dot(along) < 0 ? Vector2(-direction) : direction};
        const Vector2 normal(-line.direction.y(), line.direction.x());
        std::vector<double> off;
        for (const Vector2& point : points)
            off.push_back(std::abs((point - mean).dot(normal)));
        const double scale = std::max(1.4826 * median(off), 0.02);
        for (std::size_t i = 0; i < points.size(); ++i)
            weights[i] = tukeyWeight(off[i], scale) + 1e-9;
    }
    return line;
}

// One measured point of a ring: what it says of its ellipse, across the wire.
struct RingPoint {
    std::size_t ring = 0;
    Vector2 seen, across;  // in the frame (along, across) of the line, mm
    double cosine = 0, sine = 0;
};

// Unknowns: major, signed minor, places; linear, since a point counts across its wire only.
Eigen::VectorXd fittedEllipses(const std::vector<RingPoint>& points, const CorkscrewLayout& layout,
                               double expected_major_mm, double point_mm) {
    const auto rings = static_cast<Eigen::Index>(layout.rings.size());
    Eigen::VectorXd solution = Eigen::VectorXd::Zero(2 + rings);
    std::vector<double> weights(points.size(), 1.0);
    for (int pass = 0; pass < 5; ++pass) {
        Eigen::MatrixXd normal = 1e-9 * Eigen::MatrixXd::Identity(2 + rings, 2 + rings);
        Eigen::VectorXd right = Eigen::VectorXd::Zero(2 + rings);
        const double prior = std::pow(point_mm / (kMajorPrior * expected_major_mm), 2);
        normal(0, 0) += prior;
        right(0) += prior * expected_major_mm;
        std::vector<double> rows(points.size());
        const auto row = [&](const RingPoint& point) {
            const double size = layout.rings[point.ring].radius_mm / layout.rings.front().radius_mm;
            Eigen::VectorXd g = Eigen::VectorXd::Zero(2 + rings);
            g(0) = size * point.across.y() * point.cosine;
            g(1) = size * point.across.x() * point.sine;
            g(2 + static_cast<Eigen::Index>(point.ring)) = point.across.x();
            return g;
        };
        for (std::size_t i = 0; i < points.size(); ++i) {
            const Eigen::VectorXd g = row(points[i]);
            normal += weights[i] * g * g.transpose();
            right += weights[i] * points[i].across.dot(points[i].seen) * g;
        }
        solution = normal.ldlt().solve(right);
        std::vector<double> off;
        for (const RingPoint& point : points)
            off.push_back(std::abs(point.across.dot(point.seen) - row(point).dot(solution)));
        const double scale = std::max(1.4826 * median(off), 0.02);
        for (std::size_t i = 0; i < points.size(); ++i)
            weights[i] = tukeyWeight(off[i], scale);
    }
    return solution;
}

Error tooLittle(std::string found, std::string expected) {
    return noSolution(kStep, std::move(found), std::move(expected), "give a pose nearer to the corkscrew's");
}

// Points of the helix, mm of the object along and across the line, against the helix of a twist and roll.
class HelixMatch {
  public:
    HelixMatch(std::vector<Vector2> seen, const CorkscrewHelix& helix) : seen_(std::move(seen)) {
        for (std::size_t i = 0; i <= kPieces; ++i)
            curve_.push_back(helix.point(static_cast<double>(i) / kPieces));
    }

    // Mean square of the distances, those beyond kFarMm as kFarMm.
    double misfit(double twist_rad, double roll_rad) const {
        const Matrix3 turn = Rigid3::fromTwistRollPitch(twist_rad, roll_rad, 0).rotationMatrix();
        std::array<Vector2, kPieces + 1> drawn;
        for (std::size_t i = 0; i < drawn.size(); ++i)
            drawn[i] = (turn * curve_[i]).head<2>();
        double sum = 0;
        for (const Vector2& point : seen_) {
            double least = kFarMm * kFarMm;
            for (std::size_t i = 0; i < kPieces; ++i) {
                const Vector2 piece = drawn[i + 1] - drawn[i], away = point - drawn[i];
                const double part = std::clamp(away.dot(piece) / piece.squaredNorm(), 0.0, 1.0);
                least = std::min(least, (away - part * piece).squaredNorm());
            }
            sum += least;
        }
        return sum / static_cast<double>(seen_.size());
    }

    // Least misfit within `reach` of a twist: golden section.
    double bestTwist(double twist_rad, double roll_rad, double reach_rad) const {
        const double golden = 0.5 * (std::sqrt(5.0) - 1);
        double low = twist_rad - reach_rad, high = twist_rad + reach_rad;
        for (int step = 0; step < 24; ++step) {
            const double a = high - golden * (high - low), b = low + golden * (high - low);
            const bool left = misfit(a, roll_rad) < misfit(b, roll_rad);
            (left ? high : low) = left ? b : a;
        }
        return 0.5 * (low + high);
    }

  private:
    static constexpr std::size_t kPieces = 90;
    static constexpr double kFarMm = 2;
    std::vector<Vector2> seen_;
    std::vector<Vector3> curve_;
};

}  // namespace

Result<CorkscrewFeatures> measureCorkscrewFeatures(const Image& image, const CArm& carm, const CorkscrewLayout& layout,
                                                   const Rigid3& near) {
    if (const auto good = checkInputs(kStep, image, carm, layout, near); !good) return good.error();
    const PixelRegion whole{0, 0, image.width(), image.height()};
    const LogImage seen{whole, gaussianBlurred(logarithm(image, whole), kLastSmoothingPx)};
    const SeenLines lines = findLines(seen, carm, layout, wirePoints(layout), shaftPoints(layout), near, kReachPx);
    const auto placeOf = [&](const SeenPoint& point) {
        const Vector2 pixel = point.place + point.offset_px * point.across;
        return Vector2((pixel - carm.principal_point_px).cwiseProduct(carm.pixel_mm));
    };

    std::vector<Vector2> shaft;
    for (const SeenPoint& point : lines.shaft)
        shaft.push_back(placeOf(point));
    if (shaft.size() < kLeastShaftPoints) {
        return tooLittle(fmt::format("the shaft seen at {} places", shaft.size()),
                         fmt::format("at least {}", kLeastShaftPoints));
    }
    CorkscrewFeatures features;
    const Vector3 axis = near.rotate(Vector3::UnitX()), origin = near.translation();
    const Line line = lineThrough(shaft, axis.head<2>() - origin.head<2>() / origin.z() * axis.z());
    features.line_point_mm = line.point;
    features.line_direction = line.direction;
    const Vector2 normal(-line.direction.y(), line.direction.x());

    // A ring's point at angle a is at cos a across the line and sin a along it: a from the pose nearby, which only
    // moves it along its wire.
    const Matrix3 turn = near.rotationMatrix();
    const Vector3 side(normal.x(), normal.y(), 0);
    const Vector3 across_axis = (side - side.dot(axis) * axis).normalized(), depth_axis = axis.cross(across_axis);
    std::vector<RingPoint> ring_points;
    std::vector<std::size_t> per_ring(layout.rings.size(), 0);
    for (const SeenPoint& point : lines.wire) {
        const Vector2 place = placeOf(point);
        const auto ring = std::find_if(layout.rings.begin(), layout.rings.end(), [&](const CorkscrewRing& one) {
            return std::abs(one.x_mm - point.point.x()) < 1e-9;
        });
        if (ring == layout.rings.end()) {
            features.helix_mm.push_back(place);
            continue;
        }
        RingPoint one;
        one.ring = static_cast<std::size_t>(ring - layout.rings.begin());
        one.seen = {(place - line.point).dot(line.direction), (place - line.point).dot(normal)};
        const Vector2 across = point.across.cwiseProduct(carm.pixel_mm).normalized();
        one.across = {across.dot(line.direction), across.dot(normal)};
        const Vector3 radial = turn * Vector3(0, point.point.y(), point.point.z()) / ring->radius_mm;
        one.cosine = radial.dot(across_axis);
        one.sine = radial.dot(depth_axis);
        ring_points.push_back(one);
        ++per_ring[one.ring];
    }
    const auto good_rings =
        std::count_if(per_ring.begin(), per_ring.end(), [](std::size_t points) { return points >= kLeastRingPoints; });
    if (good_rings < 2) return tooLittle(fmt::format("{} rings", good_rings), "at least two");
    const double expected_mm = layout.rings.front().radius_mm * carm.focal_length_mm / origin.z();
    const double point_mm = kPointPx * carm.pixel_mm.mean();
    const Eigen::VectorXd ellipses = fittedEllipses(ring_points, layout, expected_mm, point_mm);
    features.major_mm = std::abs(ellipses(0));
    features.minor_mm = std::min(std::abs(ellipses(1)), features.major_mm);
    for (std::size_t i = 0; i < per_ring.size(); ++i) {
        features.ring_places_mm.push_back(per_ring[i] >= kLeastRingPoints ? ellipses(2 + static_cast<Eigen::Index>(i))
                                                                          : std::numeric_limits<double>::quiet_NaN());
    }
    return features;
}

Result<Rigid3> closedFormCorkscrewPose(const CorkscrewFeatures& features, const CorkscrewLayout& layout,
                                       double focal_length_mm) {
    if (const auto good = layout.validate(); !good) return good.error();
    if (features.ring_places_mm.size() != layout.rings.size()) {
        return invalidInput(kStep, fmt::format("places of {} rings", features.ring_places_mm.size()),
                            fmt::format("{}, as the layout has", layout.rings.size()));
    }
    if (!(features.major_mm > 0 && features.minor_mm >= 0 && features.minor_mm <= features.major_mm)) {
        return invalidInput(
            kStep, fmt::format("ellipses of half axes {:.4g} and {:.4g} mm", features.major_mm, features.minor_mm),
            "a positive major axis and a minor one no longer than it");
    }
    if (features.helix_mm.size() < kLeastHelixPoints) {
        return tooLittle(fmt::format("{} points of the helix", features.helix_mm.size()),
                         fmt::format("at least {}", kLeastHelixPoints));
    }
    // place = start + slope x, by least squares.
    double count = 0, mean_x = 0, mean_place = 0, covariance = 0, variance = 0;
    for (int pass = 0; pass < 2; ++pass) {
        for (std::size_t i = 0; i < layout.rings.size(); ++i) {
            const double x = layout.rings[i].x_mm, place = features.ring_places_mm[i];
            if (!std::isfinite(place)) continue;
            if (pass == 0) {
                count += 1;
                mean_x += x;
                mean_place += place;
            } else {
                covariance += (x - mean_x) * (place - mean_place);
                variance += (x - mean_x) * (x - mean_x);
            }
        }
        if (count < 2) return tooLittle(fmt::format("{:.0f} rings", count), "at least two");
        if (pass == 0) {
            mean_x /= count;
            mean_place /= count;
        }
    }
    const double slope = covariance / variance;
    const double roll = std::asin(features.minor_mm / features.major_mm), cosine = std::cos(roll);
    const double k = cosine / slope;
    if (!(k > 0.01 && k < 1)) {
        return tooLittle(fmt::format("rings at {:.3g} of the focal length", k), "between source and detector");
    }
    const Vector2 along = features.line_direction.normalized(), across(-along.y(), along.x());
    const Vector2 origin = features.line_point_mm + (mean_place - slope * mean_x) * along;

    std::vector<Vector2> seen;
    const std::size_t stride = features.helix_mm.size() / kMostHelixPoints + 1;
    for (std::size_t i = 0; i < features.helix_mm.size(); i += stride) {
        const Vector2 place = k * (features.helix_mm[i] - origin);
        seen.emplace_back(place.dot(along), place.dot(across));
    }
    const HelixMatch match(std::move(seen), layout.helix);
    double least = std::numeric_limits<double>::infinity(), twist = 0, signed_roll = roll;
    for (const double sign : {1.0, -1.0}) {
        for (int i = 0; i < kTwists; ++i) {
            const double here = i * kTurn / kTwists, misfit = match.misfit(here, sign * roll);
            if (misfit < least) {
                least = misfit;
                twist = here;
                signed_roll = sign * roll;
            }
        }
    }
    twist = match.bestTwist(twist, signed_roll, kTurn / kTwists);
    const double pitch = std::atan2(along.y(), along.x());
    return Rigid3(Rigid3::fromTwistRollPitch(twist, signed_roll, pitch).rotation(),
                  Vector3(k * origin.x(), k * origin.y(), k * focal_length_mm));
}

}  // namespace fluorocut
