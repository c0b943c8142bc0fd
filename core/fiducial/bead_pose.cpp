#include "core/fiducial/bead_pose.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>

#include "core/base/median.h"
#include "core/base/option_checks.h"
#include "core/base/random.h"
#include "core/base/stopwatch.h"
#include "core/base/units.h"
#include "core/fiducial/bead_bundle.h"
#include "core/fiducial/detection/bead_matching.h"
#include "core/fiducial/detection/pose_search.h"
#include "core/fiducial/sphere_shadow.h"

namespace fluorocut {
namespace {

using detection::PoseHypothesis;
using detection::PoseSearch;
using detection::Shadow;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kRefined = 12;  // hypotheses of one triple
// Poses of one pass: half a second or so, but never fewer than six triples of shadows are worth.
constexpr double kMostHypotheses = 600'000;
constexpr double kLeastTriples = 6;
constexpr std::size_t kMostShadows = 1000;
constexpr double kLeastTolerancePx = 0.6;
constexpr double kSameAngleRad = 0.05;
// A rival counts as equal when it explains as much to within these.
constexpr double kRivalScore = 0.85;
constexpr double kRivalRms = 3;
constexpr double kRmsFloorPx = 0.05;  // below this nobody's errors tell poses apart

struct Refined {
    bool ok = false;
    Rigid3 pose;
    PixelIntrinsics intrinsics;
    Matrix6 covariance = Matrix6::Zero();
    std::vector<BeadMatch> matches;
    double rms_px = kNaN;
    double score = 0;
};

class Estimate {
  public:
    Estimate(const std::vector<BeadDetection>& detections, const BeadLayout& layout, const CArm& carm,
             const BeadPoseOptions& options)
        : detections_(detections), layout_(layout), carm_(carm), options_(options) {
        intrinsics_.focal_px = carm.focal_length_mm / carm.pixel_mm.x();
        intrinsics_.principal_point_px = carm.principal_point_px;
        intrinsics_.aspect = carm.pixel_mm.x() / carm.pixel_mm.y();
        prior_.focal_px = options.focal_sigma * intrinsics_.focal_px;
        prior_.principal_point_px = options.center_sigma_px;
        for (const BeadDetection& one : detections) {
            Shadow shadow;
            shadow.ideal_px = idealShadowCenter(carm, one.center_px, one.radius_px);
            shadow.radius_px = one.radius_px;
            shadow.direction =
                Vector3((shadow.ideal_px.x() - carm.principal_point_px.x()) * carm.pixel_mm.x(),
                        (shadow.ideal_px.y() - carm.principal_point_px.y()) * carm.pixel_mm.y(), carm.focal_length_mm)
                    .normalized();
            shadows_.push_back(shadow);
            places_.push_back(shadow.ideal_px);
        }
        const double diagonal = std::hypot(carm.columns, carm.rows);
        // A focal length 15 % off bends the picture of something 120 mm deep by 0.7 % of the field's size.
        vote_distance_px_ = 2 + 0.004 * diagonal + 0.06 * std::min(options.focal_sigma, 0.15) * diagonal;
    }

    std::size_t expected() const { return std::min(layout_.beads.size(), shadows_.size()); }
    int required() const {
        return std::max(options_.least_beads,
                        static_cast<int>(std::ceil(options_.least_share * static_cast<double>(expected()))));
    }

    // Distinct poses, best first.
    std::vector<Refined> search(bool use_sizes, std::atomic<long long>& tried, Progress& progress) const {
        detection::SearchLimits limits{};
        limits.focal_length_mm = carm_.focal_length_mm;
        limits.vote_distance_px = vote_distance_px_;
        limits.columns = carm_.columns;
        limits.rows = carm_.rows;
        limits.use_sizes = use_sizes;
        limits.least_votes = std::max(options_.least_beads, required() / 2);
        const PoseSearch search(layout_, shadows_, intrinsics_, limits);
        Random random(options_.seed);
        std::vector<Refined> best;
        int convincing = 0;
        const auto triples = detection::wideTriples(shadows_, static_cast<std::size_t>(options_.most_triples), random);
        const double budget =
            std::max(kMostHypotheses, kLeastTriples * std::pow(static_cast<double>(layout_.beads.size()), 3));
        const long long before = tried;
        for (std::size_t i = 0; i < triples.size(); ++i) {
            if (progress.isCancelled() || static_cast<double>(tried - before) > budget) break;
            progress.report(0.1 + 0.8 * static_cast<double>(i) / static_cast<double>(triples.size()),
                            "looking for the beads' pose");
            bool helped = false;
            for (const PoseHypothesis& one : search.posesFor(triples[i], kRefined, tried, progress)) {
                if (known(best, one)) continue;
                Refined refined = refine(one.imager_from_layout);
                if (!refined.ok) continue;
                helped = helped || convinces(refined, static_cast<double>(tried));
                insert(best, std::move(refined));
            }
            convincing += helped || (!best.empty() && convinces(best.front(), static_cast<double>(tried))) ? 1 : 0;
            // Nearly all beads explained, and looked at from one more triple for look-alikes.
            if (convincing >= 2 && !best.empty() && enough(best.front()) &&
                static_cast<double>(best.front().matches.size()) >= 0.8 * static_cast<double>(expected())) {
                break;
            }
            if (convincing >= 6) break;
        }
        return best;
    }

    bool enough(const Refined& refined) const {
        return static_cast<int>(refined.matches.size()) >= required() && refined.rms_px <= options_.most_rms_px;
    }

    // Enough to end the search: what might be chance must not keep it from finding what is not.
    bool convinces(const Refined& refined, double hypotheses) const {
        return enough(refined) && chance(refined, hypotheses) <= options_.most_chance;
    }

    // How many poses among so many would explain as many beads as well by chance: three shadows make the pose, each of
    // the other beads then has a shadow within the distance with probability p.
    double chance(const Refined& refined, double hypotheses) const {
        double worst = kRmsFloorPx;
        for (const BeadMatch& match : refined.matches)
            worst = std::max(worst, match.residual_px.norm());
        const double area = static_cast<double>(carm_.columns) * carm_.rows;
        const double p = std::min(0.5, static_cast<double>(shadows_.size()) * std::numbers::pi * worst * worst / area);
        const double all = static_cast<double>(layout_.beads.size()) - 3;
        double sum = 0;
        for (double k = static_cast<double>(refined.matches.size()) - 3; k <= all; ++k) {
            int sign;  // std::lgamma writes a global
            sum += std::exp(::lgamma_r(all + 1, &sign) - ::lgamma_r(k + 1, &sign) - ::lgamma_r(all - k + 1, &sign) +
                            k * std::log(p) + (all - k) * std::log1p(-p));
        }
        return sum * std::max(1.0, hypotheses);
    }

    BeadPose result(const std::vector<Refined>& best) const {
        const Refined& first = best.front();
        BeadPose pose;
        pose.imager_from_layout = first.pose;
        pose.covariance = first.covariance;
        pose.focal_length_mm = first.intrinsics.focal_px * carm_.pixel_mm.x();
        pose.principal_point_px = first.intrinsics.principal_point_px;
        pose.matches = first.matches;
        pose.rms_px = first.rms_px;
        std::vector<bool> bead_used(layout_.beads.size(), false), shadow_used(shadows_.size(), false);
        for (const BeadMatch& match : first.matches) {
            bead_used[match.bead] = true;
            shadow_used[match.detection] = true;
        }
        for (std::size_t i = 0; i < layout_.beads.size(); ++i) {
            if (bead_used[i]) continue;
            const Bead& bead = layout_.beads[i];
            const Vector2 place = carm_.distortedPixel(
                predictedPixel(first.intrinsics, first.pose * bead.center_mm, 0.5 * bead.diameter_mm));
            const bool inside =
                place.x() >= 0 && place.y() >= 0 && place.x() <= carm_.columns - 1 && place.y() <= carm_.rows - 1;
            (inside ? pose.missing : pose.outside).push_back(i);
        }
        for (std::size_t i = 0; i < shadows_.size(); ++i) {
            if (!shadow_used[i]) pose.unexplained.push_back(i);
        }
        if (best.size() > 1) {
            const Refined& second = best[1];
            BeadPoseAlternative other;
            other.imager_from_layout = second.pose;
            other.beads = static_cast<int>(second.matches.size());
            other.rms_px = second.rms_px;
            other.angle_rad = (second.pose.inverse() * first.pose).rotationAngle();
            other.why_not =
                fmt::format("it explains {} beads with {:.2g} px rms; the pose taken explains {} with {:.2g} px.",
                            other.beads, other.rms_px, first.matches.size(), first.rms_px);
            pose.second_best = other;
        }
        return pose;
    }

    bool rivals(const Refined& first, const Refined& second) const {
        if (second.score >= kRivalScore * first.score) return true;
        return second.matches.size() + 1 >= first.matches.size() &&
               second.rms_px < kRivalRms * std::max(first.rms_px, kRmsFloorPx);
    }

  private:
    // Already refined from nearly there.
    static bool known(const std::vector<Refined>& best, const PoseHypothesis& one) {
        return std::any_of(best.begin(), best.end(), [&](const Refined& other) {
            const Rigid3 between = other.pose.inverse() * one.imager_from_layout;
            return between.rotationAngle() < 0.01 && between.translation().norm() < 5 &&
                   static_cast<int>(other.matches.size()) >= one.votes;
        });
    }

    static std::size_t common(const Refined& a, const Refined& b) {
        return static_cast<std::size_t>(std::count_if(a.matches.begin(), a.matches.end(), [&](const BeadMatch& one) {
            return std::any_of(b.matches.begin(), b.matches.end(), [&](const BeadMatch& other) {
                return one.bead == other.bead && one.detection == other.detection;
            });
        }));
    }

    static void insert(std::vector<Refined>& best, Refined refined) {
        for (Refined& other : best) {
            const double angle = (other.pose.inverse() * refined.pose).rotationAngle();
            const std::size_t least = std::min(other.matches.size(), refined.matches.size());
            if (angle < kSameAngleRad && 10 * common(other, refined) >= 7 * least) {
                if (refined.score > other.score) other = std::move(refined);
                sort(best);
                return;
            }
        }
        best.push_back(std::move(refined));
        sort(best);
        if (best.size() > 8) best.resize(8);
    }

    static void sort(std::vector<Refined>& best) {
        std::stable_sort(best.begin(), best.end(),
                         [](const Refined& a, const Refined& b) { return a.score > b.score; });
    }

    std::vector<BeadMatch> match(const Rigid3& pose, const PixelIntrinsics& intrinsics, double tolerance_px) const {
        return detection::matchBeads(layout_, places_, intrinsics, pose, tolerance_px);
    }

    Refined refine(const Rigid3& start) const {
        Refined refined;
        Rigid3 pose = start;
        PixelIntrinsics intrinsics = intrinsics_;
        double tolerance = 1.5 * vote_distance_px_;
        for (int round = 0; round < 6; ++round) {
            const std::vector<BeadMatch> matches = match(pose, intrinsics, tolerance);
            if (matches.size() < static_cast<std::size_t>(options_.least_beads)) return {};
            BundleView view;
            view.imager_from_layout = pose;
            for (const BeadMatch& one : matches)
                view.observations.push_back({one.bead, one.ideal_px, detections_[one.detection].covariance_px2});
            BundleOptions bundle_options;
            bundle_options.least_unexplained_px = round < 2 ? 0.5 : 0.01;
            bundle_options.iterations = 30;
            // Where the beads cannot tell the intrinsics, the prior does; the answer is the nominal value's
            // neighbourhood.
            const Result<BundleResult> bundle = solveBundle(layout_, {view}, intrinsics_, prior_, bundle_options);
            if (!bundle) return {};
            pose = bundle->views[0].imager_from_layout;
            intrinsics = bundle->intrinsics;
            std::vector<double> sizes;
            refined.matches = matches;
            for (std::size_t i = 0; i < matches.size(); ++i) {
                refined.matches[i].residual_px = bundle->residuals_px[0][i];
                sizes.push_back(bundle->residuals_px[0][i].norm());
            }
            refined.pose = pose;
            refined.intrinsics = intrinsics;
            refined.rms_px = bundle->rms_px;
            refined.covariance = bundle->covariance.block<6, 6>(4, 4);
            const double next = std::clamp(5 * median(sizes), kLeastTolerancePx, tolerance);
            const bool same = round >= 2 && match(pose, intrinsics, next).size() == matches.size() &&
                              *std::max_element(sizes.begin(), sizes.end()) <= next;
            tolerance = next;
            if (same) break;
        }
        refined.ok = refined.pose.translation().allFinite() && std::isfinite(refined.rms_px);
        const double rms = std::max(refined.rms_px, kRmsFloorPx);
        const double area = static_cast<double>(carm_.columns) * carm_.rows;
        // Log likelihood against shadows anywhere in the image.
        refined.score =
            static_cast<double>(refined.matches.size()) * (std::log(area / (2 * std::numbers::pi * rms * rms)) - 1);
        return refined;
    }

    const std::vector<BeadDetection>& detections_;
    const BeadLayout& layout_;
    const CArm& carm_;
    const BeadPoseOptions& options_;
    PixelIntrinsics intrinsics_;
    IntrinsicsPrior prior_;
    std::vector<Shadow> shadows_;
    std::vector<Vector2> places_;  // of the shadows, ideal pixels
    double vote_distance_px_;
};

}  // namespace

BeadPose::BeadPose()
    : covariance(Matrix6::Constant(kNaN)),
      focal_length_mm(kNaN),
      principal_point_px(Vector2::Constant(kNaN)),
      rms_px(kNaN),
      elapsed_ms(kNaN) {}

Result<void> BeadPoseOptions::validate() const {
    return requireRanges({{"focal_sigma", focal_sigma, 0, 0.5, "of the focal length"},
                          {"center_sigma_px", center_sigma_px, 0, 1000, "px"},
                          {"least_beads", static_cast<double>(least_beads), 4, 1000, "beads"},
                          {"least_share", least_share, 0, 1, ""},
                          {"most_rms_px", most_rms_px, 1e-3, 100, "px"},
                          {"most_chance", most_chance, 0, 1, ""},
                          {"most_triples", static_cast<double>(most_triples), 1, 10000, "triples"}});
}

Result<BeadPose> estimateBeadPose(const std::vector<BeadDetection>& detections, const BeadLayout& layout,
                                  const CArm& carm, const BeadPoseOptions& options, Progress& progress) {
    const Stopwatch stopwatch;
    if (const Result<void> good = options.validate(); !good) return good.error();
    if (const Result<void> good = layout.validate(); !good) return good.error();
    if (const Result<void> good = carm.validate(); !good) return good.error();
    const std::string where = "pose of the beads";
    if (layout.beads.size() < static_cast<std::size_t>(options.least_beads)) {
        return noSolution(where, fmt::format("a layout of {} beads", layout.beads.size()),
                          fmt::format("at least {} beads", options.least_beads));
    }
    if (detections.size() < static_cast<std::size_t>(options.least_beads)) {
        return noSolution(where, fmt::format("{} bead shadows in the image", detections.size()),
                          fmt::format("at least {} of the layout's {}", options.least_beads, layout.beads.size()),
                          "check that the beads are in the field and not over- or underexposed");
    }
    if (detections.size() > kMostShadows)
        return noSolution(where, fmt::format("{} bead shadows", detections.size()), "at most 1000", "crop the image");

    const Estimate estimate(detections, layout, carm, options);
    std::atomic<long long> tried{0};
    SubProgress first_pass(progress, 0, 0.5), second_pass(progress, 0.5, 1);
    std::vector<Refined> best = estimate.search(options.sizes_are_a_hint, tried, first_pass);
    const bool settled = !best.empty() && estimate.convinces(best.front(), static_cast<double>(tried));
    if (options.sizes_are_a_hint && !settled && !progress.isCancelled()) {
        std::vector<Refined> again = estimate.search(false, tried, second_pass);
        if (best.empty() || (!again.empty() && again.front().score > best.front().score)) best = std::move(again);
    }
    if (progress.isCancelled()) return cancelled("estimateBeadPose");
    if (best.empty() || !estimate.enough(best.front())) {
        const std::size_t explained = best.empty() ? 0 : best.front().matches.size();
        std::string found = fmt::format("{} shadows of which the best pose explains {}", detections.size(), explained);
        if (explained > 0) found += fmt::format(" with {:.2g} px rms", best.front().rms_px);
        return noSolution(where, found,
                          fmt::format("at least {} of the layout's {} beads with at most {:g} px", estimate.required(),
                                      layout.beads.size(), options.most_rms_px),
                          "check that this is the picture of this layout, and the C-arm's rough focal length");
    }
    const double chance = estimate.chance(best.front(), static_cast<double>(tried));
    if (!(chance <= options.most_chance)) {
        return noSolution(
            where,
            fmt::format("a pose that explains {} beads with {:.2g} px rms, as would {:.2g} poses by chance",
                        best.front().matches.size(), best.front().rms_px, chance),
            "a pose that cannot be chance", "bring more beads into the field, or hide what looks like one");
    }
    if (best.size() > 1 && estimate.rivals(best[0], best[1])) {
        const double angle = (best[1].pose.inverse() * best[0].pose).rotationAngle();
        return noSolution(
            where,
            fmt::format("two poses, {:.0f} degrees apart, that explain {} beads ({:.2g} px rms) and {} ({:.2g} px rms)",
                        degreesFromRadians(angle), best[0].matches.size(), best[0].rms_px, best[1].matches.size(),
                        best[1].rms_px),
            "one pose that fits clearly best",
            "the layout looks alike from two sides: tilt it, bring more beads into the field, or use an asymmetric "
            "one");
    }
    BeadPose pose = estimate.result(best);
    if (pose.unexplained.size() > pose.matches.size()) {
        pose.warnings.push_back(fmt::format("{} round shadows belong to no bead of the layout; {} do.",
                                            pose.unexplained.size(), pose.matches.size()));
    }
    pose.hypotheses = tried;
    pose.elapsed_ms = stopwatch.ms();
    progress.report(1, "looking for the beads' pose");
    return pose;
}

}  // namespace fluorocut
