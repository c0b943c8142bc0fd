// Where in an image, and at which size, something round and dark may lie. Bright means more photons; pixels.
//
// Maxima over place of s^2 * (smaller eigenvalue of the Hessian of G_s * L), L = log intensity, for a ladder of scales
// s, then the strongest at each place. A disk of contrast c (in L) and radius s sqrt(2) answers with c / e; an edge or
// a line with nothing.
#pragma once

#include <vector>

#include "core/geometry/rigid3.h"
#include "core/image/image.h"

namespace fluorocut::detection {

struct BeadCandidate {
    Vector2 center_px = Vector2::Zero();
    double radius_px = 0;  // of the ladder's step, 15 % off at most
    double response = 0;   // about contrast / e
};

struct CandidateSearch {
    double least_radius_px;
    double most_radius_px;
    double least_response;
    std::size_t most = 0;  // the strongest ones
};

// `log_intensity` is negated by the caller for bright beads. Strongest first.
std::vector<BeadCandidate> findBeadCandidates(const Image& log_intensity, const CandidateSearch& search);

// log(max(intensity, floor)): the floor is a small part of the brightest, so that dead pixels and black borders have a
// logarithm too.
Image logIntensity(const Image& image);

}  // namespace fluorocut::detection
