#include "core/distortion/groove_detection.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>
#include <tuple>

#include <fmt/format.h>

#include "core/base/median.h"
#include "core/base/option_checks.h"
#include "core/base/stopwatch.h"
#include "core/base/units.h"
#include "core/distortion/groove_consistency.h"
#include "core/distortion/groove_image.h"
#include "core/distortion/groove_segments.h"
#include "core/distortion/groove_spectrum.h"
#include "core/distortion/lattice_phase.h"

namespace fluorocut {
namespace {

using namespace grooves;

constexpr char kWhere[] = "groove detection";
constexpr int kMinSize = 64;               // px
constexpr double kFirstHighPassPx = 20;    // of the image: lets pitches of up to 80 px through
constexpr double kLimit = 3;               // robust standard deviations
constexpr double kMinLikeness = 0.85;      // of the folded cell to the plate's
constexpr double kMinLikenessLead = 0.12;  // over any other reading of the same cell
constexpr double kSureLikeness = 0.98;     // no harmonic is asked any more
constexpr double kMinRepeatability = 0.5;
constexpr double kFirstBlur = 0.045;  // pitches
constexpr double kGrowPitches = 2.5;  // how far from what was found segments are looked for
constexpr int kMaxGrowSteps = 20;
constexpr double kMaxMapSigma = 0.1;     // pitches: where the map is less certain nothing is looked for
constexpr double kMaxPitchRatio = 1.12;  // between the two directions, at the middle of the found segments
constexpr double kMaxSkewRad = 0.12;
constexpr double kMaxPitchChange = 1.4;    // over the image, against its median
constexpr double kMaxContrastRatio = 2.0;  // between directions
constexpr double kMaxAlternation = 0.35;   // of contrast between every second, third, ... groove
constexpr int kMaxMultiple = 7;
constexpr int kMinSegments = 20;   // of each direction
constexpr double kFewShare = 0.6;  // found / expected: less is worth a warning

struct Candidate {
    CoarseLattice lattice;
    double contrast = 0;
    double pitch_px = 0;  // of the image
    double likeness = 0;
};

// The cell that came nearest, for the sentence that refuses.
struct Rejected {
    double best = 0;  // likeness of any kind
    bool inverted = false;
    double likeness = 0, other = 0, pitch_px = 0;
};

// The waves are the lattice's fundamental or a harmonic: in tissue, whose own structure is coarse, the second can be
// the clearer one. Its phase leaves several possible origins; the folded cell tells which, and what the waves are.
std::optional<Candidate> examine(const PreparedImage& image, const WavePair& waves, const GroovedPlate& plate,
                                 const GrooveDetectionOptions& options, Rejected& rejected) {
    const double period = 2 / (waves.first.norm() + waves.second.norm());  // coarse px
    const Image high = highPassed(image, 0.75 * period, kLimit);
    const std::optional<CoarseLattice> traced = traceLattice(high, image.coarse_lit, waves);
    if (!traced) return std::nullopt;
    std::optional<Candidate> best;
    for (const int harmonic : {1, 2, 3}) {
        const double pitch_px = harmonic * period * image.factor;
        if (pitch_px < 0.93 * options.min_pitch_px || pitch_px > 1.07 * options.max_pitch_px) continue;
        CoarseLattice lattice = *traced;
        lattice.map = traced->map.transformed(1.0 / harmonic, Vector2::Zero());
        const FoldedCell cell =
            foldCell(harmonic == 1 ? high : highPassed(image, 0.75 * harmonic * period, kLimit), lattice, plate);
        if (!(cell.repeatability > kMinRepeatability)) continue;
        const std::array<int, 2> shift = cell.bestShift(harmonic);
        const FoldedCell::Reading& reading = cell.at(shift[0], shift[1]);
        const double other = cell.bestOther(shift), inverted = cell.bestInverted();
        if (std::max(reading.likeness, inverted) > rejected.best) {
            rejected = {std::max(reading.likeness, inverted), inverted > reading.likeness, reading.likeness, other,
                        pitch_px};
        }
        if (!(reading.likeness > kMinLikeness && reading.likeness > other + kMinLikenessLead)) continue;
        if (best && best->likeness >= reading.likeness) continue;
        lattice.map = lattice.map.transformed(1, Vector2(shift[0], shift[1]) / FoldedCell::kShifts);
        best = Candidate{lattice, reading.contrast, pitch_px, reading.likeness};
        if (harmonic == 1 && reading.likeness > kSureLikeness) break;
    }
    return best;
}

// Of waves that are whole multiples of others the others come first.
void longestFirst(std::vector<WavePair>& pairs) {
    for (std::size_t n = 0; n < pairs.size(); ++n) {
        for (std::size_t k = n + 1; k < pairs.size(); ++k) {
            const double multiple = std::round(pairs[n].first.norm() / pairs[k].first.norm());
            if (multiple < 2 || (pairs[n].first - multiple * pairs[k].first).norm() > 0.06 * pairs[n].first.norm() ||
                (pairs[n].second - multiple * pairs[k].second).norm() > 0.06 * pairs[n].second.norm())
                continue;
            std::rotate(pairs.begin() + static_cast<std::ptrdiff_t>(n), pairs.begin() + static_cast<std::ptrdiff_t>(k),
                        pairs.begin() + static_cast<std::ptrdiff_t>(k) + 1);
            k = n;
        }
    }
}

Error nothingFound(const WaveSearch& waves, const Rejected& rejected, int factor) {
    const std::string expected = "two perpendicular sets of equally spaced bright lines, the plate's grooves";
    if (rejected.best > kMinLikeness && rejected.inverted) {
        return noSolution(kWhere,
                          fmt::format("a lattice of dark lines on bright ground, pitch {:.1f} px", rejected.pitch_px),
                          expected, "The image seems inverted: give it so that bright means more photons");
    }
    if (rejected.best > 0) {
        return noSolution(kWhere,
                          fmt::format("a pattern that repeats every {:.1f} px, whose cell is not clearly the plate's "
                                      "(likeness {:.2f}, of other patterns {:.2f})",
                                      rejected.pitch_px, rejected.likeness, rejected.other),
                          expected,
                          "Check the plate file's groove width and pitch, and that the plate lies in the beam");
    }
    if (waves.pairs.empty() && waves.strongest_single > 15) {
        return noSolution(
            kWhere,
            fmt::format("parallel lines in one direction only (every {:.1f} px)", factor / waves.strongest.norm()),
            expected, "Check that the plate has grooves in both directions and lies flat on the detector");
    }
    return noSolution(kWhere,
                      waves.pairs.empty()
                          ? std::string("no pattern that repeats in two directions")
                          : fmt::format("no lattice that can be followed (best hint: pitch {:.1f} px, {:.0f} times the "
                                        "background)",
                                        2 * factor / (waves.pairs[0].first.norm() + waves.pairs[0].second.norm()),
                                        waves.pairs[0].strength),
                      expected, "Check that the plate is in the image; use more dose or take objects out of the beam");
}

// Places in the field, a third of a pitch apart, near found segments, where the map is certain.
std::vector<Vector2> placesNear(const std::vector<Segment>& segments, const PreparedImage& image, const LatticeMap& map,
                                double pitch_px) {
    const double step = pitch_px / 3, reach_px = kGrowPitches * pitch_px;
    const int columns = static_cast<int>(image.log.width() / step) + 1;
    const int rows = static_cast<int>(image.log.height() / step) + 1;
    Mask near(columns, rows);
    const int reach = static_cast<int>(std::ceil(reach_px / step));
    for (const Segment& segment : segments) {
        if (segment.state != SegmentState::found) continue;
        const int x = static_cast<int>(segment.start.x() / step), y = static_cast<int>(segment.start.y() / step);
        if (near(x, y) == 2) continue;
        for (int b = std::max(0, y - reach); b <= std::min(rows - 1, y + reach); ++b)
            for (int a = std::max(0, x - reach); a <= std::min(columns - 1, x + reach); ++a)
                if ((a - x) * (a - x) + (b - y) * (b - y) <= reach * reach)
                    near(a, b) = std::max<std::uint8_t>(near(a, b), 1);
        near(x, y) = 2;
    }
    std::vector<Vector2> places;
    for (int y = 0; y < rows; ++y) {
        for (int x = 0; x < columns; ++x) {
            if (!near(x, y)) continue;
            const Vector2 place((x + 0.5) * step, (y + 0.5) * step);
            const int u = static_cast<int>(place.x()), v = static_cast<int>(place.y());
            if (u < image.log.width() && v < image.log.height() && image.seen(u, v) != Seen::outside &&
                std::max(map.sigma(0, place), map.sigma(1, place)) < kMaxMapSigma)
                places.push_back(place);
        }
    }
    return places;
}

double coverageOf(const std::vector<Segment>& segments, const PreparedImage& image, double pitch_px) {
    const double step = pitch_px / 3;
    const int columns = static_cast<int>(image.log.width() / step) + 1;
    const int rows = static_cast<int>(image.log.height() / step) + 1;
    Mask covered(columns, rows);
    for (const Segment& segment : segments) {
        if (segment.state != SegmentState::found) continue;
        const int x = static_cast<int>(segment.start.x() / step), y = static_cast<int>(segment.start.y() / step);
        for (int b = std::max(0, y - 3); b <= std::min(rows - 1, y + 3); ++b)
            for (int a = std::max(0, x - 3); a <= std::min(columns - 1, x + 3); ++a)
                if ((a - x) * (a - x) + (b - y) * (b - y) <= 9)
                    covered(a, b) = static_cast<std::uint8_t>(covered(a, b) | (1 << segment.direction));
    }
    int lit = 0, both = 0;
    for (int y = 0; y < rows; ++y) {
        for (int x = 0; x < columns; ++x) {
            const int u = static_cast<int>((x + 0.5) * step), v = static_cast<int>((y + 0.5) * step);
            if (u >= image.log.width() || v >= image.log.height() || image.seen(u, v) == Seen::outside) continue;
            ++lit;
            both += covered(x, y) == 3;
        }
    }
    return lit > 0 ? static_cast<double>(both) / lit : 0;
}

GrooveCounts count(const std::vector<Segment>& segments, int direction) {
    GrooveCounts counts;
    for (const Segment& segment : segments) {
        if (segment.direction != direction) continue;
        switch (segment.state) {
            case SegmentState::outside:
                ++counts.outside;
                break;
            case SegmentState::hidden:
                ++counts.hidden;
                break;
            case SegmentState::doubtful:
                ++counts.doubtful;
                break;
            case SegmentState::found:
                ++counts.found;
                break;
        }
    }
    counts.expected = counts.found + counts.hidden + counts.doubtful;
    return counts;
}

// Segments that are not among `known` yet.
std::vector<Segment> onlyNew(std::vector<Segment> segments, const std::vector<Segment>& known) {
    std::set<std::tuple<int, int, int>> labels;
    for (const Segment& segment : known)
        labels.emplace(segment.direction, segment.index, segment.between);
    std::erase_if(segments, [&](const Segment& segment) {
        return labels.contains({segment.direction, segment.index, segment.between});
    });
    return segments;
}

std::string seenSentence(const std::vector<Segment>& segments, double pitch_px, double noise) {
    const GrooveCounts y = count(segments, 0), x = count(segments, 1);
    const std::string seen =
        fmt::format("{} of {} groove segments (pitch {:.1f} px", y.found + x.found, y.expected + x.expected, pitch_px);
    if (y.found + x.found == 0) return seen + ")";
    return seen + fmt::format(", contrast {:.1f} %, noise of a pixel {:.1f} %)",
                              50 * (medianContrast(segments, 0) + medianContrast(segments, 1)), 100 * noise);
}

// A lattice that is not the plate's, though it looks like it cell by cell. Empty: none of that.
std::string contradiction(const std::vector<Segment>& segments, const LatticeMap& map, const GroovedPlate& plate) {
    std::vector<double> pitch_x, pitch_y, skew;
    for (const Segment& segment : segments) {
        if (segment.state != SegmentState::found) continue;
        const Eigen::Matrix2d jacobian = map.place(segment.start).jacobian;
        const Vector2 gx = jacobian.row(0).transpose(), gy = jacobian.row(1).transpose();
        if (!(jacobian.determinant() > 0)) return "a lattice that folds over itself";
        pitch_x.push_back(1 / gx.norm());
        pitch_y.push_back(1 / gy.norm());
        skew.push_back(std::asin(gx.normalized().dot(gy.normalized())));
    }
    const double px = median(pitch_x), py = median(pitch_y);
    if (!(std::max(px, py) < kMaxPitchRatio * std::min(px, py)))
        return fmt::format("line spacings of {:.1f} and {:.1f} px in the two directions, which should be equal", px,
                           py);
    if (!(std::abs(median(skew)) < kMaxSkewRad))
        return fmt::format("lines that cross at {:.0f} degrees instead of 90",
                           90 - degreesFromRadians(std::abs(median(skew))));
    for (std::size_t n = 0; n < pitch_x.size(); ++n)
        for (const double change : {pitch_x[n] / px, pitch_y[n] / py})
            if (!(change < kMaxPitchChange && change > 1 / kMaxPitchChange))
                return fmt::format("a spacing that changes by a factor of {:.2f} over the image", change);
    const double cx = medianContrast(segments, 0), cy = medianContrast(segments, 1);
    if (!(std::max(cx, cy) < kMaxContrastRatio * std::min(cx, cy)))
        return fmt::format("a contrast of {:.1f} % across one direction and {:.1f} % across the other", 100 * cx,
                           100 * cy);
    for (int direction = 0; direction < 2; ++direction) {
        int low = std::numeric_limits<int>::max(), high = std::numeric_limits<int>::min();
        for (const Segment& segment : segments) {
            if (segment.direction != direction || segment.state != SegmentState::found) continue;
            low = std::min(low, segment.index);
            high = std::max(high, segment.index);
        }
        // A lattice finer than the plate's finds a groove only at every second, third, ... of its lines.
        for (int step = 2; step <= kMaxMultiple && 3 * step <= high - low + 1; ++step) {
            std::vector<std::vector<double>> contrast(static_cast<std::size_t>(step));
            for (const Segment& segment : segments)
                if (segment.direction == direction && segment.contrast != 0 && segment.index >= low &&
                    segment.index <= high)
                    contrast[static_cast<std::size_t>((segment.index - low) % step)].push_back(segment.contrast);
            double least = std::numeric_limits<double>::infinity(), most = 0;
            for (const auto& values : contrast) {
                least = std::min(least, median(values));
                most = std::max(most, median(values));
            }
            if (!(most - least < kMaxAlternation * most))
                return fmt::format("lines of which every {}. is stronger than the others ({:.1f} and {:.1f} %)", step,
                                   100 * most, 100 * least);
        }
        const int allowed = plate.grooves.value_or(std::array{1 << 20, 1 << 20})[static_cast<std::size_t>(direction)];
        const int most = std::max(
            allowed, plate.grooves.value_or(std::array{1 << 20, 1 << 20})[1 - static_cast<std::size_t>(direction)]);
        if (high - low + 1 > most)  // the plate may lie turned by 90 degrees
            return fmt::format("{} parallel grooves on a plate that has {}", high - low + 1, most);
    }
    return {};
}

// Labels counted from the crossing nearest to `middle`, x within 45 degrees of +u.
void fillPoints(const std::vector<Segment>& segments, const LatticePlace& middle, GroovePoints& points) {
    const double angle = std::atan2(middle.jacobian(0, 1), middle.jacobian(0, 0));
    // Quarter turns that bring the plate's x back within 45 degrees of the columns (0, 1 or -1).
    const int turns = static_cast<int>(std::lround(angle / (0.5 * std::numbers::pi)));
    for (const Segment& segment : segments) {
        if (segment.state != SegmentState::found) continue;
        const int origin = static_cast<int>(std::lround(middle.lattice[segment.direction]));
        GroovePoint point{segment.point(), segment.across, segment.index - origin, segment.sigma_px};
        bool fixes_x = segment.direction == 0;
        if (turns != 0) {
            // x' = -y, y' = x for a turn of +90 degrees; x' = y, y' = -x for -90.
            const bool flip = (turns > 0) != fixes_x;
            if (flip) {
                point.index = -point.index;
                point.across = -point.across;
            }
            fixes_x = !fixes_x;
        }
        (fixes_x ? points.along_y : points.along_x).push_back(point);
    }
    const auto byPlace = [](const GroovePoint& a, const GroovePoint& b) {
        return std::tie(a.index, a.pixel.x(), a.pixel.y()) < std::tie(b.index, b.pixel.x(), b.pixel.y());
    };
    std::sort(points.along_y.begin(), points.along_y.end(), byPlace);
    std::sort(points.along_x.begin(), points.along_x.end(), byPlace);
}

// Everything that follows from a lattice that was traced; noSolution when it turns out not to be the plate's.
Result<GrooveDetection> measureLattice(const PreparedImage& prepared, const Candidate& candidate,
                                       const GroovedPlate& plate, const GrooveDetectionOptions& options,
                                       Progress& progress) {
    progress.report(0, "Measuring the grooves");
    const Image& image = prepared.log;
    const int factor = prepared.factor;
    const Vector2 center(0.5 * (image.width() - 1), 0.5 * (image.height() - 1));
    const double radius = 0.5 * std::max(image.width(), image.height());
    LatticeMap map = candidate.lattice.map.magnified(factor);
    GrooveShape shape;
    shape.width = plate.groove_width_mm / plate.pitch_mm;
    shape.blur_px = {kFirstBlur * candidate.pitch_px, kFirstBlur * candidate.pitch_px};
    shape.contrast = std::clamp(candidate.contrast, 1e-3, 2.0);
    std::vector<Vector2> seeds;
    for (const PhaseNode& node : candidate.lattice.nodes)
        seeds.push_back(factor * node.pixel + Vector2::Constant(0.5 * (factor - 1)));
    std::vector<Segment> segments = segmentsNear(map, seeds, image.width(), image.height());
    measureSegments(prepared, map, shape, segments);
    judgeSegments(segments, map);
    // Outward, into tissue where the waves were not clear enough: a segment's fit uses all there is to be seen of it.
    for (int step = 0; step < kMaxGrowSteps; ++step) {
        if (progress.isCancelled()) return cancelled(kWhere);
        progress.report(0.2 + 0.5 * step / kMaxGrowSteps, "Measuring the grooves");
        const std::optional<LatticeMap> next = mapThrough(segments, map, center, radius);
        if (!next) break;
        map = *next;
        const std::vector<Segment> fresh = onlyNew(
            segmentsNear(map, placesNear(segments, prepared, map, candidate.pitch_px), image.width(), image.height()),
            segments);
        const std::size_t before = segments.size();
        segments.insert(segments.end(), fresh.begin(), fresh.end());
        measureSegments(prepared, map, shape, segments, before);
        judgeSegments(segments, map);
        if (std::none_of(segments.begin() + static_cast<std::ptrdiff_t>(before), segments.end(),
                         [](const Segment& segment) { return segment.state == SegmentState::found; }))
            break;
    }
    // Once more, all of them, with the map and the edges' softness as they are known now.
    if (const std::optional<LatticeMap> next = mapThrough(segments, map, center, radius)) {
        map = *next;
        shape.contrast = std::clamp(0.5 * (medianContrast(segments, 0) + medianContrast(segments, 1)), 1e-3, 2.0);
        shape.blur_px = findBlur(prepared, map, shape, segments);
        segments =
            segmentsNear(map, placesNear(segments, prepared, map, candidate.pitch_px), image.width(), image.height());
        measureSegments(prepared, map, shape, segments);
        judgeSegments(segments, map);
    }
    const int dropped = dropUncertainParts(segments, map, center, radius);

    GrooveDetection detection;
    std::vector<double> noises;
    for (const Segment& segment : segments)
        if (segment.state == SegmentState::found) noises.push_back(segment.noise);
    detection.noise = median(noises);
    const GrooveCounts y = count(segments, 0), x = count(segments, 1);
    const double share = static_cast<double>(y.found + x.found) / std::max(1, y.expected + x.expected);
    if (std::min(y.found, x.found) < kMinSegments || !(share >= options.min_found_share)) {
        return noSolution(kWhere, seenSentence(segments, candidate.pitch_px, detection.noise),
                          fmt::format("at least {} of each direction and {:.0f} % of those in the field", kMinSegments,
                                      100 * options.min_found_share),
                          "Use more dose, take objects out of the beam, or lay the plate over more of the field");
    }
    if (const std::string why = contradiction(segments, map, plate); !why.empty()) {
        return noSolution(kWhere, why + " among " + seenSentence(segments, candidate.pitch_px, detection.noise),
                          "the square lattice of the plate",
                          "Check the plate file and that nothing else with a grid is in the beam");
    }

    const std::optional<LatticeMap> final_map = mapThrough(segments, map, center, radius);
    if (!final_map) throw std::logic_error("groove detection: accepted segments hold no map");
    const LatticePlace middle = final_map->place(center);

    detection.points.columns = image.width();
    detection.points.rows = image.height();
    detection.points.pitch_mm = plate.pitch_mm;
    fillPoints(segments, middle, detection.points);
    detection.pitch_px = 1 / std::sqrt(std::abs(middle.jacobian.determinant()));
    const double angle = std::atan2(middle.jacobian(0, 1), middle.jacobian(0, 0));
    const int turns = static_cast<int>(std::lround(angle / (0.5 * std::numbers::pi)));
    detection.rotation_rad = angle - turns * 0.5 * std::numbers::pi;
    detection.contrast = 0.5 * (medianContrast(segments, 0) + medianContrast(segments, 1));
    detection.edge_blur_px =
        std::sqrt(0.5 * (shape.blur_px[0] * shape.blur_px[0] + shape.blur_px[1] * shape.blur_px[1]));
    detection.along_y = turns == 0 ? y : x;
    detection.along_x = turns == 0 ? x : y;
    detection.coverage = coverageOf(segments, prepared, candidate.pitch_px);
    if (share < kFewShare)
        detection.warnings.push_back("only " + seenSentence(segments, candidate.pitch_px, detection.noise));
    if (dropped > 0) {
        detection.warnings.push_back(fmt::format(
            "{} groove segments are cut off from the others and were left out: their numbers are not certain",
            dropped));
    }
    if (detection.coverage < 0.7) {
        detection.warnings.push_back(fmt::format("the points cover {:.0f} % of the field: elsewhere the map is a guess",
                                                 100 * detection.coverage));
    }
    return detection;
}

}  // namespace

Result<void> GrooveDetectionOptions::validate() const {
    return requireRanges({{"min_pitch_px", min_pitch_px, 8, 80, "px"},
                          {"max_pitch_px", max_pitch_px, min_pitch_px, 80, "px"},
                          {"min_found_share", min_found_share, 0.1, 1, ""}});
}

Result<GrooveDetection> detectGrooves(const Image& image, const GroovedPlate& plate,
                                      const GrooveDetectionOptions& options, Progress& progress) {
    const Stopwatch stopwatch;
    if (const Result<void> good = options.validate(); !good) return good.error();
    if (const Result<void> good = plate.validate(); !good) return good.error();
    if (std::min(image.width(), image.height()) < kMinSize) {
        return noSolution(kWhere, fmt::format("an image of {} x {} px", image.width(), image.height()),
                          fmt::format("at least {} px each way: a lattice needs several grooves", kMinSize),
                          "Give the whole image");
    }
    progress.report(0, "Preparing the image");
    const Result<PreparedImage> prepared = prepare(image, options.min_pitch_px);
    if (!prepared) return prepared.error();
    const int factor = prepared->factor;

    progress.report(0.15, "Looking for the lattice");
    Rejected rejected;
    std::optional<Error> refusal;  // of the first lattice that could be traced
    WaveSearch waves;
    double reached = 0.4;  // of the work
    const Image high = highPassed(*prepared, kFirstHighPassPx / factor, kLimit);
    for (const int patch : {128, 256}) {
        if (progress.isCancelled()) return cancelled(kWhere);
        WaveSearch search = findWaves(high, patch, 0.5 * options.min_pitch_px / factor, options.max_pitch_px / factor);
        longestFirst(search.pairs);
        for (const WavePair& pair : search.pairs) {
            if (progress.isCancelled()) return cancelled(kWhere);
            const std::optional<Candidate> candidate = examine(*prepared, pair, plate, options, rejected);
            if (!candidate) continue;
            SubProgress part(progress, reached, 0.5 * (1 + reached));  // seldom is there more than one lattice
            reached = 0.5 * (1 + reached);
            Result<GrooveDetection> measured = measureLattice(*prepared, *candidate, plate, options, part);
            if (measured) {
                measured->elapsed_ms = stopwatch.ms();
                progress.report(1, "Grooves found");
                return measured;
            }
            if (measured.error().isCancelled()) return measured.error();
            if (!refusal) refusal = measured.error();
        }
        if (search.strongest_single > waves.strongest_single) waves = std::move(search);
    }
    return refusal ? *refusal : nothingFound(waves, rejected, factor);
}

}  // namespace fluorocut
