#include "core/fiducial/detection/bead_matching.h"

#include <algorithm>

namespace fluorocut::detection {

std::vector<BeadMatch> matchBeads(const BeadLayout& layout, const std::vector<Vector2>& shadows,
                                  const PixelIntrinsics& intrinsics, const Rigid3& imager_from_layout,
                                  double tolerance_px) {
    struct Pair {
        double distance;
        std::size_t bead, shadow;
        Vector2 residual;
    };
    std::vector<Pair> pairs;
    for (std::size_t i = 0; i < layout.beads.size(); ++i) {
        const Bead& bead = layout.beads[i];
        const Vector2 place = predictedPixel(intrinsics, imager_from_layout * bead.center_mm, 0.5 * bead.diameter_mm);
        for (std::size_t j = 0; j < shadows.size(); ++j) {
            const Vector2 residual = shadows[j] - place;
            if (residual.squaredNorm() <= tolerance_px * tolerance_px)
                pairs.push_back({residual.norm(), i, j, residual});
        }
    }
    std::stable_sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) { return a.distance < b.distance; });
    std::vector<bool> bead_used(layout.beads.size(), false), shadow_used(shadows.size(), false);
    std::vector<BeadMatch> matches;
    for (const Pair& pair : pairs) {
        if (bead_used[pair.bead] || shadow_used[pair.shadow]) continue;
        bead_used[pair.bead] = shadow_used[pair.shadow] = true;
        matches.push_back({pair.bead, pair.shadow, shadows[pair.shadow], pair.residual});
    }
    std::sort(matches.begin(), matches.end(), [](const BeadMatch& a, const BeadMatch& b) { return a.bead < b.bead; });
    return matches;
}

}  // namespace fluorocut::detection
