// Groove segments: the piece of a groove between two crossings, and where its middle line is in the image.
//
// A segment's pixels (raw, not resampled) have lattice coordinates from a LatticeMap. With d the distance across the
// groove and s along it, in px, their log intensity is fitted by
//     b0 + b1 d + b2 s + b3 d^2 + A f(d - shift),     f(d) = log(1 + c T(d)) / log(1 + c)
// where T is a box of the groove's width blurred by a Gaussian: blur acts on intensity, c is the groove's contrast in
// intensity. A shadow whose edges slope is symmetric too, so that a wrong softness costs precision and gives no bias.
// The standard deviation is the fit's own: residual scatter times the inverse normal matrix.
#pragma once

#include <array>
#include <vector>

#include "core/distortion/groove_image.h"
#include "core/distortion/lattice_map.h"

namespace fluorocut::grooves {

enum class SegmentState : std::uint8_t { outside, hidden, doubtful, found };

struct Segment {
    int direction = 0;                 // 0: along y, fixes x; 1: along x, fixes y
    int index = 0;                     // of the groove
    int between = 0;                   // crossing grooves `between` and `between` + 1
    Vector2 start = Vector2::Zero();   // where the map has its middle, px
    Vector2 across = Vector2::Zero();  // unit vector toward larger indices
    double pitch_px = 0;               // across, here
    double shift_px = 0;               // measured minus `start`, along `across`
    double fit_sigma_px = 0;           // standard deviation of that, by the fit
    double sigma_px = 0;               // the same with what neighbours show
    double contrast = 0;               // log intensity
    double contrast_sigma = 0;
    double noise = 0;      // residual scatter of a pixel
    double roughness = 1;  // residual scatter over that of differences between neighbouring pixels: 1 for white noise
    bool seen = false;     // a groove was measured here, be it believed or not
    SegmentState state = SegmentState::outside;

    Vector2 point() const { return start + shift_px * across; }
    // Middle of the segment in the lattice.
    Vector2 lattice() const { return direction == 0 ? Vector2(index, between + 0.5) : Vector2(between + 0.5, index); }
};

struct GrooveShape {
    double width = 0.25;                     // in pitches
    std::array<double, 2> blur_px = {1, 1};  // Gaussian sigma across the grooves along y, along x
    double contrast = 0.07;                  // log intensity
};

// Segments whose middle lies within half a pitch of one of `seeds` (pixels), with `start`, `across` and `pitch_px`.
std::vector<Segment> segmentsNear(const LatticeMap& map, const std::vector<Vector2>& seeds, int width, int height);

// Measures the segments from `first` on; states are outside (window reaches out of the lit field), hidden (no groove is
// seen) or found.
void measureSegments(const PreparedImage& image, const LatticeMap& map, const GrooveShape& shape,
                     std::vector<Segment>& segments, std::size_t first = 0);

// The blur that explains the average profile of the found segments best, for each direction.
std::array<double, 2> findBlur(const PreparedImage& image, const LatticeMap& map, const GrooveShape& shape,
                               const std::vector<Segment>& segments);

}  // namespace fluorocut::grooves
