#include "core/distortion/lattice_phase.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <optional>

#include "core/base/median.h"
#include "core/base/parallel.h"
#include "core/image/blur.h"

namespace fluorocut::grooves {
namespace {

constexpr double kNodesPerPitch = 5;
constexpr double kWindowPitches = 1.0;  // sigma of the Gaussian in which a phase is measured
constexpr double kNoisePitches = 1.0;   // the same for the noise
constexpr double kMinClarity = 3.0;
constexpr double kMaxPhaseStep = 0.05;        // cycles, between neighbouring nodes, against the carrier waves
constexpr double kSeedPitches = 2.5;          // half the side of the first patch
constexpr double kRingPitches = 1.0;          // how far growth extrapolates
constexpr double kJumpPitches = 6.0;          // the same when nothing is left nearer
constexpr double kMaxPredictionSigma = 0.11;  // pitches: four of these are less than half a pitch
constexpr double kNodeSigma = 0.04;           // pitches, of a node's phase, the bend beyond a polynomial included
constexpr double kMaxNodeMisfit = 0.2;        // pitches, of a new node
constexpr double kMaxNodeResidual = 0.12;     // pitches, of a node that stays
constexpr double kMaxBend = 0.3;              // of the map's waves against the carriers, in their length
constexpr double kMaxSlopeError = 0.12;       // cycles, between nodes 4 apart
constexpr std::size_t kMaxFitNodes = 700;
constexpr std::size_t kMinNodes = 500;  // 20 square pitches
constexpr int kMaxSteps = 80;
constexpr int kSeeds = 3;
constexpr double kEnoughShare = 0.4;  // of the lit nodes: no other seed is tried

struct Node {
    std::array<float, 2> phase = {0, 0};  // cycles, of the demodulated waves
    float clarity = 0;
    bool lit = false;
    bool reached = false;
};

struct NodeGrid {
    int columns = 0, rows = 0, block = 0;
    std::vector<Node> nodes;
    Node& at(int x, int y) { return nodes[static_cast<std::size_t>(y * columns + x)]; }
    const Node& at(int x, int y) const { return nodes[static_cast<std::size_t>(y * columns + x)]; }
    Vector2 pixel(int x, int y) const { return {(x + 0.5) * block - 0.5, (y + 0.5) * block - 0.5}; }
};

// Mean of image * exp(-2 pi i wave . pixel) under a Gaussian, at every node: real and imaginary part.
std::array<Image, 2> demodulated(const Image& high, const NodeGrid& grid, const Vector2& wave) {
    std::array<Image, 2> result = {Image(grid.columns, grid.rows), Image(grid.columns, grid.rows)};
    const std::complex<float> step = std::polar(1.0f, static_cast<float>(-2 * std::numbers::pi * wave.x()));
    parallelFor(static_cast<std::size_t>(grid.rows), 8, [&](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            for (int b = 0; b < grid.block; ++b) {
                const int v = y * grid.block + b;
                const float* row = high.row(v);
                for (int x = 0; x < grid.columns; ++x) {
                    const double cycles = wave.x() * x * grid.block + wave.y() * v;
                    std::complex<float> turn =
                        std::polar(1.0f, static_cast<float>(-2 * std::numbers::pi * (cycles - std::floor(cycles))));
                    float re = 0, im = 0;
                    for (int a = 0; a < grid.block; ++a) {
                        const float value = row[x * grid.block + a];
                        re += value * turn.real();
                        im += value * turn.imag();
                        turn = {turn.real() * step.real() - turn.imag() * step.imag(),
                                turn.real() * step.imag() + turn.imag() * step.real()};
                    }
                    result[0](x, y) += re;
                    result[1](x, y) += im;
                }
            }
        }
    });
    const double sigma = kWindowPitches / (std::hypot(wave.x(), wave.y()) * grid.block);
    for (Image& part : result)
        part = gaussianBlurred(part, sigma);
    return result;
}

NodeGrid analyse(const Image& high, const Image& lit, const WavePair& waves) {
    const double pitch = 2 / (waves.first.norm() + waves.second.norm());
    NodeGrid grid;
    grid.block = std::max(2, static_cast<int>(std::lround(pitch / kNodesPerPitch)));
    grid.columns = high.width() / grid.block;
    grid.rows = high.height() / grid.block;
    grid.nodes.resize(static_cast<std::size_t>(grid.columns) * static_cast<std::size_t>(grid.rows));
    const auto first = demodulated(high, grid, waves.first), second = demodulated(high, grid, waves.second);
    // Waves of the same length along the diagonals: the lattice has none, so what is seen there is noise and objects.
    const auto between = demodulated(high, grid, std::sqrt(0.5) * (waves.first + waves.second));
    const auto aside = demodulated(high, grid, std::sqrt(0.5) * (waves.first - waves.second));
    Image other(grid.columns, grid.rows);
    for (std::size_t n = 0; n < other.size(); ++n) {
        for (const auto* wave : {&between, &aside})
            for (const Image& part : *wave)
                other.pixels()[n] += 0.5f * part.pixels()[n] * part.pixels()[n];
    }
    other = gaussianBlurred(other, kNoisePitches * kNodesPerPitch);
    std::vector<float> others;
    for (int y = 0; y < grid.rows; ++y) {
        for (int x = 0; x < grid.columns; ++x) {
            int lit_pixels = 0;
            for (int b = 0; b < grid.block; ++b)
                for (int a = 0; a < grid.block; ++a)
                    lit_pixels += lit(x * grid.block + a, y * grid.block + b) > 0.5f;
            Node& node = grid.at(x, y);
            node.lit = 2 * lit_pixels > grid.block * grid.block;
            if (!node.lit) continue;
            others.push_back(std::sqrt(std::max(0.0f, other(x, y))));
            node.clarity =
                std::min(std::hypot(first[0](x, y), first[1](x, y)), std::hypot(second[0](x, y), second[1](x, y)));
            const float turn = 1 / (2 * std::numbers::pi_v<float>);
            node.phase = {turn * std::atan2(first[1](x, y), first[0](x, y)),
                          turn * std::atan2(second[1](x, y), second[0](x, y))};
        }
    }
    if (others.empty()) return grid;
    const float least = std::max(0.5f * median(std::move(others)), 1e-12f);
    for (std::size_t n = 0; n < grid.nodes.size(); ++n)
        grid.nodes[n].clarity /= std::max(std::sqrt(std::max(0.0f, other.pixels()[n])), least);
    return grid;
}

float wrapped(float cycles) {
    return cycles - std::round(cycles);
}

// Grows the lattice over the nodes. A node's phase is only known up to whole cycles; which, is settled by a polynomial
// through the nodes taken so far, extrapolated by no more than a pitch at a time, so that no path through noise or
// along an edge can slip a cycle. The order rises with the size of the part that is covered.
class Growth {
  public:
    Growth(NodeGrid& grid, const WavePair& waves, const Vector2& center, double radius)
        : grid_(grid), waves_(waves), center_(center), radius_(radius) {}

    // From the clearest node that has not been taken. Returns the number of nodes taken.
    std::size_t growFrom(int seed_x, int seed_y) {
        takeSeed(seed_x, seed_y);
        for (int step = 0; step < kMaxSteps && refit(); ++step) {
            if (step % 4 == 3) prune();
            if (takeRing(kRingPitches) == 0 && takeRing(kJumpPitches) == 0) break;
        }
        prune();
        return taken_.size();
    }

    std::vector<PhaseNode> nodes() const {
        std::vector<PhaseNode> result;
        for (const auto& [x, y] : taken_)
            result.push_back({grid_.pixel(x, y), latticeAt(x, y), static_cast<double>(grid_.at(x, y).clarity)});
        return result;
    }
    const std::optional<LatticeMap>& map() const { return map_; }

  private:
    // A demodulated phase of 0 at the origin of the carrier wave: a bright line where wave . pixel + phase is whole.
    Vector2 latticeAt(int x, int y) const {
        const Vector2 pixel = grid_.pixel(x, y);
        const Node& node = grid_.at(x, y);
        return {waves_.first.dot(pixel) + static_cast<double>(node.phase[0]),
                waves_.second.dot(pixel) + static_cast<double>(node.phase[1])};
    }

    // Around the seed, phases of neighbours differ little.
    void takeSeed(int seed_x, int seed_y) {
        const int reach = static_cast<int>(kSeedPitches * kNodesPerPitch);
        taken_.emplace_back(seed_x, seed_y);
        grid_.at(seed_x, seed_y).reached = true;
        for (std::size_t n = 0; n < taken_.size(); ++n) {
            const auto [x, y] = taken_[n];
            for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
                const int nx = x + dx, ny = y + dy;
                if (nx < 0 || ny < 0 || nx >= grid_.columns || ny >= grid_.rows) continue;
                if (std::abs(nx - seed_x) > reach || std::abs(ny - seed_y) > reach) continue;
                Node& to = grid_.at(nx, ny);
                if (to.reached || static_cast<double>(to.clarity) < kMinClarity) continue;
                const Node& from = grid_.at(x, y);
                const float first = wrapped(to.phase[0] - from.phase[0]), second = wrapped(to.phase[1] - from.phase[1]);
                if (std::max(std::abs(first), std::abs(second)) > static_cast<float>(kMaxPhaseStep)) continue;
                to.phase = {from.phase[0] + first, from.phase[1] + second};
                to.reached = true;
                taken_.emplace_back(nx, ny);
            }
        }
    }

    bool refit() {
        Eigen::Matrix2d carriers;
        carriers << waves_.first.transpose(), waves_.second.transpose();
        LatticeMap next(center_, radius_, carriers);
        const std::size_t step = (taken_.size() + kMaxFitNodes - 1) / kMaxFitNodes;
        // Nodes that share a Gaussian window tell the same.
        const double nodes_per_window = 4 * std::numbers::pi * std::pow(kWindowPitches * kNodesPerPitch, 2);
        const double weight = static_cast<double>(step) / (std::max(1.0, nodes_per_window) * kNodeSigma * kNodeSigma);
        for (int c = 0; c < 2; ++c) {
            std::vector<LatticeSample> samples;
            for (std::size_t n = 0; n < taken_.size(); n += step) {
                const auto& [x, y] = taken_[n];
                samples.push_back({grid_.pixel(x, y), latticeAt(x, y)[c], weight});
            }
            if (!next.fit(c, samples, kMaxNodeResidual)) return false;
        }
        map_ = next;
        return true;
    }

    // Difference between what a node shows and what the map says, each within half a cycle.
    Vector2 misfit(int x, int y, const Vector2& predicted) const {
        const Vector2 difference = latticeAt(x, y) - predicted;
        return difference - difference.array().round().matrix();
    }

    // The phase must not only fit the map but change with place as the map says, and the map not stray far from the
    // carrier waves: without this, a map gone astray finds nodes that happen to fit.
    bool agreesInSlope(int x, int y, const Eigen::Matrix2d& jacobian) const {
        Eigen::Matrix2d bend = jacobian;
        bend.row(0) -= waves_.first.transpose();
        bend.row(1) -= waves_.second.transpose();
        if (!(bend.cwiseAbs().maxCoeff() * grid_.block * kNodesPerPitch < kMaxBend)) return false;
        constexpr int kStep = 2;
        for (const auto& [dx, dy] : {std::pair{kStep, 0}, {0, kStep}}) {
            const int xa = std::max(0, x - dx), xb = std::min(grid_.columns - 1, x + dx);
            const int ya = std::max(0, y - dy), yb = std::min(grid_.rows - 1, y + dy);
            const Vector2 expected = bend * Vector2((xb - xa) * grid_.block, (yb - ya) * grid_.block);
            for (std::size_t c = 0; c < 2; ++c) {
                const float seen = wrapped(grid_.at(xb, yb).phase[c] - grid_.at(xa, ya).phase[c]);
                if (!(std::abs(static_cast<double>(seen) - expected[static_cast<Eigen::Index>(c)]) < kMaxSlopeError))
                    return false;
            }
        }
        return true;
    }

    // Takes clear nodes within `pitches` of what is taken that agree with the map. Returns how many.
    std::size_t takeRing(double pitches) {
        const int reach = static_cast<int>(pitches * kNodesPerPitch);
        std::vector<int> columns(static_cast<std::size_t>(grid_.columns) * static_cast<std::size_t>(grid_.rows), 0);
        // Square neighbourhoods by two running passes.
        const auto place = [&](int x, int y) { return static_cast<std::size_t>(y * grid_.columns + x); };
        for (int y = 0; y < grid_.rows; ++y) {
            int last = -reach - 1;
            for (int x = 0; x < grid_.columns; ++x) {
                if (grid_.at(x, y).reached) last = x;
                if (x - last <= reach) columns[place(x, y)] = 1;
            }
            last = grid_.columns + reach;
            for (int x = grid_.columns - 1; x >= 0; --x) {
                if (grid_.at(x, y).reached) last = x;
                if (last - x <= reach) columns[place(x, y)] = 1;
            }
        }
        std::vector<std::pair<int, int>> fresh;
        for (int x = 0; x < grid_.columns; ++x) {
            std::vector<int> near(static_cast<std::size_t>(grid_.rows), 0);
            int last = -reach - 1;
            for (int y = 0; y < grid_.rows; ++y) {
                if (columns[place(x, y)]) last = y;
                if (y - last <= reach) near[static_cast<std::size_t>(y)] = 1;
            }
            last = grid_.rows + reach;
            for (int y = grid_.rows - 1; y >= 0; --y) {
                if (columns[place(x, y)]) last = y;
                if (last - y <= reach) near[static_cast<std::size_t>(y)] = 1;
                Node& node = grid_.at(x, y);
                if (!near[static_cast<std::size_t>(y)] || node.reached ||
                    static_cast<double>(node.clarity) < kMinClarity)
                    continue;
                const LatticePlace there = map_->place(grid_.pixel(x, y));
                const Vector2& predicted = there.lattice;
                const Vector2 miss = misfit(x, y, predicted);
                if (!(miss.cwiseAbs().maxCoeff() < kMaxNodeMisfit) || !agreesInSlope(x, y, there.jacobian)) continue;
                const Vector2 pixel = grid_.pixel(x, y);
                if (!(std::max(map_->sigma(0, pixel), map_->sigma(1, pixel)) < kMaxPredictionSigma)) continue;
                const Vector2 cycles = predicted + miss - latticeAt(x, y);
                node.phase[0] += static_cast<float>(std::round(cycles.x()));
                node.phase[1] += static_cast<float>(std::round(cycles.y()));
                fresh.emplace_back(x, y);
            }
        }
        for (const auto& [x, y] : fresh)
            grid_.at(x, y).reached = true;
        taken_.insert(taken_.end(), fresh.begin(), fresh.end());
        return fresh.size();
    }

    // Gives back nodes that the map, now knowing more, contradicts.
    void prune() {
        if (!map_) return;
        const auto contradicted = [&](const std::pair<int, int>& at) {
            const Vector2 miss = latticeAt(at.first, at.second) - map_->at(grid_.pixel(at.first, at.second));
            return !(miss.cwiseAbs().maxCoeff() < kMaxNodeResidual);
        };
        const auto kept =
            std::stable_partition(taken_.begin(), taken_.end(), [&](const auto& at) { return !contradicted(at); });
        for (auto at = kept; at != taken_.end(); ++at)
            grid_.at(at->first, at->second).reached = false;
        taken_.erase(kept, taken_.end());
    }

    NodeGrid& grid_;
    WavePair waves_;
    Vector2 center_;
    double radius_;
    std::vector<std::pair<int, int>> taken_;
    std::optional<LatticeMap> map_;
};

}  // namespace

std::optional<CoarseLattice> traceLattice(const Image& high, const Image& lit, const WavePair& waves) {
    NodeGrid grid = analyse(high, lit, waves);
    const Vector2 center(0.5 * (high.width() - 1), 0.5 * (high.height() - 1));
    const double radius = 0.5 * std::max(high.width(), high.height());
    const auto lit_nodes = static_cast<double>(
        std::count_if(grid.nodes.begin(), grid.nodes.end(), [](const Node& node) { return node.lit; }));

    // The clearest place may be an object's own pattern: then another seed gets further.
    std::optional<CoarseLattice> best;
    Mask tried(grid.columns, grid.rows);
    for (int attempt = 0; attempt < kSeeds; ++attempt) {
        std::pair<int, int> seed{0, 0};
        float clearest = static_cast<float>(kMinClarity);
        for (int y = 0; y < grid.rows; ++y) {
            for (int x = 0; x < grid.columns; ++x) {
                if (tried(x, y) || grid.at(x, y).clarity <= clearest) continue;
                clearest = grid.at(x, y).clarity;
                seed = {x, y};
            }
        }
        if (clearest <= static_cast<float>(kMinClarity)) break;
        Growth growth(grid, waves, center, radius);
        const std::size_t count = growth.growFrom(seed.first, seed.second);
        if (count >= kMinNodes && (!best || count > best->nodes.size())) {
            best = CoarseLattice{*growth.map(), growth.nodes(), static_cast<double>(grid.block),
                                 static_cast<double>(count) / lit_nodes};
        }
        if (best && best->lit_share > kEnoughShare) break;
        for (std::size_t n = 0; n < grid.nodes.size(); ++n) {
            if (grid.nodes[n].reached) tried.pixels()[n] = 1;
            grid.nodes[n].reached = false;
        }
        const int reach = static_cast<int>(kSeedPitches * kNodesPerPitch);
        for (int y = std::max(0, seed.second - reach); y <= std::min(grid.rows - 1, seed.second + reach); ++y)
            for (int x = std::max(0, seed.first - reach); x <= std::min(grid.columns - 1, seed.first + reach); ++x)
                tried(x, y) = 1;
    }
    return best;
}

namespace {

constexpr int kBins = 16;
using Cell = std::array<double, static_cast<std::size_t>(kBins* kBins)>;

// Box of relative width `width` blurred by a Gaussian of `sigma`, both in pitches, periodic, centred on 0.
std::array<double, kBins> blurredGroove(double width, double sigma, double shift) {
    std::array<double, kBins> profile{};
    for (int n = 0; n < kBins; ++n) {
        const double place = (n + 0.5) / kBins + shift;
        for (int copy = -2; copy <= 2; ++copy) {
            const double d = place - std::round(place) + copy;
            profile[static_cast<std::size_t>(n)] += 0.5 * (std::erf((d + 0.5 * width) / (std::sqrt(2.0) * sigma)) -
                                                           std::erf((d - 0.5 * width) / (std::sqrt(2.0) * sigma)));
        }
    }
    return profile;
}

double correlation(const Cell& a, const Cell& b, double* slope = nullptr) {
    double ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;
    for (std::size_t n = 0; n < a.size(); ++n) {
        ma += a[n] / static_cast<double>(a.size());
        mb += b[n] / static_cast<double>(b.size());
    }
    for (std::size_t n = 0; n < a.size(); ++n) {
        aa += (a[n] - ma) * (a[n] - ma);
        bb += (b[n] - mb) * (b[n] - mb);
        ab += (a[n] - ma) * (b[n] - mb);
    }
    if (slope) *slope = bb > 0 ? ab / bb : 0;
    return aa > 0 && bb > 0 ? ab / std::sqrt(aa * bb) : 0;
}

}  // namespace

FoldedCell foldCell(const Image& high, const CoarseLattice& lattice, const GroovedPlate& plate) {
    std::array<Cell, 2> sums{}, counts{};
    const int block = static_cast<int>(lattice.node_spacing_px);
    for (const PhaseNode& node : lattice.nodes) {
        const LatticePlace place = lattice.map.place(node.pixel);
        const int left = static_cast<int>(std::lround(node.pixel.x() - 0.5 * (block - 1)));
        const int top = static_cast<int>(std::lround(node.pixel.y() - 0.5 * (block - 1)));
        // Halves are made of blocks wider than the grain of tissue.
        const auto half = static_cast<std::size_t>((left / (4 * block) + top / (4 * block)) & 1);
        for (int b = 0; b < block; ++b) {
            for (int a = 0; a < block; ++a) {
                const Vector2 offset = Vector2(left + a, top + b) - node.pixel;
                const Vector2 at = place.lattice + place.jacobian * offset;
                const auto bx = static_cast<std::size_t>((at.x() - std::floor(at.x())) * kBins) % kBins;
                const auto by = static_cast<std::size_t>((at.y() - std::floor(at.y())) * kBins) % kBins;
                sums[half][by * kBins + bx] += static_cast<double>(high(left + a, top + b));
                counts[half][by * kBins + bx] += 1;
            }
        }
    }
    FoldedCell folded;
    Cell mean{};
    for (std::size_t n = 0; n < mean.size(); ++n) {
        if (counts[0][n] == 0 || counts[1][n] == 0) return folded;
        mean[n] = (sums[0][n] + sums[1][n]) / (counts[0][n] + counts[1][n]);
        for (std::size_t half = 0; half < 2; ++half)
            sums[half][n] /= counts[half][n];
    }
    folded.repeatability = correlation(sums[0], sums[1]);
    // Spearman and Brown: what noise alone takes off a correlation with the truth.
    const double r = std::clamp(folded.repeatability, 0.0, 1.0);
    const double reach = r > 0 ? std::sqrt(2 * r / (1 + r)) : 1;

    const double width = plate.groove_width_mm / plate.pitch_mm;
    constexpr int kShifts = FoldedCell::kShifts;
    for (const double sigma : {0.02, 0.04, 0.06, 0.09, 0.12, 0.16}) {
        std::array<std::array<double, kBins>, kShifts> profiles;
        for (int shift = 0; shift < kShifts; ++shift)
            profiles[static_cast<std::size_t>(shift)] =
                blurredGroove(width, sigma, static_cast<double>(shift) / kShifts);
        for (std::size_t shift = 0; shift < folded.readings.size(); ++shift) {
            const auto& px = profiles[shift % kShifts];
            const auto& py = profiles[shift / kShifts];
            Cell cell;
            for (std::size_t b = 0; b < kBins; ++b)
                for (std::size_t a = 0; a < kBins; ++a)
                    cell[b * kBins + a] = px[a] + py[b] - px[a] * py[b];
            double slope = 0;
            const double likeness = correlation(mean, cell, &slope) / reach;
            FoldedCell::Reading& reading = folded.readings[shift];
            reading.inverted = std::max(reading.inverted, -likeness);
            if (likeness > reading.likeness) {
                reading.likeness = likeness;
                reading.contrast = slope;
            }
        }
    }
    return folded;
}

std::array<int, 2> FoldedCell::bestShift(int harmonic) const {
    std::array<int, 2> best{0, 0};
    const int step = kShifts / harmonic;
    for (int y = 0; y < kShifts; y += step)
        for (int x = 0; x < kShifts; x += step)
            if (at(x, y).likeness > at(best[0], best[1]).likeness) best = {x, y};
    return best;
}

double FoldedCell::bestOther(const std::array<int, 2>& shift) const {
    double best = bestInverted();
    const auto apart = [](int a, int b) { return std::min((a - b + kShifts) % kShifts, (b - a + kShifts) % kShifts); };
    for (int y = 0; y < kShifts; ++y)
        for (int x = 0; x < kShifts; ++x)
            if (std::max(apart(x, shift[0]), apart(y, shift[1])) >= 2) best = std::max(best, at(x, y).likeness);
    return best;
}

double FoldedCell::bestInverted() const {
    double best = 0;
    for (const Reading& reading : readings)
        best = std::max(best, reading.inverted);
    return best;
}

}  // namespace fluorocut::grooves
