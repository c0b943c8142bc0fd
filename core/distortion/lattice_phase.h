// The coarse lattice: the phase of two waves over the image, unwrapped outward from the clearest place, and the proof
// that what repeats with it is a crossing of grooves.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "core/distortion/groove_spectrum.h"
#include "core/distortion/grooved_plate.h"
#include "core/distortion/lattice_map.h"
#include "core/image/image.h"

namespace fluorocut::grooves {

struct PhaseNode {
    Vector2 pixel = Vector2::Zero();    // of the image that was analysed
    Vector2 lattice = Vector2::Zero();  // pitches, groove middles at integers
    double clarity = 0;                 // amplitude over what is seen at wavelengths between the lattice's
};

struct CoarseLattice {
    LatticeMap map;
    std::vector<PhaseNode> nodes;  // those that hang together and agree with the map
    double node_spacing_px = 0;
    double lit_share = 0;  // nodes / nodes in the lit part of the image
};

// `high` as from highPassed, `lit` the share of lit pixels there. Nothing when no connected part is clear enough.
std::optional<CoarseLattice> traceLattice(const Image& high, const Image& lit, const WavePair& waves);

// What one cell looks like on average, against what the plate should look like: bright grooves that cross at (0, 0), or
// shifted by sixths of a pitch. Correlations, 1 = the same; noise is allowed for.
struct FoldedCell {
    static constexpr int kShifts = 6;
    struct Reading {
        double likeness = 0;  // with bright grooves
        double inverted = 0;  // with dark ones
        double contrast = 0;  // log intensity, groove against land
    };
    std::array<Reading, static_cast<std::size_t>(kShifts* kShifts)> readings;
    double repeatability = 0;  // correlation of two halves of the data: 0 = noise

    const Reading& at(int shift_x, int shift_y) const {
        return readings[static_cast<std::size_t>(shift_y * kShifts + shift_x)];
    }
    // The shift by multiples of 1 / harmonic of a pitch at which the cell is most like the plate's.
    std::array<int, 2> bestShift(int harmonic) const;
    // The best likeness with anything else: grooves elsewhere (a third of a pitch or more), dark ones.
    double bestOther(const std::array<int, 2>& shift) const;
    double bestInverted() const;
};

FoldedCell foldCell(const Image& high, const CoarseLattice& lattice, const GroovedPlate& plate);

}  // namespace fluorocut::grooves
