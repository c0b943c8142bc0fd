#include "core/fiducial/imager_calibration.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <fmt/format.h>

#include "core/base/median.h"
#include "core/base/option_checks.h"
#include "core/base/stopwatch.h"
#include "core/fiducial/bead_bundle.h"
#include "core/fiducial/detection/bead_matching.h"
#include "core/fiducial/sphere_shadow.h"

namespace fluorocut {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
const std::string kWhere = "intrinsics of the imager";
// Tilting does not help the centre (see the header): numbers and width do.
constexpr const char* kCenterAdvice = "add views with other tilts, with beads out to the image's rim; each one counts";
// Weak enough to leave every usable answer alone, strong enough that an unusable one does not run off to infinity.
constexpr double kFarFocalSigma = 0.5;
constexpr double kFarCenterSigma = 0.25;  // of the image's width
constexpr double kLeastTolerancePx = 0.6;
constexpr double kFlatDepth = 0.03;  // depth range over depth below which perspective says little

struct View {
    const PhantomView* seen = nullptr;
    Rigid3 pose;
    std::vector<BeadMatch> matches;
};

std::string viewName(const std::vector<PhantomView>& views, std::size_t i) {
    return views[i].name.empty() ? fmt::format("view {}", i + 1) : views[i].name;
}

class Calibration {
  public:
    Calibration(const BeadLayout& layout, const ImagerCalibrationOptions& options)
        : layout_(layout), options_(options) {
        carm_ = options.nominal;
        carm_.distortion = nullptr;
    }

    Result<void> updateDistortion() {
        if (!options_.distortion) return {};
        CArm plain = carm_;
        plain.distortion = nullptr;
        Result<std::shared_ptr<const Distortion>> distortion = options_.distortion(plain);
        if (!distortion) return distortion.error();
        carm_.distortion = *distortion;
        return {};
    }

    // The phantom's pose in one view, from a focal length `factor` times the nominal one.
    Result<BeadPose> poseOf(const PhantomView& view, double factor, Progress& progress) const {
        BeadPoseOptions pose_options;
        pose_options.focal_sigma = options_.focal_sigma;
        pose_options.center_sigma_px = options_.center_sigma_px;
        pose_options.seed = options_.seed;
        CArm tried = carm_;
        tried.focal_length_mm *= factor;
        return estimateBeadPose(view.detections, layout_, tried, pose_options, progress);
    }

    void add(const PhantomView& view, const BeadPose& pose) {
        views_.push_back({&view, pose.imager_from_layout, pose.matches});
        focal_.push_back(pose.focal_length_mm);
        center_.push_back(pose.principal_point_px);
    }

    bool empty() const { return views_.empty(); }

    Result<void> solve() {
        intrinsics_ = startIntrinsics();
        double tolerance = 0;
        for (int round = 0; round < 5; ++round) {
            std::vector<BundleView> bundle_views;
            for (View& view : views_) {
                const std::vector<Vector2> places = idealPlaces(*view.seen);
                if (round > 0) view.matches = detection::matchBeads(layout_, places, intrinsics_, view.pose, tolerance);
                BundleView bundle;
                bundle.imager_from_layout = view.pose;
                for (BeadMatch& match : view.matches) {
                    match.ideal_px = places[match.detection];
                    bundle.observations.push_back(
                        {match.bead, match.ideal_px, view.seen->detections[match.detection].covariance_px2});
                }
                if (bundle.observations.size() < 4) {
                    return noSolution(kWhere + ", " + view.seen->name,
                                      fmt::format("{} beads that fit", bundle.observations.size()), "at least 4");
                }
                bundle_views.push_back(std::move(bundle));
            }
            // First within what is known, so that poses found separately come together; then free.
            IntrinsicsPrior prior;
            const double far_center = kFarCenterSigma * carm_.columns;
            prior.focal_px = (round == 0 ? options_.focal_sigma : kFarFocalSigma) * intrinsics_.focal_px;
            prior.principal_point_px = round == 0 ? std::min(2 * options_.center_sigma_px, far_center) : far_center;
            prior.aspect = options_.estimate_aspect && round > 0 ? std::numeric_limits<double>::infinity() : 0;
            if (prior.focal_px <= 0) prior.focal_px = kFarFocalSigma * intrinsics_.focal_px;
            if (prior.principal_point_px <= 0) prior.principal_point_px = far_center;
            BundleOptions bundle_options;
            bundle_options.iterations = 100;
            if (round == 0) bundle_options.least_unexplained_px = 0.5;
            Result<BundleResult> solved = solveBundle(layout_, bundle_views, intrinsics_, prior, bundle_options);
            if (!solved) return solved.error();
            intrinsics_ = solved->intrinsics;
            if (!(intrinsics_.focal_px > 0) || !intrinsics_.principal_point_px.allFinite()) {
                return noSolution(kWhere, "a solution that ran off", "views that determine the focal length", advice());
            }
            std::vector<double> sizes;
            for (std::size_t i = 0; i < views_.size(); ++i) {
                views_[i].pose = solved->views[i].imager_from_layout;
                for (std::size_t j = 0; j < views_[i].matches.size(); ++j) {
                    views_[i].matches[j].residual_px = solved->residuals_px[i][j];
                    sizes.push_back(solved->residuals_px[i][j].norm());
                }
            }
            const double next = std::clamp(5 * median(sizes), kLeastTolerancePx, 10.0);
            bundle_ = std::move(*solved);
            const bool same = round >= 2 && std::abs(next - tolerance) < 0.1 * tolerance;
            tolerance = next;
            carm_.focal_length_mm = intrinsics_.focal_px * carm_.pixel_mm.x();
            carm_.principal_point_px = intrinsics_.principal_point_px;
            carm_.pixel_mm.y() = carm_.pixel_mm.x() / intrinsics_.aspect;
            if (const Result<void> valid = carm_.validate(); !valid) {
                return noSolution(kWhere, "no imager that could exist (" + valid.error().message() + ")",
                                  "views that determine the focal length", advice());
            }
            if (const Result<void> good = updateDistortion(); !good) return good.error();
            if (same) break;
        }
        return {};
    }

    Result<ImagerCalibration> result() const {
        const double focal_sigma = std::sqrt(bundle_.covariance(0, 0)) / intrinsics_.focal_px;
        if (!(focal_sigma <= options_.worst_focal_sigma)) {
            return noSolution(
                kWhere,
                fmt::format("{} view{} in which focal length and distance cannot be told apart (the focal "
                            "length is known to {:.2g} %{})",
                            views_.size(), views_.size() == 1 ? "" : "s", 100 * focal_sigma, flatness()),
                fmt::format("a focal length known to {:g} %", 100 * options_.worst_focal_sigma), advice());
        }
        ImagerCalibration result;
        result.carm = carm_;
        result.pixel_scale_source = options_.pixel_scale_source;
        const double p = carm_.pixel_mm.x();
        const Eigen::Vector4d units(p, 1, 1, 1);
        result.covariance = units.asDiagonal() * bundle_.covariance.topLeftCorner<4, 4>() * units.asDiagonal();
        result.focal_sigma_mm = std::sqrt(result.covariance(0, 0));
        result.center_sigma_px = {std::sqrt(result.covariance(1, 1)), std::sqrt(result.covariance(2, 2))};
        result.aspect = carm_.pixel_mm.y() / p;
        result.aspect_sigma = std::sqrt(result.covariance(3, 3)) * result.aspect * result.aspect;
        result.rms_px = bundle_.rms_px;
        result.unexplained_px = bundle_.unexplained_px;
        double worst_share = 1, least_correlation = 1;
        for (std::size_t i = 0; i < views_.size(); ++i) {
            result.views.push_back(describe(i));
            const CalibratedView& view = result.views.back();
            worst_share = std::min(worst_share, static_cast<double>(view.matches.size()) / std::max(1, view.expected));
            least_correlation = std::min(least_correlation, std::abs(view.focal_depth_correlation));
            if (view.unexplained > static_cast<int>(view.matches.size())) {
                result.warnings.push_back(
                    fmt::format("{}: {} round shadows belong to no bead of the phantom.", view.name, view.unexplained));
            }
        }
        const ImagerAcceptanceLimits& limits = options_.limits;
        const Vector2 center_mm = result.center_sigma_px.cwiseProduct(carm_.pixel_mm);
        result.acceptance = {
            atMost("standard deviation of the focal length", 100 * focal_sigma, 100 * limits.most_focal_sigma, "%"),
            atMost("standard deviation of the image centre", center_mm.maxCoeff(), limits.most_center_sigma_mm, "mm"),
            atMost("residual", result.rms_px, limits.most_rms_px, "px"),
            atLeast("beads found in the worst view", 100 * worst_share, 100 * limits.least_share, "%"),
        };
        if (!result.acceptance[0].accepted()) {
            result.weak_directions.push_back(fmt::format(
                "The focal length cannot be told well from the phantom's distance (correlation {:.4f}{}): {}.",
                least_correlation, flatness(), advice()));
        }
        if (!result.acceptance[1].accepted()) {
            double correlation = 0;
            for (const CalibratedView& view : result.views)
                correlation = std::max(correlation, view.center_tilt_correlation.cwiseAbs().maxCoeff());
            result.weak_directions.push_back(
                fmt::format("The image centre cannot be told well from the phantom's tilt (correlation {:.4f}): {}.",
                            correlation, kCenterAdvice));
        }
        if (options_.pixel_scale_source == PixelScaleSource::assumed) {
            result.warnings.push_back(
                fmt::format("The size of a pixel is not known; {:.4g} mm is assumed. Focal length and distances scale "
                            "with it: give "
                            "the size, or a distortion map, which has it from the plate.",
                            p));
        }
        return result;
    }

  private:
    PixelIntrinsics startIntrinsics() const {
        const auto median = [](std::vector<double> values) {
            std::sort(values.begin(), values.end());
            return values[values.size() / 2];
        };
        std::vector<double> u, v;
        for (const Vector2& center : center_) {
            u.push_back(center.x());
            v.push_back(center.y());
        }
        PixelIntrinsics start;
        start.focal_px = median(focal_) / carm_.pixel_mm.x();
        start.principal_point_px = {median(u), median(v)};
        start.aspect = carm_.pixel_mm.x() / carm_.pixel_mm.y();
        return start;
    }

    std::vector<Vector2> idealPlaces(const PhantomView& view) const {
        std::vector<Vector2> places;
        for (const BeadDetection& one : view.detections)
            places.push_back(idealShadowCenter(carm_, one.center_px, one.radius_px));
        return places;
    }

    CalibratedView describe(std::size_t index) const {
        const View& view = views_[index];
        CalibratedView described;
        described.name = view.seen->name;
        described.imager_from_phantom = view.pose;
        described.matches = view.matches;
        described.unexplained = static_cast<int>(view.seen->detections.size() - view.matches.size());
        for (const Bead& bead : layout_.beads) {
            const Vector3 center = view.pose * bead.center_mm;
            const double radius = 0.5 * bead.diameter_mm;
            const Vector2 place = shadowCenter(carm_, center, radius);
            const double margin = radius * intrinsics_.focal_px / center.z();  // a shadow cut by the border is not used
            if (place.x() >= margin && place.y() >= margin && place.x() <= carm_.columns - 1 - margin &&
                place.y() <= carm_.rows - 1 - margin) {
                ++described.expected;
            }
        }
        double squares = 0;
        for (const BeadMatch& match : view.matches)
            squares += match.residual_px.squaredNorm();
        described.rms_px = std::sqrt(squares / (2.0 * static_cast<double>(view.matches.size())));
        const Eigen::MatrixXd& all = bundle_.covariance;
        const Eigen::Index at = 4 + 6 * static_cast<Eigen::Index>(index);
        described.covariance = all.block<6, 6>(at, at);
        const auto correlation = [&](Eigen::Index a, Eigen::Index b) {
            return all(a, b) / std::sqrt(all(a, a) * all(b, b));
        };
        described.focal_depth_correlation = correlation(0, at + 2);
        described.center_tilt_correlation = {correlation(1, at + 4), correlation(2, at + 3)};
        return described;
    }

    // Depth range of the beads in use over their mean depth, in the best view.
    double relativeDepth() const {
        double best = 0;
        for (const View& view : views_) {
            double least = std::numeric_limits<double>::infinity(), most = 0;
            for (const BeadMatch& match : view.matches) {
                const double z = (view.pose * layout_.beads[match.bead].center_mm).z();
                least = std::min(least, z);
                most = std::max(most, z);
            }
            best = std::max(best, 2 * (most - least) / (most + least));
        }
        return best;
    }

    std::string flatness() const {
        const double depth = relativeDepth();
        if (depth >= kFlatDepth) return {};
        return fmt::format("; all beads lie within {:.2g} % of one distance, as a single plane seen face on does",
                           100 * depth);
    }

    std::string advice() const {
        if (views_.size() >= 3) return "tilt the phantom more in some of the views, by 20 degrees or so to either side";
        return "tilt the phantom by 20 degrees or add views with other tilts; three suffice";
    }

    const BeadLayout& layout_;
    const ImagerCalibrationOptions& options_;
    CArm carm_;
    std::vector<View> views_;
    std::vector<double> focal_;
    std::vector<Vector2> center_;
    PixelIntrinsics intrinsics_;
    BundleResult bundle_;
};

}  // namespace

std::string_view name(PixelScaleSource source) {
    switch (source) {
        case PixelScaleSource::distortionMap:
            return "distortion-map";
        case PixelScaleSource::header:
            return "header";
        case PixelScaleSource::stated:
            return "stated";
        case PixelScaleSource::assumed:
            return "assumed";
    }
    return "";
}

ImagerCalibration::ImagerCalibration()
    : focal_sigma_mm(kNaN),
      center_sigma_px(Vector2::Constant(kNaN)),
      aspect(kNaN),
      covariance(Eigen::Matrix4d::Constant(kNaN)),
      rms_px(kNaN),
      unexplained_px(kNaN),
      elapsed_ms(kNaN) {}

Result<void> ImagerAcceptanceLimits::validate() const {
    return requireRanges({{"most_focal_sigma", most_focal_sigma, 0, 1, "of the focal length"},
                          {"most_center_sigma_mm", most_center_sigma_mm, 0, 1000, "mm"},
                          {"most_rms_px", most_rms_px, 0, 1000, "px"},
                          {"least_share", least_share, 0, 1, ""}});
}

Result<void> ImagerCalibrationOptions::validate() const {
    if (const Result<void> good = nominal.validate(); !good) return good.error();
    if (const Result<void> good = limits.validate(); !good) return good.error();
    return requireRanges({{"focal_sigma", focal_sigma, 0, 0.5, "of the focal length"},
                          {"center_sigma_px", center_sigma_px, 0, 1000, "px"},
                          {"worst_focal_sigma", worst_focal_sigma, 1e-6, 0.25, "of the focal length"}});
}

Result<ImagerCalibration> calibrateImager(const std::vector<PhantomView>& views, const BeadLayout& layout,
                                          const ImagerCalibrationOptions& options, Progress& progress) {
    const Stopwatch stopwatch;
    if (const Result<void> good = options.validate(); !good) return good.error();
    if (const Result<void> good = layout.validate(); !good) return good.error();
    if (views.empty()) return noSolution(kWhere, "no view", "at least one picture of the phantom");

    Calibration calibration(layout, options);
    if (const Result<void> good = calibration.updateDistortion(); !good) return good.error();
    std::vector<std::string> rejected;
    std::optional<Error> first_error;
    // A focal length that is rougher than it was said to be, when no view can be understood with the one given.
    int attempt = 0;
    for (const double factor : {1.0, 1.3, 0.75}) {
        rejected.clear();
        for (std::size_t i = 0; i < views.size(); ++i) {
            const double part = 0.3 / static_cast<double>(views.size()), begin = 0.3 * attempt;
            SubProgress own(progress, begin + part * static_cast<double>(i), begin + part * static_cast<double>(i + 1));
            const Result<BeadPose> pose = calibration.poseOf(views[i], factor, own);
            if (pose) {
                calibration.add(views[i], *pose);
                continue;
            }
            if (pose.error().isCancelled()) return pose.error();
            Error error = pose.error();
            error.where = viewName(views, i);
            rejected.push_back("View not used: " + error.message());
            if (!first_error) first_error = error;
        }
        if (!calibration.empty()) break;
        ++attempt;
    }
    if (calibration.empty()) return *first_error;
    if (const Result<void> solved = calibration.solve(); !solved) return solved.error();
    Result<ImagerCalibration> result = calibration.result();
    if (!result) return result;
    result->rejected_views = rejected;
    result->warnings.insert(result->warnings.begin(), rejected.begin(), rejected.end());
    result->elapsed_ms = stopwatch.ms();
    progress.report(1, "calibrating the imager");
    return result;
}

}  // namespace fluorocut
