#include "core/fiducial/bead_detection.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>

#include <fmt/format.h>

#include "core/base/median.h"
#include "core/base/option_checks.h"
#include "core/base/parallel.h"
#include "core/base/stopwatch.h"
#include "core/fiducial/detection/bead_background.h"
#include "core/fiducial/detection/bead_candidates.h"
#include "core/fiducial/detection/bead_fit.h"

namespace fluorocut {
namespace {

using detection::BackgroundPatch;
using detection::BeadCandidate;
using detection::BeadFit;
using detection::BeadShape;
using detection::Disk;
using detection::NoiseModel;
using detection::ShapePrior;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kResponsePerContrast = 0.36;  // 1 / e, of a disk; a sphere's is about the same for its middle's
// Contrast over its standard deviation; where there was too little to measure how the noise is correlated, more: the
// standard deviation is then that of white noise.
constexpr double kLeastSignificance = 6;
constexpr double kLeastSignificanceIfWhite = 12;
// Beads of one phantom differ in contrast by a factor of a few. What is fainter than this part of the fifth strongest
// round thing is texture.
constexpr std::size_t kStrong = 4;
constexpr double kFaint = 0.1;

struct Measured {
    BeadCandidate candidate;
    BackgroundPatch patch;
    BeadFit fit;

    Disk disk() const { return {candidate.center_px, candidate.radius_px}; }
    int halfPatch() const { return static_cast<int>(std::ceil(2.2 * candidate.radius_px)) + 7; }
};

std::vector<Disk> neighboursOf(const std::vector<Measured>& all, std::size_t self) {
    const BeadCandidate& own = all[self].candidate;
    std::vector<Disk> disks;
    for (std::size_t i = 0; i < all.size(); ++i) {
        const BeadCandidate& other = all[i].candidate;
        // What is much fainter is noise or texture, and part of the background.
        if (i == self || other.response < 0.5 * own.response) continue;
        const double distance = (other.center_px - own.center_px).norm();
        if (distance < 4 * own.radius_px + other.radius_px + 12) disks.push_back({other.center_px, other.radius_px});
    }
    return disks;
}

double contrastOf(const BeadFit& fit) {
    return -std::log(std::max(1 - fit.depth, 0.002));
}

bool isBead(const BeadFit& fit, const Image& image, const BeadDetectionOptions& options) {
    if (!fit.ok || !(fit.score >= options.least_score)) return false;
    const double radius = fit.shape.radius_px;
    if (!(2 * radius >= 0.8 * options.least_diameter_px && 2 * radius <= 1.25 * options.most_diameter_px)) return false;
    const double contrast = contrastOf(fit);
    if (!((options.bright ? -contrast : contrast) >= options.least_contrast)) return false;
    if (!(std::abs(fit.depth) >= kLeastSignificance * fit.depth_sigma)) return false;
    // Of a shadow that is cut off by the border nobody knows the middle.
    return fit.center_px.x() - radius >= -0.5 && fit.center_px.y() - radius >= -0.5 &&
           fit.center_px.x() + radius <= image.width() - 0.5 && fit.center_px.y() + radius <= image.height() - 0.5 &&
           fit.covariance_px2.allFinite();
}

// One bead may answer twice; the better of two that overlap by more than half stays.
void dropDoubles(std::vector<BeadDetection>& beads) {
    std::vector<BeadDetection> kept;
    for (const BeadDetection& bead : beads) {
        const bool known = std::any_of(kept.begin(), kept.end(), [&](const BeadDetection& other) {
            return (bead.center_px - other.center_px).norm() < std::max(bead.radius_px, other.radius_px);
        });
        if (!known) kept.push_back(bead);
    }
    beads = std::move(kept);
}

}  // namespace

BeadDetection::BeadDetection()
    : center_px(Vector2::Constant(kNaN)),
      covariance_px2(Matrix2::Constant(kNaN)),
      radius_px(kNaN),
      contrast(kNaN),
      blur_px(kNaN),
      score(kNaN) {}

BeadDetections::BeadDetections() : elapsed_ms(kNaN) {}

Result<void> BeadDetectionOptions::validate() const {
    if (const Result<void> ranges = requireRanges({{"least_diameter_px", least_diameter_px, 2, 400, "px"},
                                                   {"most_diameter_px", most_diameter_px, 2, 400, "px"},
                                                   {"least_contrast", least_contrast, 0.005, 10, ""},
                                                   {"least_score", least_score, 0, 1, ""},
                                                   {"most_beads", static_cast<double>(most_beads), 1, 5000, "beads"}});
        !ranges) {
        return ranges;
    }
    if (!(least_diameter_px <= most_diameter_px)) {
        return invalidOption("most_diameter_px", fmt::format("{:g}", most_diameter_px),
                             fmt::format("at least least_diameter_px, {:g} px", least_diameter_px));
    }
    return {};
}

Result<BeadDetections> detectBeads(const Image& image, const BeadDetectionOptions& options, Progress& progress) {
    const Stopwatch stopwatch;
    if (const Result<void> good = options.validate(); !good) return good.error();
    if (image.width() < 8 || image.height() < 8) {
        return invalidInput("image", fmt::format("{} x {} pixels", image.width(), image.height()),
                            "at least 8 x 8 pixels");
    }
    if (!std::all_of(image.pixels().begin(), image.pixels().end(), [](float v) { return std::isfinite(v); })) {
        return invalidInput("image", "a pixel that is NaN or infinite", "finite intensities");
    }
    progress.report(0, "looking for beads");
    Image log_intensity = detection::logIntensity(image);
    const detection::LatticeDirections directions(log_intensity);
    if (options.bright) {
        for (float& value : log_intensity.pixels())
            value = -value;
    }
    detection::CandidateSearch search{};
    search.least_radius_px = 0.5 * options.least_diameter_px;
    search.most_radius_px = 0.5 * options.most_diameter_px;
    search.least_response = 0.6 * kResponsePerContrast * options.least_contrast;
    search.most = 2 * static_cast<std::size_t>(options.most_beads);
    std::vector<Measured> all;
    const std::vector<BeadCandidate> candidates = detection::findBeadCandidates(log_intensity, search);
    for (const BeadCandidate& candidate : candidates) {
        const BeadCandidate& strong = candidates[std::min(candidates.size() - 1, kStrong)];
        if (candidate.response < kFaint * strong.response) break;
        all.push_back({candidate, {}, {}});
    }
    if (options.bright) {
        for (float& value : log_intensity.pixels())
            value = -value;
    }

    // First round: every candidate by itself, under a noise taken from its surroundings.
    const ShapePrior first_prior;
    const double sign = options.bright ? -1 : 1;
    std::atomic<bool> stopped{false};
    parallelFor(all.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            if (progress.isCancelled()) {
                stopped = true;
                return;
            }
            Measured& one = all[i];
            const Disk disk = one.disk();
            one.patch = detection::backgroundAround(log_intensity, directions, disk, neighboursOf(all, i),
                                                    one.halfPatch(), false);
            // Where the background explains it all there is nothing to fit.
            const double inner = 1 + 0.36 * std::numbers::pi * disk.radius_px * disk.radius_px;
            const double least = std::max(0.4 * options.least_contrast, 4 * one.patch.noise / std::sqrt(inner));
            if (!(one.patch.valid && sign * one.patch.contrast >= least)) continue;
            const double log_noise = std::max(one.patch.noise, 2e-3);
            const double level = std::exp(static_cast<double>(
                one.patch.log_level(one.patch.log_level.width() / 2, one.patch.log_level.height() / 2)));
            const NoiseModel noise =
                NoiseModel::white(0.05 * log_noise * log_noise * level * level, log_noise * log_noise * level);
            one.fit = detection::fitBead(image, one.patch, one.candidate.center_px,
                                         {one.candidate.radius_px, first_prior.log_steepness, first_prior.log_blur},
                                         1 - std::exp(-std::clamp(one.patch.contrast, -3.0, 5.0)), first_prior, noise);
        }
    });
    if (stopped) return cancelled("detectBeads");

    // What the beads have in common: the blur of their edges and the noise.
    progress.report(0.6, "measuring beads");
    std::vector<const BeadFit*> good;
    std::vector<double> blurs;
    for (const Measured& one : all) {
        if (!isBead(one.fit, image, options)) continue;
        good.push_back(&one.fit);
        blurs.push_back(one.fit.shape.log_blur);
    }
    ShapePrior prior;
    if (blurs.size() >= 5) {
        prior.log_blur = median(std::move(blurs));
        prior.log_blur_sigma = 0.2;
    }
    const NoiseModel shared = detection::measureNoise(good, NoiseModel::white(0, 0));
    BeadDetections result;
    std::vector<BeadDetection> found(all.size());
    parallelFor(all.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            Measured& one = all[i];
            if (!isBead(one.fit, image, options)) continue;
            const bool measured = shared.constant > 0;
            if (measured) {
                const BeadFit again = detection::fitBead(image, one.patch, one.fit.center_px, one.fit.shape,
                                                         one.fit.depth, prior, shared);
                if (!again.ok) continue;
                one.fit = again;
                if (!isBead(one.fit, image, options)) continue;
            } else if (!(std::abs(one.fit.depth) >= kLeastSignificanceIfWhite * one.fit.depth_sigma)) {
                continue;
            }
            if (measured && one.patch.lattice) {
                // Now that it is known for a bead, with what happens where grooves cross below it.
                BackgroundPatch patch = detection::backgroundAround(log_intensity, directions, one.disk(),
                                                                    neighboursOf(all, i), one.halfPatch(), true);
                BeadFit better = detection::fitBead(image, patch, one.fit.center_px, one.fit.shape, one.fit.depth,
                                                    prior, shared, true);
                if (better.ok && isBead(better, image, options)) one.fit = std::move(better);
            }
            found[i].center_px = one.fit.center_px;
            found[i].covariance_px2 = one.fit.covariance_px2;
            found[i].radius_px = one.fit.shape.radius_px;
            found[i].contrast = contrastOf(one.fit);
            found[i].blur_px = std::exp(one.fit.shape.log_blur);
            found[i].score = one.fit.score;
        }
    });
    for (std::size_t i = 0; i < all.size(); ++i) {
        if (!std::isfinite(found[i].score)) continue;
        result.beads.push_back(found[i]);
        result.on_lattice += all[i].patch.lattice ? 1 : 0;
    }
    // By what makes a bead: a good score and a strong contrast. Ties by place, so that the order is one and the same.
    const auto merit = [](const BeadDetection& bead) { return bead.score * std::min(1.0, std::abs(bead.contrast)); };
    std::sort(result.beads.begin(), result.beads.end(), [&](const BeadDetection& a, const BeadDetection& b) {
        return std::make_tuple(-merit(a), a.center_px.y(), a.center_px.x()) <
               std::make_tuple(-merit(b), b.center_px.y(), b.center_px.x());
    });
    dropDoubles(result.beads);
    if (result.beads.size() > static_cast<std::size_t>(options.most_beads)) {
        result.warnings.push_back(fmt::format("{} round shadows were found; only the {} clearest are kept.",
                                              result.beads.size(), options.most_beads));
        result.beads.resize(static_cast<std::size_t>(options.most_beads));
    }
    result.columns = image.width();
    result.rows = image.height();
    result.candidates = static_cast<int>(all.size());
    result.elapsed_ms = stopwatch.ms();
    progress.report(1, "looking for beads");
    return result;
}

}  // namespace fluorocut
