#include "core/fiducial/femur_beads.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/base/median.h"
#include "core/base/option_checks.h"
#include "core/base/stopwatch.h"
#include "core/fiducial/bead_bundle.h"
#include "core/fiducial/detection/bead_matching.h"
#include "core/fiducial/femur_bead_fit.h"
#include "core/fiducial/femur_bead_geometry.h"
#include "core/fiducial/sphere_shadow.h"

namespace fluorocut {
namespace {

using femur_beads::FitView;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
// Labels are looked at again within this many times the median residual, but not nearer than that.
constexpr double kRematch = 6;
constexpr double kLeastTolerancePx = 1;
constexpr double kMostGuidedPx = 25;

PixelIntrinsics intrinsicsOf(const CArm& carm) {
    return {carm.focal_length_mm / carm.pixel_mm.x(), carm.principal_point_px, carm.pixel_mm.x() / carm.pixel_mm.y()};
}

Vector3 middleOf(const BeadLayout& layout) {
    Vector3 sum = Vector3::Zero();
    for (const Bead& bead : layout.beads)
        sum += bead.center_mm;
    return sum / static_cast<double>(layout.beads.size());
}

std::vector<Vector2> idealPlaces(const FemurView& view) {
    std::vector<Vector2> places;
    for (const BeadDetection& one : view.detections)
        places.push_back(idealShadowCenter(view.carm, one.center_px, one.radius_px));
    return places;
}

void label(FitView& fit, const FemurView& view, const BeadLayout& layout, const std::vector<Vector2>& places,
           double tolerance_px) {
    fit.seen.clear();
    for (const BeadMatch& match :
         detection::matchBeads(layout, places, fit.intrinsics, fit.imager_from_femur, tolerance_px)) {
        fit.seen.push_back(
            {match.bead, match.detection, match.ideal_px, view.detections[match.detection].covariance_px2, 1});
    }
}

// How far a shadow may be from where the first view's pose and the known geometry put it.
double guidedTolerance(const FitView& fit, const BeadLayout& layout, const Matrix6& covariance) {
    const Pose pose{Frame::imager, layout.frame, fit.imager_from_femur, covariance};
    const Vector3 middle = middleOf(layout);
    const double sigma_mm = std::sqrt(pointCovariance(pose, middle).topLeftCorner<2, 2>().trace());
    const double depth = (fit.imager_from_femur * middle).z();
    return std::clamp(3 * sigma_mm * fit.intrinsics.focal_px / depth, 3.0, kMostGuidedPx);
}

void relabel(std::vector<FitView>& fits, const std::vector<const FemurView*>& views, const BeadLayout& layout,
             const std::vector<std::vector<Vector2>>& places) {
    for (std::size_t k = 0; k < fits.size(); ++k) {
        std::vector<double> sizes;
        for (const auto& seen : fits[k].seen)
            sizes.push_back(femur_beads::residual(fits[k], layout, seen).norm());
        const double tolerance = std::clamp(kRematch * median(sizes), kLeastTolerancePx, kMostGuidedPx);
        label(fits[k], *views[k], layout, places[k], tolerance);
    }
}

// Of view k's pose: of its shadows, and of what calibration and layout do not know.
Matrix6 covarianceOf(const femur_beads::Fit& fit, std::size_t k, const Eigen::VectorXd& sigmas) {
    const auto at = static_cast<Eigen::Index>(6 * k);
    const Eigen::MatrixXd follows = fit.sensitivity.middleRows<6>(at);
    return fit.covariance.block<6, 6>(at, at) + follows * sigmas.cwiseAbs2().asDiagonal() * follows.transpose();
}

FemurViewPose describe(const FitView& fit, const FemurView& view, const BeadLayout& layout) {
    FemurViewPose pose;
    pose.name = view.name;
    std::vector<bool> bead_used(layout.beads.size(), false), shadow_used(view.detections.size(), false);
    std::vector<double> sizes;
    double px = 0, mm = 0, count = 0;
    for (const auto& seen : fit.seen) {
        const Bead& bead = layout.beads[seen.bead];
        const Vector2 residual = femur_beads::residual(fit, layout, seen);
        const double depth = (fit.imager_from_femur * bead.center_mm).z();
        const double at_bead = residual.cwiseProduct(view.carm.pixel_mm).norm() * depth / view.carm.focal_length_mm;
        pose.beads.push_back({seen.bead, seen.detection, residual, at_bead, seen.weight > 0});
        bead_used[seen.bead] = shadow_used[seen.detection] = true;
        if (!(seen.weight > 0)) continue;
        count += 1;
        px += residual.squaredNorm();
        mm += at_bead * at_bead;
        sizes.push_back(view.detections[seen.detection].radius_px /
                        (0.5 * bead.diameter_mm / depth * fit.intrinsics.focal_px));
    }
    pose.fre_px = std::sqrt(px / (2 * count));
    pose.fre_mm = std::sqrt(mm / count);
    pose.size_error = median(sizes) - 1;
    for (std::size_t i = 0; i < layout.beads.size(); ++i) {
        if (bead_used[i]) continue;
        const Vector2 place = view.carm.project(fit.imager_from_femur * layout.beads[i].center_mm);
        const bool inside =
            place.x() >= 0 && place.y() >= 0 && place.x() <= view.carm.columns - 1 && place.y() <= view.carm.rows - 1;
        (inside ? pose.missing : pose.outside).push_back(i);
    }
    for (std::size_t i = 0; i < shadow_used.size(); ++i)
        if (!shadow_used[i]) pose.unexplained.push_back(i);
    return pose;
}

// One sentence for each bead, whatever the number of views that show it off.
void warnOfMovedBeads(FemurBeads& result, const BeadLayout& layout) {
    for (std::size_t i = 0; i < layout.beads.size(); ++i) {
        double off_mm = 0;
        std::vector<std::string> views;
        for (const FemurViewPose& view : result.views) {
            for (const FemurBead& bead : view.beads) {
                if (bead.bead != i || bead.used) continue;
                off_mm = std::max(off_mm, bead.residual_mm);
                views.push_back(view.name);
            }
        }
        if (views.empty()) continue;
        result.warnings.push_back(
            fmt::format("{} {}: bead {} lies {:.2f} mm from where the others put it: {}.",
                        views.size() == 1 ? "View" : "Views", fmt::join(views, ", "), layout.beads[i].name, off_mm,
                        views.size() == 1 ? "it moved in the bone, or something covers it"
                                          : "it moved in the bone, or its place in the layout is wrong"));
    }
}

Error nothingFound(const std::vector<FemurView>& views, const BeadLayout& layout, const std::vector<Error>& errors) {
    Error first = errors.front();
    if (views.size() == 1) {
        first.where = "view " + views.front().name + ", " + first.where;
        return first;
    }
    return noSolution("pose of the femur's beads",
                      fmt::format("none of the {} views shows the layout of {} beads; view {}: {}", views.size(),
                                  layout.beads.size(), views.front().name, first.found),
                      first.expected, "check that this is the femur's beads file, and that the beads are in the field");
}

}  // namespace

Result<void> BeadUncertainty::validate() const {
    return requireRanges({{"focal_length", focal_length, 0, 0.2, "of it"},
                          {"principal_point_px", principal_point_px, 0, 500, "px"},
                          {"bead_mm", bead_mm, 0, 5, "mm"},
                          {"unexplained_px", unexplained_px, 1e-3, 10, "px"}});
}

Result<void> FemurBeadLimits::validate() const {
    return requireRanges({{"most_fre_px", most_fre_px, 0, 100, "px"},
                          {"least_share", least_share, 0, 1, ""},
                          {"most_sigma_mm", most_sigma_mm, 0, 1000, "mm"},
                          {"most_size_error", most_size_error, 0, 10, ""}});
}

Result<void> FemurBeadOptions::validate() const {
    if (const auto good = uncertainty.validate(); !good) return good;
    if (const auto good = limits.validate(); !good) return good;
    if (const auto good = search.validate(); !good) return good;
    return requireRange("guided_beads", guided_beads, 2, 1000, "beads");
}

FemurViewPose::FemurViewPose()
    : noise_covariance(Matrix6::Constant(kNaN)), fre_px(kNaN), fre_mm(kNaN), size_error(kNaN), sigma_mm(kNaN) {}

FemurBeads::FemurBeads() : unexplained_px(kNaN), elapsed_ms(kNaN) {}

std::vector<std::string> beadParameters(const BeadLayout& layout) {
    std::vector<std::string> names{"focal length", "image centre u", "image centre v"};
    for (const Bead& bead : layout.beads)
        for (const char* axis : {" x", " y", " z"})
            names.push_back("bead " + bead.name + axis);
    return names;
}

Eigen::VectorXd beadParameterSigmas(const BeadLayout& layout, const BeadUncertainty& uncertainty) {
    Eigen::VectorXd sigmas =
        Eigen::VectorXd::Constant(3 + 3 * static_cast<Eigen::Index>(layout.beads.size()), uncertainty.bead_mm);
    sigmas.head<3>() << uncertainty.focal_length, uncertainty.principal_point_px, uncertainty.principal_point_px;
    return sigmas;
}

Result<FemurBeads> registerBeads(const std::vector<FemurView>& views, const BeadLayout& layout,
                                 const FemurBeadOptions& options, Progress& progress) {
    const Stopwatch stopwatch;
    if (const Result<void> good = options.validate(); !good) return good.error();
    if (const Result<void> good = layout.validate(); !good) return good.error();
    if (layout.frame != Frame::femur) {
        return invalidInput("beads", "a layout in the frame \"" + std::string(name(layout.frame)) + "\"",
                            "beads of the femur", "check that this is the femur's beads file");
    }
    if (views.empty()) return invalidOption("views", "none", "at least one");

    // 1. Each on its own.
    BeadPoseOptions search = options.search;
    search.focal_sigma = search.center_sigma_px = 0;
    std::vector<std::optional<BeadPose>> alone(views.size());
    std::vector<Error> errors;
    std::optional<std::size_t> best;
    for (std::size_t k = 0; k < views.size(); ++k) {
        const double part = 0.9 / static_cast<double>(views.size());
        SubProgress own(progress, part * static_cast<double>(k), part * static_cast<double>(k + 1));
        Result<BeadPose> pose = estimateBeadPose(views[k].detections, layout, views[k].carm, search, own);
        if (!pose) {
            if (pose.error().code != ErrorCode::noSolution) return pose.error();
            errors.push_back(pose.error());
            continue;
        }
        alone[k] = std::move(*pose);
        if (!best || alone[k]->matches.size() > alone[*best]->matches.size()) best = k;
    }
    if (!best) return nothingFound(views, layout, errors);

    // 2. All together.
    const auto geometryKnown = [&](std::size_t k) { return k == 0 || views[k].imager_from_first.has_value(); };
    const auto fromFirst = [&](std::size_t k) { return k == 0 ? Rigid3() : *views[k].imager_from_first; };
    FemurBeads result;
    std::vector<FitView> fits;
    std::vector<const FemurView*> solved;
    std::vector<std::vector<Vector2>> places;
    std::vector<bool> guided;
    std::size_t error = 0;
    for (std::size_t k = 0; k < views.size(); ++k) {
        FitView fit;
        fit.intrinsics = intrinsicsOf(views[k].carm);
        const std::vector<Vector2> seen = idealPlaces(views[k]);
        if (alone[k]) {
            fit.imager_from_femur = alone[k]->imager_from_layout;
            for (const BeadMatch& match : alone[k]->matches) {
                fit.seen.push_back({match.bead, match.detection, match.ideal_px,
                                    views[k].detections[match.detection].covariance_px2, 1});
            }
        } else {
            const Error& why = errors[error++];
            if (geometryKnown(k) && geometryKnown(*best)) {
                fit.imager_from_femur = fromFirst(k) * fromFirst(*best).inverse() * alone[*best]->imager_from_layout;
                const double tolerance = guidedTolerance(
                    fit, layout,
                    views[k].covariance_from_first + views[*best].covariance_from_first + alone[*best]->covariance);
                label(fit, views[k], layout, seen, tolerance);
            }
            if (static_cast<int>(fit.seen.size()) < options.guided_beads) {
                result.rejected.push_back(fmt::format("View {} was left out: {}", views[k].name, why.message()));
                continue;
            }
        }
        fit.geometry_known = geometryKnown(k);
        fit.imager_from_first = fromFirst(k);
        fit.covariance_from_first = views[k].covariance_from_first;
        fit.is_first = k == 0;
        fits.push_back(std::move(fit));
        solved.push_back(&views[k]);
        places.push_back(seen);
        guided.push_back(!alone[k]);
    }
    const Eigen::VectorXd sigmas = beadParameterSigmas(layout, options.uncertainty);
    std::vector<femur_beads::ViewAlone> known;
    for (std::size_t i = 0; i < fits.size(); ++i) {
        if (guided[i] || !fits[i].geometry_known) continue;
        std::vector<FitView> own{fits[i]};
        own.front().geometry_known = false;
        const femur_beads::Fit own_fit = femur_beads::fit(own, layout, options.uncertainty.unexplained_px);
        const Matrix6 covariance = covarianceOf(own_fit, 0, sigmas);
        if (!own_fit.converged || !covariance.allFinite()) continue;
        known.push_back({static_cast<std::size_t>(solved[i] - views.data()) + 1, solved[i]->name,
                         own.front().imager_from_femur, covariance, fits[i].imager_from_first,
                         fits[i].covariance_from_first});
    }
    if (const Result<void> good = femur_beads::checkKnownGeometry(known); !good) return good.error();
    femur_beads::Fit fit;
    for (int round = 0; round < 3; ++round) {
        fit = femur_beads::fit(fits, layout, options.uncertainty.unexplained_px);
        if (progress.isCancelled()) return cancelled("register beads");
        std::vector<std::size_t> before, after;
        for (const FitView& one : fits)
            before.push_back(one.seen.size());
        if (round < 2) relabel(fits, solved, layout, places);
        for (const FitView& one : fits)
            after.push_back(one.seen.size());
        if (before == after && round > 0) break;
    }
    fit = femur_beads::fit(fits, layout, options.uncertainty.unexplained_px);
    if (!fit.converged) {
        return noSolution("pose of the femur's beads", "no convergence", "views that agree with their known geometry",
                          "check that each view has its own pose");
    }

    const Matrix6 no_covariance = Matrix6::Zero();
    const Vector3 middle = middleOf(layout);
    result.unexplained_px = fit.unexplained_px;
    double worst_fre = 0, worst_share = 1, worst_sigma = 0, worst_size = 0;
    for (std::size_t k = 0; k < fits.size(); ++k) {
        const auto used = std::count_if(fits[k].seen.begin(), fits[k].seen.end(),
                                        [](const femur_beads::Seen& seen) { return seen.weight > 0; });
        if (used < options.guided_beads) {
            return noSolution("view " + solved[k]->name,
                              fmt::format("{} of its {} beads where the layout and the other views put them", used,
                                          fits[k].seen.size()),
                              fmt::format("at least {}", options.guided_beads),
                              "check that the views belong together, and that the femur did not move between them");
        }
        FemurViewPose pose = describe(fits[k], *solved[k], layout);
        pose.guided = guided[k];
        const auto at = static_cast<Eigen::Index>(6 * k);
        pose.noise_covariance = fit.covariance.block<6, 6>(at, at);
        pose.imager_from_femur = {Frame::imager, Frame::femur, fits[k].imager_from_femur, no_covariance};
        pose.imager_from_femur.covariance = covarianceOf(fit, k, sigmas);
        pose.evidence = femur_beads::evidenceOf(fits[k], layout, fit.unexplained_px);
        pose.sigma_mm = std::sqrt(Eigen::SelfAdjointEigenSolver<Matrix3>(
                                      pointCovariance(pose.imager_from_femur, middle), Eigen::EigenvaluesOnly)
                                      .eigenvalues()[2]);
        for (std::size_t i = 0; i < views.size(); ++i)
            if (&views[i] == solved[k] && alone[i]) pose.second_best = alone[i]->second_best;
        worst_fre = std::max(worst_fre, pose.fre_px);
        worst_sigma = std::max(worst_sigma, pose.sigma_mm);
        worst_size = std::max(worst_size, std::abs(pose.size_error));
        const double shown = static_cast<double>(pose.beads.size());
        worst_share = std::min(worst_share, shown / (shown + static_cast<double>(pose.missing.size())));
        result.views.push_back(std::move(pose));
    }
    warnOfMovedBeads(result, layout);
    result.acceptance = {
        atMost("registration error of the beads (FRE)", worst_fre, options.limits.most_fre_px, "px"),
        atLeast("share of the beads found", worst_share, options.limits.least_share, ""),
        atMost("uncertainty of the beads' middle", worst_sigma, options.limits.most_sigma_mm, "mm"),
        atMost("size of the shadows against the layout", worst_size, options.limits.most_size_error, "")};
    result.elapsed_ms = stopwatch.ms();
    progress.report(1, "registering beads");
    return result;
}

}  // namespace fluorocut
