#include "core/distortion/lattice_phase.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <queue>

#include "core/base/parallel.h"
#include "core/image/blur.h"

namespace fluorocut::grooves {
namespace {

constexpr double kNodesPerPitch = 5;
constexpr double kWindowPitches = 1.0;  // sigma of the Gaussian in which a phase is measured
constexpr double kMinClarity = 3.0;
constexpr double kMaxPhaseStep = 0.12;     // cycles, between neighbouring nodes, against the carrier waves
constexpr double kMaxNodeResidual = 0.15;  // pitches, against the map
constexpr std::size_t kMaxFitNodes = 2000;
constexpr std::size_t kMinNodes = 150;  // 6 square pitches

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
    std::vector<float> others;
    for (int y = 0; y < grid.rows; ++y) {
        for (int x = 0; x < grid.columns; ++x) {
            int lit_pixels = 0;
            for (int b = 0; b < grid.block; ++b)
                for (int a = 0; a < grid.block; ++a)
                    lit_pixels += lit(x * grid.block + a, y * grid.block + b) > 0.5f;
            Node& node = grid.at(x, y);
            node.lit = 2 * lit_pixels > grid.block * grid.block;
            const float other =
                std::sqrt(0.5f * (between[0](x, y) * between[0](x, y) + between[1](x, y) * between[1](x, y) +
                                  aside[0](x, y) * aside[0](x, y) + aside[1](x, y) * aside[1](x, y)));
            if (node.lit) others.push_back(other);
            node.clarity =
                std::min(std::hypot(first[0](x, y), first[1](x, y)), std::hypot(second[0](x, y), second[1](x, y)));
            const float turn = 1 / (2 * std::numbers::pi_v<float>);
            node.phase = {turn * std::atan2(first[1](x, y), first[0](x, y)),
                          turn * std::atan2(second[1](x, y), second[0](x, y))};
        }
    }
    if (others.empty()) return grid;
    const auto middle = others.begin() + static_cast<std::ptrdiff_t>(others.size() / 2);
    std::nth_element(others.begin(), middle, others.end());
    const float noise = std::max(*middle, 1e-12f);
    for (Node& node : grid.nodes)
        node.clarity = node.lit ? node.clarity / noise : 0;
    return grid;
}

// Unwraps from the clearest node outward, clearest first; phases then need no wrapping anywhere in the part reached.
std::vector<std::pair<int, int>> grow(NodeGrid& grid) {
    std::pair<int, int> seed{0, 0};
    double best = 0;
    for (int y = 1; y + 1 < grid.rows; ++y) {
        for (int x = 1; x + 1 < grid.columns; ++x) {
            if (static_cast<double>(grid.at(x, y).clarity) <= best) continue;
            best = static_cast<double>(grid.at(x, y).clarity);
            seed = {x, y};
        }
    }
    std::vector<std::pair<int, int>> reached;
    if (best < kMinClarity) return reached;
    using Entry = std::tuple<float, int, int>;  // ties are settled by place: the same on every machine
    std::priority_queue<Entry> open;
    grid.at(seed.first, seed.second).reached = true;
    open.emplace(grid.at(seed.first, seed.second).clarity, seed.first, seed.second);
    while (!open.empty()) {
        const auto [clarity, x, y] = open.top();
        open.pop();
        reached.emplace_back(x, y);
        const Node& from = grid.at(x, y);
        for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
            const int nx = x + dx, ny = y + dy;
            if (nx < 0 || ny < 0 || nx >= grid.columns || ny >= grid.rows) continue;
            Node& to = grid.at(nx, ny);
            if (to.reached || static_cast<double>(to.clarity) < kMinClarity) continue;
            bool smooth = true;
            std::array<float, 2> phase{};
            for (std::size_t c = 0; c < 2; ++c) {
                const float step = to.phase[c] - from.phase[c];
                const float wrapped = step - std::round(step);
                smooth = smooth && std::abs(wrapped) < static_cast<float>(kMaxPhaseStep);
                phase[c] = from.phase[c] + wrapped;
            }
            if (!smooth) continue;
            to.phase = phase;
            to.reached = true;
            open.emplace(to.clarity, nx, ny);
        }
    }
    return reached;
}

}  // namespace

std::optional<CoarseLattice> traceLattice(const Image& high, const Image& lit, const WavePair& waves) {
    NodeGrid grid = analyse(high, lit, waves);
    const std::vector<std::pair<int, int>> reached = grow(grid);
    if (reached.size() < kMinNodes) return std::nullopt;

    std::vector<PhaseNode> nodes;
    for (const auto& [x, y] : reached) {
        const Vector2 pixel = grid.pixel(x, y);
        const Node& node = grid.at(x, y);
        // A demodulated phase of 0 at the origin of the carrier wave: a bright line where wave . pixel + phase is
        // whole.
        nodes.push_back({pixel,
                         {waves.first.dot(pixel) + static_cast<double>(node.phase[0]),
                          waves.second.dot(pixel) + static_cast<double>(node.phase[1])},
                         static_cast<double>(node.clarity)});
    }
    const Vector2 center(0.5 * (high.width() - 1), 0.5 * (high.height() - 1));
    const double radius = 0.5 * std::max(high.width(), high.height());
    std::optional<LatticeMap> map;
    const std::size_t step = (nodes.size() + kMaxFitNodes - 1) / kMaxFitNodes;
    for (int order = 1; order <= LatticeMap::kMaxOrder; ++order) {
        LatticeMap next(order, center, radius);
        bool good = true;
        for (int c = 0; c < 2 && good; ++c) {
            std::vector<LatticeSample> samples;
            for (std::size_t n = 0; n < nodes.size(); n += step)
                samples.push_back({nodes[n].pixel, nodes[n].lattice[c], std::min(nodes[n].clarity, 30.0)});
            // A wide cut at first: a plane through a bent lattice is off by a good part of a pitch.
            good = static_cast<int>(samples.size()) > 4 * LatticeMap::coefficientCount(order) &&
                   next.fit(c, samples, order < 3 ? 1.0 : kMaxNodeResidual);
        }
        if (!good) break;
        map = next;
    }
    if (!map) return std::nullopt;
    CoarseLattice lattice{*map, {}, static_cast<double>(grid.block), 0};
    for (const PhaseNode& node : nodes)
        if ((map->at(node.pixel) - node.lattice).cwiseAbs().maxCoeff() < kMaxNodeResidual)
            lattice.nodes.push_back(node);
    const auto lit_nodes =
        std::count_if(grid.nodes.begin(), grid.nodes.end(), [](const Node& node) { return node.lit; });
    lattice.lit_share =
        static_cast<double>(lattice.nodes.size()) / static_cast<double>(std::max<std::ptrdiff_t>(1, lit_nodes));
    if (lattice.nodes.size() < kMinNodes) return std::nullopt;
    return lattice;
}

namespace {

constexpr int kBins = 16;
using Cell = std::array<double, static_cast<std::size_t>(kBins* kBins)>;

// Box of relative width `width` blurred by a Gaussian of `sigma`, both in pitches, periodic, centred on 0.
std::array<double, kBins> blurredGroove(double width, double sigma, std::size_t shift) {
    std::array<double, kBins> profile{};
    for (int n = 0; n < kBins; ++n) {
        const double place = (n + 0.5) / kBins + 0.5 * static_cast<double>(shift);
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
    for (const double sigma : {0.02, 0.04, 0.06, 0.09, 0.12, 0.16}) {
        for (std::size_t shift = 0; shift < 4; ++shift) {
            const auto px = blurredGroove(width, sigma, shift & 1), py = blurredGroove(width, sigma, shift >> 1);
            Cell cell;
            for (std::size_t b = 0; b < kBins; ++b)
                for (std::size_t a = 0; a < kBins; ++a)
                    cell[b * kBins + a] = px[a] + py[b] - px[a] * py[b];
            double slope = 0;
            const double likeness = correlation(mean, cell, &slope) / reach;
            folded.inverted_likeness[shift] = std::max(folded.inverted_likeness[shift], -likeness);
            if (likeness > folded.likeness[shift]) {
                folded.likeness[shift] = likeness;
                folded.contrast[shift] = slope;
            }
        }
    }
    return folded;
}

std::size_t FoldedCell::bestShift() const {
    return static_cast<std::size_t>(std::max_element(likeness.begin(), likeness.end()) - likeness.begin());
}

double FoldedCell::bestOther(std::size_t shift) const {
    double best = bestInverted();
    for (std::size_t n = 0; n < likeness.size(); ++n)
        if (n != shift) best = std::max(best, likeness[n]);
    return best;
}

double FoldedCell::bestInverted() const {
    return *std::max_element(inverted_likeness.begin(), inverted_likeness.end());
}

}  // namespace fluorocut::grooves
