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

// What one cell looks like on average, against what the plate should look like: bright grooves that cross at (0, 0) or,
// with shift 1, 2, 3, at (1/2, 0), (0, 1/2), (1/2, 1/2). Correlations, 1 = the same; noise is allowed for.
struct FoldedCell {
    std::array<double, 4> likeness = {};           // by shift
    std::array<double, 4> contrast = {};           // by shift; log intensity, groove against land
    std::array<double, 4> inverted_likeness = {};  // the same with dark grooves
    double repeatability = 0;                      // correlation of two halves of the data: 0 = noise

    std::size_t bestShift() const;
    // The best likeness with anything but bright grooves at this shift.
    double bestOther(std::size_t shift) const;
    double bestInverted() const;
};

FoldedCell foldCell(const Image& high, const CoarseLattice& lattice, const GroovedPlate& plate);

}  // namespace fluorocut::grooves
