#include "core/fiducial/corkscrew_detection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <span>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/parallel.h"
#include "core/base/stopwatch.h"
#include "core/fiducial/corkscrew/ring_search.h"
#include "core/fiducial/corkscrew/shaft_lines.h"
#include "core/fiducial/corkscrew/wire_match.h"
#include "core/imaging/carm_image.h"

namespace fluorocut {
namespace {

using namespace corkscrew;

constexpr const char* kStep = "corkscrew detection";
constexpr int kLeastPixels = 48;  // along a side of the image
constexpr int kLines = 24;
constexpr int kGuessesPerLine = 40;
constexpr int kTwistsPerGuess = 3;
constexpr std::size_t kFirstLines = 3;
constexpr std::size_t kFirstGuesses = 48, kFirstStarts = 20;  // fitted to rings; to everything
constexpr std::size_t kMostGuesses = 120, kMostStarts = 40;
constexpr double kClearScore = 0.75, kClearEvidence = 0.3;  // nothing but the corkscrew reaches both
constexpr double kReachPx = 3;                              // of the first polishing
constexpr double kTwistedReachPx = 4;
constexpr std::size_t kTilted = 4;                                 // poses tried at other tilts, when none is clear
constexpr std::array<double, 4> kTilts{-0.12, -0.06, 0.06, 0.12};  // rad
constexpr std::size_t kTwinned = 3;                                // poses whose twins are tried
constexpr double kLeastScore = 0.4;  // of a corkscrew; hips with screws, clamps and spindles reach 0.39, mostly 0.3
constexpr double kPartScore = 0.6, kPartVisible = 0.15;  // of a corkscrew that is cut off, to say so
constexpr double kSureScore = 0.65;                      // no need to try the other polarity
constexpr double kLeastOfBest = 0.55;                    // of the best one's evidence, to be a candidate
constexpr double kSameRotation = 0.09;                   // rad
constexpr double kSameInPlane_mm = 2.5;
constexpr double kSameDepth = 0.025;

struct Found {
    Rigid3 pose;
    WireScore score;
};

bool better(const Found& a, const Found& b) {
    return a.score.evidence > b.score.evidence;
}

bool isClear(const Found& one) {
    return one.score.score >= kClearScore && one.score.evidence >= kClearEvidence;
}

bool alike(const Rigid3& a, const Rigid3& b) {
    const Vector3 away = a.translation() - b.translation();
    return a.rotation().angularDistance(b.rotation()) < kSameRotation && away.head<2>().norm() < kSameInPlane_mm &&
           std::abs(away.z()) < kSameDepth * a.translation().z();
}

void sortDistinct(std::vector<Found>& all, std::size_t most) {
    std::stable_sort(all.begin(), all.end(), better);
    std::vector<Found> kept;
    for (const Found& one : all) {
        if (kept.size() >= most) break;
        if (std::none_of(kept.begin(), kept.end(), [&](const Found& other) { return alike(one.pose, other.pose); }))
            kept.push_back(one);
    }
    all = std::move(kept);
}

Rigid3 aboutAxis(const Rigid3& pose, double angle_rad) {
    return {pose.rotation() * Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, Vector3::UnitX())), pose.translation()};
}

double middleOf(const CorkscrewLayout& layout) {
    return 0.5 * (layout.rings.front().x_mm + layout.rings.back().x_mm);
}

// The axis tilted to the other side of the plane across the ray through the middle: at a distance, rings look the same.
Rigid3 otherRoll(const Rigid3& pose, double middle_mm) {
    const Vector3 axis = pose.rotate(Vector3::UnitX()), middle = pose * Vector3(middle_mm, 0, 0);
    const Vector3 ray = middle.normalized(), flipped = axis - 2 * axis.dot(ray) * ray;
    const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(axis, flipped) * pose.rotation();
    return {turn, middle - turn * Vector3(middle_mm, 0, 0)};
}

// The axis turned round.
Rigid3 reversed(const Rigid3& pose, double middle_mm) {
    const Eigen::Quaterniond turn =
        pose.rotation() * Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi, Vector3::UnitZ()));
    return {turn, pose * Vector3(middle_mm, 0, 0) - turn * Vector3(middle_mm, 0, 0)};
}

class Search {
  public:
    Search(const CorkscrewLayout& layout, const CorkscrewDetectionOptions& options)
        : layout_(layout), options_(options), samples_(layout), middle_mm_(middleOf(layout)) {}

    // Best first, distinct. Empty: no line, or nothing round it. First the lines that stand out most and the guesses
    // that look best, which is nearly always enough; only then everything.
    std::vector<Found> run(const RidgeImage& ridges) const {
        const std::vector<ImageLine> lines = shaftLines(ridges.shaft_points, ridges.image.carm, kLines);
        const std::size_t first = std::min(lines.size(), kFirstLines);
        std::vector<AxisGuess> guesses = guessesAlong(ridges, std::span(lines).first(first));
        std::vector<Found> found = fitted(ridges, guesses, kFirstGuesses, kFirstStarts);
        if (found.empty() || !isClear(found.front())) {
            const std::vector<AxisGuess> more = guessesAlong(ridges, std::span(lines).subspan(first));
            guesses.insert(guesses.end(), more.begin(), more.end());
            found = fitted(ridges, guesses, kMostGuesses, kMostStarts);
            if (found.empty() || !isClear(found.front())) addTilted(ridges, found);
        }
        addTwins(ridges, found);
        sortDistinct(found, static_cast<std::size_t>(options_.most_candidates));
        return found;
    }

  private:
    struct Start {
        Rigid3 pose;
        double score;
    };

    std::vector<AxisGuess> guessesAlong(const RidgeImage& ridges, std::span<const ImageLine> lines) const {
        std::vector<std::vector<AxisGuess>> per_line(lines.size());
        parallelFor(lines.size(), 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                per_line[i] =
                    ringPatterns(ridges.wires_dilated, ridges.image.carm, layout_, lines[i], options_, kGuessesPerLine);
            }
        });
        std::vector<AxisGuess> guesses;
        for (const std::vector<AxisGuess>& some : per_line)
            guesses.insert(guesses.end(), some.begin(), some.end());
        return guesses;
    }

    // The best guesses, fitted to their rings, then turned, then fitted to all; best first, distinct.
    std::vector<Found> fitted(const RidgeImage& ridges, std::vector<AxisGuess> guesses, std::size_t most_guesses,
                              std::size_t most_starts) const {
        std::stable_sort(guesses.begin(), guesses.end(),
                         [](const AxisGuess& a, const AxisGuess& b) { return a.score > b.score; });
        if (guesses.size() > most_guesses) guesses.resize(most_guesses);
        parallelFor(guesses.size(), 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i)
                guesses[i] = alongRings(ridges, guesses[i].imager_from_corkscrew, kReachPx);
        });
        std::vector<Found> found = polishedTwists(ridges, guesses, kTwistsPerGuess, most_starts);
        sortDistinct(found, most_starts);
        return found;
    }

    AxisGuess alongRings(const RidgeImage& ridges, const Rigid3& pose, double reach_px) const {
        const Rigid3 better_pose = polished(ridges, samples_, pose, reach_px, Wires::rings);
        return {better_pose, wireScore(ridges, samples_.rings(), better_pose).evidence};
    }

    std::vector<Found> polishedTwists(const RidgeImage& ridges, const std::vector<AxisGuess>& guesses, int twists,
                                      std::size_t most) const {
        const double ring_share =
            static_cast<double>(samples_.first_of_helix) / static_cast<double>(samples_.wires.size());
        std::vector<std::vector<Start>> per_guess(guesses.size());
        parallelFor(guesses.size(), 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                const AxisGuess& guess = guesses[i];
                for (const Twist& twist : bestTwists(ridges, samples_, guess.imager_from_corkscrew, twists)) {
                    per_guess[i].push_back({aboutAxis(guess.imager_from_corkscrew, twist.angle_rad),
                                            ring_share * guess.score + (1 - ring_share) * twist.score});
                }
            }
        });
        std::vector<Start> starts;
        for (const std::vector<Start>& some : per_guess)
            starts.insert(starts.end(), some.begin(), some.end());
        std::stable_sort(starts.begin(), starts.end(),
                         [](const Start& a, const Start& b) { return a.score > b.score; });
        if (starts.size() > most) starts.resize(most);
        std::vector<Found> found(starts.size());
        parallelFor(starts.size(), 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                found[i].pose = polished(ridges, samples_, starts[i].pose, kTwistedReachPx);
                found[i].score = wireScore(ridges, samples_.wires, found[i].pose);
            }
        });
        return found;
    }

    void addFitted(const RidgeImage& ridges, const std::vector<Rigid3>& starts, int twists,
                   std::vector<Found>& found) const {
        std::vector<AxisGuess> guesses(starts.size());
        parallelFor(starts.size(), 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i)
                guesses[i] = alongRings(ridges, starts[i], kTwistedReachPx);
        });
        const std::vector<Found> more = polishedTwists(ridges, guesses, twists, kMostStarts);
        found.insert(found.end(), more.begin(), more.end());
        sortDistinct(found, kMostStarts);
    }

    // At a steep roll, rings of a wrong tilt may be caught by the rings beside them.
    void addTilted(const RidgeImage& ridges, std::vector<Found>& found) const {
        std::vector<Rigid3> tilted;
        for (std::size_t i = 0; i < std::min(found.size(), kTilted); ++i) {
            const Rigid3& pose = found[i].pose;
            const Vector3 axis = pose.rotate(Vector3::UnitX()), side = (pose.translation().cross(axis)).normalized();
            const Vector3 middle = pose * Vector3(middle_mm_, 0, 0);
            for (const double tilt : kTilts) {
                const Eigen::Quaterniond turn = Eigen::Quaterniond(Eigen::AngleAxisd(tilt, side)) * pose.rotation();
                tilted.emplace_back(turn, middle - turn * Vector3(middle_mm_, 0, 0));
            }
        }
        addFitted(ridges, tilted, 2, found);
    }

    void addTwins(const RidgeImage& ridges, std::vector<Found>& found) const {
        std::vector<Rigid3> twins;
        for (std::size_t i = 0; i < std::min(found.size(), kTwinned); ++i) {
            const Rigid3& pose = found[i].pose;
            const Rigid3 turned = reversed(pose, middle_mm_);
            for (const Rigid3& twin : {pose, otherRoll(pose, middle_mm_), turned, otherRoll(turned, middle_mm_)})
                twins.push_back(twin);
        }
        addFitted(ridges, twins, 2, found);
    }

    const CorkscrewLayout& layout_;
    const CorkscrewDetectionOptions& options_;
    WireSamples samples_;
    double middle_mm_;
};

Result<void> requireUsable(const Image& image, const CArm& carm) {
    if (const auto good = carm.validate(); !good) return good;
    if (const auto good = requireTakenBy(carm, image); !good) return good;
    if (image.width() < kLeastPixels || image.height() < kLeastPixels) {
        return invalidInput("image", fmt::format("{} x {} pixels", image.width(), image.height()),
                            fmt::format("at least {0} x {0}", kLeastPixels));
    }
    return {};
}

Error whyNot(const std::vector<Found>& best, const CorkscrewLayout& layout, const CorkscrewDetectionOptions& options) {
    const WireScore score = best.empty() ? WireScore{} : best.front().score;
    if (score.score >= kPartScore && score.visible >= kPartVisible) {
        return noSolution(
            kStep,
            fmt::format("only {:.0f} % of the corkscrew's wires inside the lit field and not behind opaque metal",
                        100 * score.visible),
            fmt::format("at least {:.0f} %", 100 * options.least_visible),
            "move the C-arm or the corkscrew toward the middle of the image");
    }
    return noSolution(kStep,
                      best.empty() ? "no straight line with rings round it"
                                   : fmt::format("nothing that shows more than {:.0f} % of its wires",
                                                 100 * std::max(0.0, score.score)),
                      fmt::format("a shaft of {:.3g} mm with {} rings and a helix round it", 2 * layout.shaft_radius_mm,
                                  layout.rings.size()),
                      "check that the corkscrew is in the image and that its layout file is the right one");
}

}  // namespace

CorkscrewDetection::CorkscrewDetection() : elapsed_ms(std::numeric_limits<double>::quiet_NaN()) {}

Result<void> CorkscrewDetectionOptions::validate() const {
    if (const auto good = requireRanges({{"least_depth", least_depth, 0.1, 0.99, "of the focal length"},
                                         {"most_depth", most_depth, 0.1, 0.999, "of the focal length"},
                                         {"steepest_rad", steepest_rad, 0.1, 1.4, "rad"},
                                         {"least_visible", least_visible, 0.2, 1, ""},
                                         {"most_candidates", static_cast<double>(most_candidates), 1, 32, ""}});
        !good) {
        return good;
    }
    if (!(least_depth < most_depth)) {
        return invalidOption("least_depth", fmt::format("{:.3g}", least_depth),
                             fmt::format("less than most_depth, {:.3g}", most_depth));
    }
    return {};
}

Result<CorkscrewDetection> detectCorkscrew(const Image& image, const CArm& carm, const CorkscrewLayout& layout,
                                           const CorkscrewDetectionOptions& options, Progress& progress) {
    const Stopwatch stopwatch;
    if (const auto good = options.validate(); !good) return good.error();
    if (const auto good = layout.validate(); !good) return good.error();
    if (const auto good = requireUsable(image, carm); !good) return good.error();

    const double pixel_mm = workingPixel(layout);
    const Search search(layout, options);
    std::vector<Found> best;
    CorkscrewDetection detection;
    Result<WorkingImage> dark = workingImage(image, carm, pixel_mm, false);
    if (!dark) return dark.error();
    const bool bright_first = looksBright(*dark);
    for (const bool second : {false, true}) {
        if (progress.isCancelled()) return cancelled(kStep);
        progress.report(second ? 0.5 : 0.05, "looking for the corkscrew");
        const bool bright = bright_first != second;
        Result<WorkingImage> working = bright ? workingImage(image, carm, pixel_mm, true) : std::move(dark);
        if (!working) return working.error();
        std::vector<Found> found = search.run(ridgeImage(std::move(*working), layout));
        if (!found.empty() && (best.empty() || better(found.front(), best.front()))) {
            best = std::move(found);
            detection.metal_is_bright = bright;
        }
        if (!best.empty() && best.front().score.score >= kSureScore) break;
    }
    for (const Found& one : best) {
        if (one.score.evidence < kLeastOfBest * best.front().score.evidence) break;
        if (one.score.score >= kLeastScore && one.score.visible >= options.least_visible)
            detection.candidates.push_back({one.pose, one.score.score, one.score.visible});
    }
    if (detection.candidates.empty()) return whyNot(best, layout, options);
    progress.report(1, "corkscrew found");
    detection.elapsed_ms = stopwatch.ms();
    return detection;
}

}  // namespace fluorocut
