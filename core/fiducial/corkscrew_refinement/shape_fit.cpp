#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "core/base/median.h"
#include "core/fiducial/corkscrew_refinement/detector_blur.h"
#include "core/fiducial/corkscrew_refinement/fit_support.h"
#include "core/fiducial/corkscrew_refinement/predicted_image.h"

namespace fluorocut {

using namespace corkscrew;

namespace {

constexpr const char* kStep = "corkscrew, fit of the shape";
constexpr double kMarginPx = 24;
constexpr double kLeastVisible = 0.3;  // of the wires' length
constexpr int kLeastPoints = 12;
constexpr double kGoodScore = 0.8;

struct Look {
    double smoothing_px, reach_px;
};
constexpr std::array<Look, 5> kLooks{{{2.5, 14}, {1.5, 8}, {1.5, 5}, {kLastSmoothingPx, 4}, {kLastSmoothingPx, 4}}};

struct Search {
    const CArm& carm;
    const CorkscrewLayout& layout;
    std::vector<LinePoint> wires;
    std::vector<Vector3> shaft;
    std::vector<LogImage> smoothed;  // as kLooks
};

// Where the lines should go to meet what is seen: robust least squares with full perspective.
Rigid3 moved(const Search& search, const Rigid3& from, const SeenLines& lines) {
    std::vector<const SeenPoint*> points;
    for (const SeenPoint& point : lines.wire)
        points.push_back(&point);
    for (const SeenPoint& point : lines.shaft)
        points.push_back(&point);
    const double focal_px = search.carm.focal_length_mm / search.carm.pixel_mm.mean();
    Rigid3 pose = from;
    std::vector<double> residuals(points.size());
    for (int iteration = 0; iteration < 6; ++iteration) {
        const Matrix3 rotation = pose.rotationMatrix();
        const Vector3 origin = pose.translation();
        std::vector<double> sizes;
        for (std::size_t i = 0; i < points.size(); ++i) {
            const SeenPoint& point = *points[i];
            const Vector2 now = search.carm.projectIdeal(rotation * point.point + origin);
            residuals[i] = point.offset_px - (now - point.place).dot(point.across);
            sizes.push_back(std::abs(residuals[i]));
        }
        const double scale = std::max(1.4826 * median(std::move(sizes)), 0.05);
        Matrix6 normal = Matrix6::Zero();
        Vector6 right = Vector6::Zero();
        double weights = 0;
        for (std::size_t i = 0; i < points.size(); ++i) {
            const double weight = tukeyWeight(residuals[i], scale);
            if (!(weight > 0)) continue;
            const SeenPoint& point = *points[i];
            const Vector3 arm = rotation * point.point, p = arm + origin;
            const Vector2 n = (search.carm.focal_length_mm / p.z() * point.across).cwiseQuotient(search.carm.pixel_mm);
            Vector6 row;
            row.head<3>() = Vector3(n.x(), n.y(), -n.dot(p.head<2>()) / p.z());
            row.tail<3>() = arm.cross(row.head<3>());
            normal += weight * row * row.transpose();
            right += weight * residuals[i] * row;
            weights += weight;
        }
        normal.diagonal() *= 1 + 1e-3;
        normal(2, 2) += 4 * weights * std::pow(focal_px / (origin.z() * origin.z()), 2);
        Vector6 step = normal.ldlt().solve(right);
        if (!step.allFinite()) break;
        step *=
            std::min({1.0, 0.25 / std::max(1e-9, step.tail<3>().norm()), 30 / std::max(1e-9, step.head<3>().norm())});
        pose = pose.perturbed(step);
        if (!(pose.translation().z() > search.layout.rod_radius_mm)) return from;
        if (step.tail<3>().norm() < 1e-6 && step.head<3>().norm() < 1e-4) break;
    }
    return pose;
}

struct Tried {
    Rigid3 pose;
    SeenLines lines;
    double score = 0;
    double step_px = 0;  // the last one's size
    int looks = 0;
};

SeenLines look(const Search& search, const Rigid3& pose, std::size_t index) {
    return findLines(search.smoothed[index], search.carm, search.layout, search.wires, search.shaft, pose,
                     kLooks[index].reach_px);
}

Tried tryFrom(const Search& search, const Rigid3& start, std::size_t first_look) {
    Tried tried{start, {}, 0, 1e9, 0};
    for (std::size_t index = first_look; index < kLooks.size(); ++index) {
        const SeenLines lines = look(search, tried.pose, index);
        if (lines.wire.size() + lines.shaft.size() < kLeastPoints) break;
        const Rigid3 next = moved(search, tried.pose, lines);
        const Vector6 step = next.deltaFrom(tried.pose);
        const double magnification = search.carm.focal_length_mm / next.translation().z() / search.carm.pixel_mm.mean();
        tried.step_px = magnification * (step.head<2>().norm() + search.layout.rod_radius_mm * step.tail<3>().norm());
        tried.pose = next;
        ++tried.looks;
    }
    tried.lines = look(search, tried.pose, kLooks.size() - 1);
    CorkscrewFit rated;
    rate(rated, tried.lines);
    tried.score = rated.score;
    return tried;
}

// Starts beside the given one, for when that leads nowhere.
std::vector<Rigid3> beside(const Rigid3& start) {
    std::vector<Rigid3> starts;
    const Vector3 axis = start.rotate(Vector3::UnitX()), sight = start.translation().normalized();
    const Vector3 tilt = axis.cross(sight).normalized();
    const auto turned = [&](const Vector3& about, double angle) {
        Vector6 delta = Vector6::Zero();
        delta.tail<3>() = angle * about;
        return start.perturbed(delta);
    };
    for (const double sign : {1.0, -1.0}) {
        starts.push_back(turned(axis, sign * 0.09));
        if (tilt.allFinite()) starts.push_back(turned(tilt, sign * 0.07));
        Vector6 delta = Vector6::Zero();
        delta.head<3>() = sign * 0.012 * start.translation();
        starts.push_back(start.perturbed(delta));
    }
    return starts;
}

}  // namespace

Result<CorkscrewFit> refineOnShape(const Image& image, const CArm& carm, const CorkscrewLayout& layout,
                                   const Rigid3& start, Progress& progress) {
    if (const Result<void> good = checkInputs(kStep, image, carm, layout, start); !good) return good.error();
    if (progress.isCancelled()) return cancelled(kStep);
    const PixelRegion region = regionAround(carm, layout, start, kMarginPx);
    Search search{carm, layout, wirePoints(layout), shaftPoints(layout), {}};
    const auto tooLittle = [&](double visible) {
        return noSolution(kStep, fmt::format("{:.0f} % of the wires inside the image", 100 * visible),
                          fmt::format("at least {:.0f} %", 100 * kLeastVisible),
                          "move the corkscrew into the field of view");
    };
    if (region.width < 32 || region.height < 32) return tooLittle(0);
    const Image seen = logarithm(image, region);
    for (std::size_t i = 0; i < kLooks.size(); ++i) {
        const bool same = i > 0 && kLooks[i].smoothing_px == kLooks[i - 1].smoothing_px;
        search.smoothed.push_back(
            same ? search.smoothed.back()
                 : LogImage{region, detectorBlurred(seen, kLooks[i].smoothing_px * kLooks[i].smoothing_px)});
    }
    Tried best = tryFrom(search, start, 0);
    if (best.score < kGoodScore) {
        for (const Rigid3& other : beside(start)) {
            if (progress.isCancelled()) return cancelled(kStep);
            Tried tried = tryFrom(search, other, 1);
            if (tried.score > best.score) best = std::move(tried);
            if (best.score >= kGoodScore) break;
        }
    }
    if (!(best.lines.visible >= kLeastVisible)) return tooLittle(best.lines.visible);
    if (best.lines.wire.size() + best.lines.shaft.size() < kLeastPoints) {
        return noSolution(kStep,
                          fmt::format("{} places along shaft, rings and helix that are dark lines",
                                      best.lines.wire.size() + best.lines.shaft.size()),
                          fmt::format("at least {}", kLeastPoints), "start nearer to the true pose");
    }
    CorkscrewFit fit;
    fit.imager_from_corkscrew = best.pose;
    rate(fit, best.lines);
    fit.iterations = best.looks;
    fit.converged = best.step_px < 0.5;
    return fit;
}

}  // namespace fluorocut
