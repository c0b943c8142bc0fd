// The poses from which three known points are seen in three known directions (Grunert 1841, in the form of Haralick et
// al. 1994, eq. 9): up to four.
#pragma once

#include <array>
#include <vector>

#include "core/geometry/rigid3.h"

namespace fluorocut::detection {

// `directions`: unit vectors from the camera. Distances along them are positive in every pose returned. Empty for
// points on a line.
std::vector<Rigid3> posesFromThreePoints(const std::array<Vector3, 3>& points,
                                         const std::array<Vector3, 3>& directions);

// The distances only, which is most of the work when most hypotheses are thrown away.
std::vector<std::array<double, 3>> distancesToThreePoints(const std::array<Vector3, 3>& points,
                                                          const std::array<Vector3, 3>& directions);

// The rigid motion that takes the corners of one triangle to those of a congruent one.
Rigid3 motionOfTriangle(const std::array<Vector3, 3>& from, const std::array<Vector3, 3>& to);

// Real roots of a4 x^4 + ... + a0, each polished by Newton's method.
std::vector<double> realRootsOfQuartic(const std::array<double, 5>& a);

}  // namespace fluorocut::detection
