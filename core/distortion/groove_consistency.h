// Which measured segments to believe: by what they are themselves, by their neighbours, and by what holds them
// together.
#pragma once

#include <string>
#include <vector>

#include "core/distortion/groove_segments.h"

namespace fluorocut::grooves {

// Median contrast of the found segments of one direction; 0 without any.
double medianContrast(const std::vector<Segment>& segments, int direction);

// States and sigma_px of the segments that were seen, anew:
// - hidden: contrast far below the others'; doubtful: far above, or residuals much rougher than elsewhere, or a fifth
// of
//   a pitch or more from where the map has it, or too uncertain to be of use.
// - Continuity: a groove's deviation from the map is a smooth function of place. Segments that do not lie where a plane
//   through the neighbours within two pitches puts them, within their standard deviations, are doubtful; so are those
//   with too few neighbours.
// - Rough residuals (tissue that is not white) are charged to sigma_px, as strongly as the scatter about the neighbours
//   shows they must be.
void judgeSegments(std::vector<Segment>& segments, const LatticeMap& map);

// Segments hang together within 1.6 pitches. A part cut off from the largest one (metal right across the field) becomes
// doubtful unless the map through the others that are kept reaches eight or more of its segments with certainty and
// puts them at the numbers they have. Returns how many were dropped.
int dropUncertainParts(std::vector<Segment>& segments, const LatticeMap& map, const Vector2& center, double radius);

// Robust map through the found segments, about what `map` has for its linear part; nothing when there are too few.
std::optional<LatticeMap> mapThrough(const std::vector<Segment>& segments, const LatticeMap& map, const Vector2& center,
                                     double radius);

}  // namespace fluorocut::grooves
