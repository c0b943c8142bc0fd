#include "core/fiducial/corkscrew_pose.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/parallel.h"
#include "core/base/stopwatch.h"
#include "core/base/units.h"
#include "core/fiducial/corkscrew/other_focal.h"
#include "core/fiducial/corkscrew/pose_near.h"
#include "core/fiducial/corkscrew/twins.h"
#include "core/imaging/carm_image.h"

namespace fluorocut {

using namespace corkscrew;

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr const char* kStep = "corkscrew pose";

// Fits to one image whose log likelihoods differ by less are equal: odds of 10^10, with room for what the noise's
// model does not know.
constexpr double kEqualLikelihood = 25;
constexpr double kSameRad = 0.05;      // two fits this near are one: 3 degrees,
constexpr double kSameDepth = 0.02;    // and this part of the depth
constexpr std::size_t kImageFits = 3;  // of the best shape fits
constexpr std::size_t kTwinFits = 3;
constexpr double kTwinOverlap = 0.55;
// In 100 cluttered scenes: wrong poses are other twists about the right axis. Their lines score 0.76 to 0.85 where the
// right one's score 1, and 0.11 or more below it in 9 scenes of 10; the rest is for fits to the image to decide.
constexpr double kChanceScore = 0.3;
constexpr double kWorseWorth = 0.12;
// The search's best is so clear that no other has to be fitted: nothing but the right one scores so much, and the other
// candidates were behind it before.
constexpr double kClearScore = 0.9, kClearRmsPx = 0.2, kClearLead = 0.12;
constexpr double kClearTwinOverlap = 0.8;  // other twists overlap by 0.79 at most
constexpr double kOtherPoseRad = 0.3;
constexpr double kLeastScore = 0.4;     // below it there is no corkscrew
constexpr double kOtherLayoutPx = 0.6;  // lines met no better are another corkscrew's, or bent
constexpr double kTrackedScore = 0.5;   // below it the previous pose was no start
constexpr double kTrackedRmsPx = 0.4;   // above it neither
// Wrong focal lengths, in pixels: lines met worse than kRoughPx are met with others. In 60 cluttered scenes the best of
// them was 4 % off at most where it was better by a third or more.
constexpr double kRoughPx = 0.12;
constexpr double kMuchBetter = 0.6, kOtherFocal = 0.06;
constexpr std::array kFocalFactors{0.5, 0.65, 0.8, 1.25, 1.55, 2.0};  // tried when nothing is found with the given one
constexpr double kFoundRmsPx = 0.2, kFoundScore = 0.75;
constexpr double kTooNear = 0.5;  // of the focal length: a wrong one shows there, a patient hardly

bool same(const Rigid3& a, const Rigid3& b) {
    const double depth = std::abs(b.translation().z());
    return (a * b.inverse()).rotationAngle() < kSameRad &&
           (a.translation() - b.translation()).norm() < kSameDepth * depth;
}

// What a detector of so many bits shows at most, where the image's largest level lies below it.
double fullScale(double largest) {
    for (const double levels : {1.0, 255.0, 1023.0, 4095.0, 16383.0, 65535.0})
        if (largest <= levels) return levels;
    return 1.05 * largest;
}

// Metal dark. An inverted picture is turned about its full scale: what offset it once had nobody knows, the fits' free
// gains take most of it.
Image metalDark(const Image& image) {
    const double top = fullScale(*std::max_element(image.pixels().begin(), image.pixels().end()));
    Image turned = image;
    for (float& pixel : turned.pixels())
        pixel = static_cast<float>(top - pixel);
    return turned;
}

struct Explanation {
    CorkscrewFit fit;
    bool by_image = false;
    std::string kind;  // how it differs from the answer, when it was made as a twin of it
    bool with_evidence = false;
};

std::string degreesText(double rad) {
    return fmt::format("{:.1f} degrees", degreesFromRadians(rad));
}

class Estimate {
  public:
    Estimate(const Image& image, const CArm& carm, const CorkscrewLayout& layout, const CorkscrewPoseOptions& options)
        : given_(image), image_(&given_), carm_(carm), layout_(layout), options_(options) {}

    Result<CorkscrewPose> run(Progress& progress) {
        const Stopwatch stopwatch;
        CorkscrewPose pose;
        const bool tracked = options_.initial && track();
        Result<void> found = tracked ? Result<void>() : search(progress);
        if (progress.isCancelled()) return cancelled(kStep);
        if (found) found = plausible();
        if (!found) {
            if (const Result<void> scale = otherScale(kFoundScore, progress); !scale) return scale.error();
            return found.error();
        }
        if (const CorkscrewFit& best = explanations_.front().fit;
            best.imager_from_corkscrew.translation().z() < kTooNear * carm_.focal_length_mm) {
            if (const Result<void> scale = otherScale(best.score + 0.05, progress); !scale) return scale.error();
        }
        if (const Result<void> told = tellApart(); !told) return told.error();
        if (!explanations_.front().with_evidence) {
            Result<CorkscrewFit> best =
                refineOnImage(*image_, carm_, layout_, explanations_.front().fit.imager_from_corkscrew, withEvidence());
            if (!best) return best.error();
            explanations_.front().fit = std::move(*best);
        }
        if (const Result<void> fits = perspective(); !fits) return fits.error();
        progress.report(1, "corkscrew found");
        fill(pose);
        pose.tracked = tracked;
        pose.elapsed_ms = stopwatch.ms();
        return pose;
    }

  private:
    // From the previous pose, without a search.
    bool track() {
        const std::optional<NearPose> near = poseNear(given_, carm_, layout_, *options_.initial);
        if (!near) return false;
        setPolarity(near->metal_is_bright);
        const Result<CorkscrewFit> shape = refineOnShape(*image_, carm_, layout_, near->imager_from_corkscrew);
        if (!(shape && shape->score >= kTrackedScore && shape->rms_px <= kTrackedRmsPx)) return false;
        Result<CorkscrewFit> fit = refineOnImage(*image_, carm_, layout_, shape->imager_from_corkscrew, withEvidence());
        // Not asked: fit->converged. In clutter its last steps stay above the noise (pixels change sides), without
        // harm.
        if (!(fit && fit->score >= kTrackedScore && fit->rms_px <= kTrackedRmsPx)) return false;
        explanations_ = {{std::move(*fit), true, {}, true}};
        return true;
    }

    // Cheap looks first: as many fits to the image as there are poses that the lines leave open, nearly always one.
    Result<void> search(Progress& progress) {
        SubProgress detecting(progress, 0, 0.6);
        Result<CorkscrewDetection> detection = detectCorkscrew(given_, carm_, layout_, options_.detection, detecting);
        if (!detection) return detection.error();
        setPolarity(detection->metal_is_bright);
        progress.report(0.6, "fitting the corkscrew's lines");
        const std::vector<CorkscrewCandidate>& candidates = detection->candidates;
        std::vector<Rigid3> starts;
        for (const CorkscrewCandidate& candidate : candidates)
            starts.push_back(candidate.imager_from_corkscrew);
        std::vector<Explanation> shapes = fitShapes({starts.front()}, {});
        const bool clear = standsOut(candidates) && !shapes.empty() && isClear(shapes.front().fit);
        if (!clear) {
            shapes = fitShapes(starts, {});
            if (shapes.empty()) return nothing("lines that start like a corkscrew and end like none");
            std::sort(shapes.begin(), shapes.end(),
                      [](const Explanation& a, const Explanation& b) { return worth(a.fit) > worth(b.fit); });
        }
        progress.report(0.75, "fitting the image");
        const Rigid3 answer = shapes.front().fit.imager_from_corkscrew;
        std::vector<Explanation> twins;
        parallelFor(2, 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                if (i == 0)
                    fitImages(shapes, worth(shapes.front().fit));
                else
                    twins = fittedTwins(answer, starts, clear ? kClearTwinOverlap : kTwinOverlap);
            }
        });
        explanations_ = std::move(shapes);
        sortByLikelihood();
        fitImages(twins, worth(explanations_.front().fit));
        for (Explanation& twin : twins)
            add(std::move(twin));
        sortByLikelihood();
        if (explanations_.size() == 1 && candidates.size() > 1) passedOver(candidates);
        return {};
    }

    // What a fit of the lines is worth beside others: the share of all the wires that it finds, above chance.
    static double worth(const CorkscrewFit& fit) { return (fit.score - kChanceScore) * fit.visible; }
    static bool isClear(const CorkscrewFit& fit) { return fit.score >= kClearScore && fit.rms_px <= kClearRmsPx; }
    static bool standsOut(const std::vector<CorkscrewCandidate>& candidates) {
        return std::all_of(candidates.begin() + 1, candidates.end(), [&](const CorkscrewCandidate& other) {
            return other.score < candidates.front().score - kClearLead;
        });
    }

    // What the answer may be mistaken for, their lines fitted, unless a fit has already been there.
    std::vector<Explanation> fittedTwins(const Rigid3& answer, const std::vector<Rigid3>& known, double overlap) const {
        std::vector<Rigid3> starts;
        std::vector<std::string> kinds;
        for (const Twin& twin : corkscrew::twins(carm_.ideal(), layout_, answer, overlap)) {
            const bool again = std::any_of(known.begin(), known.end(), [&](const Rigid3& one) {
                return (one * twin.imager_from_corkscrew.inverse()).rotationAngle() < 0.15;
            });
            if (again || starts.size() >= kTwinFits) continue;
            starts.push_back(twin.imager_from_corkscrew);
            kinds.push_back(twin.inWords());
        }
        return fitShapes(starts, kinds);
    }

    std::vector<Explanation> fitShapes(const std::vector<Rigid3>& starts, const std::vector<std::string>& kinds) const {
        std::vector<std::optional<CorkscrewFit>> fits(starts.size());
        parallelFor(starts.size(), 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                Result<CorkscrewFit> fit = refineOnShape(*image_, carm_, layout_, starts[i]);
                if (fit) fits[i] = std::move(*fit);
            }
        });
        std::vector<Explanation> found;
        for (std::size_t i = 0; i < starts.size(); ++i) {
            if (!fits[i]) continue;
            const auto again = std::find_if(found.begin(), found.end(), [&](const Explanation& one) {
                return same(one.fit.imager_from_corkscrew, fits[i]->imager_from_corkscrew);
            });
            if (again == found.end())
                found.push_back({std::move(*fits[i]), false, i < kinds.size() ? kinds[i] : std::string()});
            else if (fits[i]->score > again->fit.score)
                again->fit = std::move(*fits[i]);
        }
        return found;
    }

    // Those that their lines do not put behind one of this worth, at most kImageFits. One alone gets its evidence at
    // once.
    void fitImages(std::vector<Explanation>& shapes, double best) const {
        std::vector<Explanation*> open;
        for (Explanation& one : shapes) {
            if (open.size() < kImageFits && worth(one.fit) > best - kWorseWorth) open.push_back(&one);
        }
        parallelFor(open.size(), 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                CorkscrewFitOptions fitting = withEvidence();
                fitting.evidence = open.size() == 1;
                Result<CorkscrewFit> fit =
                    refineOnImage(*image_, carm_, layout_, open[i]->fit.imager_from_corkscrew, fitting);
                if (!fit) continue;
                open[i]->fit = std::move(*fit);
                open[i]->by_image = true;
                open[i]->with_evidence = fitting.evidence;
            }
        });
    }

    // The second best, when it was so much worse in the search that it was not looked at again.
    void passedOver(const std::vector<CorkscrewCandidate>& candidates) {
        const Rigid3& answer = explanations_.front().fit.imager_from_corkscrew;
        const auto other = std::find_if(candidates.begin() + 1, candidates.end(), [&](const CorkscrewCandidate& one) {
            return (one.imager_from_corkscrew * answer.inverse()).rotationAngle() > kOtherPoseRad;
        });
        if (other == candidates.end()) return;
        CorkscrewAlternative alternative;
        alternative.imager_from_corkscrew = other->imager_from_corkscrew;
        alternative.score = other->score;
        alternative.log_likelihood_ratio = kNaN;
        alternative.angle_rad = (other->imager_from_corkscrew * answer.inverse()).rotationAngle();
        alternative.why_not =
            fmt::format("{} away: the search found {:.0f} % of its wires, {:.0f} % of the answer's",
                        degreesText(alternative.angle_rad), 100 * other->score, 100 * candidates.front().score);
        second_best_ = alternative;
    }

    void add(Explanation one) {
        const auto again = std::find_if(explanations_.begin(), explanations_.end(), [&](const Explanation& known) {
            return same(known.fit.imager_from_corkscrew, one.fit.imager_from_corkscrew);
        });
        if (again == explanations_.end()) explanations_.push_back(std::move(one));
    }

    // Fits to the image first, the likeliest in front; then the others by score. Those that came to the same place are
    // one.
    void sortByLikelihood() {
        std::sort(explanations_.begin(), explanations_.end(), [](const Explanation& a, const Explanation& b) {
            if (a.by_image != b.by_image) return a.by_image;
            if (a.by_image) return a.fit.log_likelihood > b.fit.log_likelihood;
            return a.fit.score > b.fit.score;
        });
        std::vector<Explanation> distinct;
        for (Explanation& one : explanations_) {
            const bool again = std::any_of(distinct.begin(), distinct.end(), [&](const Explanation& known) {
                return same(known.fit.imager_from_corkscrew, one.fit.imager_from_corkscrew);
            });
            if (!again) distinct.push_back(std::move(one));
        }
        explanations_ = std::move(distinct);
    }

    // The second best, and whether it is worse.
    Result<void> tellApart() {
        if (explanations_.size() < 2) return {};
        const CorkscrewFit& best = explanations_[0].fit;
        const Explanation& other = explanations_[1];
        CorkscrewAlternative alternative;
        alternative.imager_from_corkscrew = other.fit.imager_from_corkscrew;
        alternative.score = other.fit.score;
        alternative.angle_rad =
            (other.fit.imager_from_corkscrew * best.imager_from_corkscrew.inverse()).rotationAngle();
        const std::string who =
            other.kind.empty() ? fmt::format("{} away", degreesText(alternative.angle_rad)) : other.kind;
        if (!other.by_image) {
            alternative.log_likelihood_ratio = kNaN;
            alternative.why_not =
                fmt::format("{}: only {:.0f} % of the wires are seen where they should be, not {:.0f} %", who,
                            100 * other.fit.score, 100 * best.score);
            second_best_ = alternative;
            return {};
        }
        alternative.log_likelihood_ratio = best.log_likelihood - other.fit.log_likelihood;
        if (alternative.log_likelihood_ratio > kEqualLikelihood) {
            alternative.why_not = fmt::format(
                "{}: explains the image worse, by a log likelihood of {:.0f} (residual {:.2f}, "
                "not {:.2f})",
                who, alternative.log_likelihood_ratio, other.fit.residual, best.residual);
            second_best_ = alternative;
            return {};
        }
        if (options_.initial) {
            // The previous pose decides, if it is near one of the two and far from the other.
            const auto away = [&](const CorkscrewFit& fit) {
                return (fit.imager_from_corkscrew * options_.initial->inverse()).rotationAngle();
            };
            const bool first = away(best) <= away(other.fit);
            const double near = std::min(away(best), away(other.fit)), far = std::max(away(best), away(other.fit));
            if (near < 0.5 && far > 2 * near && far > near + 0.5) {
                if (!first) std::swap(explanations_[0], explanations_[1]);
                alternative.imager_from_corkscrew = explanations_[1].fit.imager_from_corkscrew;
                alternative.score = explanations_[1].fit.score;
                alternative.log_likelihood_ratio *= first ? 1 : -1;
                alternative.why_not =
                    fmt::format("explains the image as well, but lies {} from the initial pose", degreesText(far));
                second_best_ = alternative;
                return {};
            }
        }
        return noSolution(
            kStep,
            fmt::format("two poses that explain the image equally well (log likelihoods differ by {:.1f}), "
                        "{} apart{}",
                        alternative.log_likelihood_ratio, degreesText(alternative.angle_rad),
                        other.kind.empty() ? "" : ": the other one is " + other.kind),
            fmt::format("one that is better by {:.0f}", kEqualLikelihood),
            symmetric() ? "this corkscrew looks the same from both sides: use an asymmetric one, or give "
                          "the pose roughly as a start"
                        : "turn the corkscrew or the C-arm by 10 degrees and take another image");
    }

    // Does the layout look the same after half a turn about an axis through its middle?
    bool symmetric() const {
        const auto& rings = layout_.rings;
        const double sum = rings.front().x_mm + rings.back().x_mm;
        const auto mirrored = [&](double low, double high) { return std::abs(low + high - sum) < 0.5; };
        for (std::size_t i = 0; i < rings.size(); ++i)
            if (!mirrored(rings[i].x_mm, rings[rings.size() - 1 - i].x_mm)) return false;
        return layout_.beads.empty() && mirrored(layout_.helix.x_start_mm, layout_.helix.x_end_mm) &&
               mirrored(layout_.shaft_x_mm[0], layout_.shaft_x_mm[1]);
    }

    // An answer that the layout or the imager's own numbers contradict is none.
    Result<void> plausible() const {
        if (explanations_.empty() || !explanations_.front().by_image) return nothing("no fit to the image that ends");
        const CorkscrewFit& best = explanations_.front().fit;
        if (!(best.score >= kLeastScore)) {
            return nothing(fmt::format("at best {:.0f} % of the wires where they should be", 100 * best.score));
        }
        if (!(best.visible >= options_.detection.least_visible)) {
            return noSolution(kStep,
                              fmt::format("{:.0f} % of the corkscrew's wires inside the image", 100 * best.visible),
                              fmt::format("at least {:.0f} %", 100 * options_.detection.least_visible),
                              "move the corkscrew or the C-arm so that the rings lie in the field");
        }
        if (!(best.rms_px <= kOtherLayoutPx)) {
            return noSolution(
                kStep,
                fmt::format("something like the corkscrew, whose lines the layout meets only to {:.2f} px",
                            best.rms_px),
                fmt::format("{} px", kOtherLayoutPx),
                "see that the layout file is that of the corkscrew in the picture, and that the C-arm's "
                "file has its distortion");
        }
        const double depth = best.imager_from_corkscrew.translation().z();
        if (!(depth < carm_.focal_length_mm)) {
            return noSolution(kStep, fmt::format("the corkscrew {:.0f} mm from the source", depth),
                              fmt::format("less than the detector's {:.0f} mm", carm_.focal_length_mm),
                              "see that the pixel's size and the focal length are the imager's");
        }
        return {};
    }

    // Lines that are met roughly are met with other focal lengths; one that is much better contradicts the C-arm's.
    Result<void> perspective() const {
        const CorkscrewFit& best = explanations_.front().fit;
        if (best.rms_px < kRoughPx) return {};
        ScaledFit here{1, best.imager_from_corkscrew, best.rms_px, best.score};
        // Against the lines' own fit: that of the image serves the image, not them.
        if (const ScaledFit again = scaledFit(*image_, carm_, layout_, here, 1); again.rms_px < here.rms_px)
            here = again;
        const ScaledFit better = bestScaledFit(*image_, carm_, layout_, here);
        const bool other = better.rms_px < kMuchBetter * here.rms_px && std::abs(better.factor - 1) > kOtherFocal;
        if (!other) return {};
        // Crowded lines lean on each other and on the rod's limb: the image itself has the last word.
        CorkscrewFitOptions quick;
        quick.evidence = false;
        const Result<CorkscrewFit> image =
            refineOnImage(*image_, withFocalFactor(carm_, better.factor), layout_, better.imager_from_corkscrew, quick);
        const bool explains = image && image->log_likelihood > best.log_likelihood + kEqualLikelihood;
        return explains ? wrongScale(better) : Result<void>();
    }

    // Where nothing is found with the C-arm's own focal length, or something much too near the source: is there a
    // corkscrew, clearly, with another?
    Result<void> otherScale(double least_score, Progress& progress) {
        const bool bright = bright_;
        ScaledFit best{1, {}, kFoundRmsPx, least_score};
        const auto merit = [](const ScaledFit& fit) { return fit.score - fit.rms_px; };
        for (const double factor : kFocalFactors) {
            if (progress.isCancelled()) return cancelled(kStep);
            const Result<CorkscrewDetection> detection =
                detectCorkscrew(given_, withFocalFactor(carm_, factor), layout_, options_.detection);
            if (!detection) continue;
            setPolarity(detection->metal_is_bright);
            const ScaledFit start{factor, detection->candidates.front().imager_from_corkscrew, 0, least_score};
            const ScaledFit found =
                bestScaledFit(*image_, carm_, layout_, scaledFit(*image_, carm_, layout_, start, factor));
            if (found.rms_px < kFoundRmsPx && merit(found) > merit(best) && std::abs(found.factor - 1) > kOtherFocal)
                best = found;
        }
        setPolarity(bright);
        return best.factor == 1 ? Result<void>() : wrongScale(best);
    }

    Result<void> wrongScale(const ScaledFit& right) const {
        const double focal_px = carm_.focal_length_mm / carm_.pixel_mm.x();
        return noSolution(
            kStep,
            fmt::format("a corkscrew whose perspective asks for a focal length near {:.0f} pixels, a pixel of about "
                        "{:.2g} mm at {:.0f} mm",
                        focal_px * right.factor, carm_.pixel_mm.x() / right.factor, carm_.focal_length_mm),
            fmt::format("the C-arm's {:.0f} mm / {:.4g} mm = {:.0f} pixels", carm_.focal_length_mm, carm_.pixel_mm.x(),
                        focal_px),
            "see that the pixel's size and the focal length are those of this image");
    }

    void fill(CorkscrewPose& pose) const {
        const CorkscrewFit& best = explanations_.front().fit;
        pose.noise_covariance = best.evidence.covariance();
        pose.imager_from_corkscrew = {Frame::imager, Frame::corkscrew, best.imager_from_corkscrew,
                                      best.evidence.covarianceWith(calibrationCovariance(best.evidence)) +
                                          std::pow(options_.calibration.distortion_mm, 2) * best.distortion_gain};
        pose.evidence = best.evidence;
        pose.score = best.score;
        pose.rms_px = best.rms_px;
        pose.visible = best.visible;
        pose.metal_is_bright = bright_;
        pose.second_best = second_best_;
        if (best.visible < 0.95) {
            pose.warnings.push_back(
                fmt::format("Only {:.0f} % of the corkscrew's wires lie inside the image.", 100 * best.visible));
        }
        const Matrix6& covariance = *pose.imager_from_corkscrew.covariance;
        const double rotation = std::sqrt(
            Eigen::SelfAdjointEigenSolver<Matrix3>(covariance.bottomRightCorner<3, 3>()).eigenvalues().maxCoeff());
        const CorkscrewPoseLimits& limits = options_.limits;
        pose.acceptance = {
            atMost("standard deviation of the rotation", degreesFromRadians(rotation),
                   degreesFromRadians(limits.most_rotation_rad), "degrees"),
            atMost("standard deviation in the image plane", std::sqrt(std::max(covariance(0, 0), covariance(1, 1))),
                   limits.most_in_plane_mm, "mm"),
            atMost("standard deviation of the depth", std::sqrt(covariance(2, 2)), limits.most_depth_mm, "mm"),
            atLeast("share of the wires seen where they should be", best.score, limits.least_score, ""),
            atMost("residual of the lines", best.rms_px, limits.most_rms_px, "px")};
    }

    Eigen::MatrixXd calibrationCovariance(const PoseEvidence& evidence) const {
        const CalibrationUncertainty& known = options_.calibration;
        const std::vector<std::string> names = corkscrewParameters(layout_);
        Eigen::VectorXd sigma(evidence.shared.size());
        for (Eigen::Index i = 0; i < sigma.size(); ++i) {
            if (i == 0)
                sigma[i] = known.focal_length;
            else if (i <= 2)
                sigma[i] = known.principal_point_mm / carm_.pixel_mm[i - 1];
            else if (names[static_cast<std::size_t>(i)].ends_with("phase"))
                sigma[i] = known.dimensions_mm / layout_.helix.radius_mm;
            else
                sigma[i] = known.dimensions_mm;
        }
        return sigma.cwiseAbs2().asDiagonal();
    }

    CorkscrewFitOptions withEvidence() const {
        CorkscrewFitOptions fit;
        fit.distortion_length_mm = options_.calibration.distortion_length_mm;
        return fit;
    }

    Error nothing(std::string found) const {
        return noSolution(
            kStep, std::move(found), "a picture of the corkscrew that the layout describes",
            "see that the layout file is that of the corkscrew in the picture, and that most of it is seen");
    }

    void setPolarity(bool bright) {
        bright_ = bright;
        if (bright && turned_.empty()) turned_ = metalDark(given_);
        image_ = bright ? &turned_ : &given_;
    }

    const Image& given_;
    Image turned_;
    const Image* image_;
    const CArm& carm_;
    const CorkscrewLayout& layout_;
    const CorkscrewPoseOptions& options_;
    bool bright_ = false;
    std::vector<Explanation> explanations_;  // the answer first
    std::optional<CorkscrewAlternative> second_best_;
};

}  // namespace

Result<void> CalibrationUncertainty::validate() const {
    return requireRanges({{"calibration.focal_length", focal_length, 0, 1, ""},
                          {"calibration.principal_point_mm", principal_point_mm, 0, 1000, "mm"},
                          {"calibration.distortion_mm", distortion_mm, 0, 100, "mm"},
                          {"calibration.distortion_length_mm", distortion_length_mm, 1, 1000, "mm"},
                          {"calibration.dimensions_mm", dimensions_mm, 0, 10, "mm"}});
}

Result<void> CorkscrewPoseLimits::validate() const {
    return requireRanges({{"limits.most_rotation_rad", most_rotation_rad, 0, 4, "rad"},
                          {"limits.most_in_plane_mm", most_in_plane_mm, 0, 1e4, "mm"},
                          {"limits.most_depth_mm", most_depth_mm, 0, 1e4, "mm"},
                          {"limits.least_score", least_score, 0, 1, ""},
                          {"limits.most_rms_px", most_rms_px, 0, 1e3, "px"}});
}

Result<void> CorkscrewPoseOptions::validate() const {
    if (const Result<void> ok = detection.validate(); !ok) return ok;
    if (const Result<void> ok = calibration.validate(); !ok) return ok;
    return limits.validate();
}

CorkscrewPose::CorkscrewPose()
    : imager_from_corkscrew{Frame::imager, Frame::corkscrew, {}, std::nullopt},
      noise_covariance(Matrix6::Constant(kNaN)),
      rms_px(kNaN),
      elapsed_ms(kNaN) {}

Result<CorkscrewPose> estimateCorkscrewPose(const Image& image, const CArm& carm, const CorkscrewLayout& layout,
                                            const CorkscrewPoseOptions& options, Progress& progress) {
    if (const Result<void> ok = options.validate(); !ok) return ok.error();
    if (const Result<void> ok = layout.validate(); !ok) return ok.error();
    if (const Result<void> ok = carm.validate(); !ok) return ok.error();
    if (const Result<void> ok = requireTakenBy(carm, image); !ok) return ok.error();
    return Estimate(image, carm, layout, options).run(progress);
}

}  // namespace fluorocut
