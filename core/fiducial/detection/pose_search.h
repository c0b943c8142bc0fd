// The search of bead_pose.h: poses for unlabelled shadows by triples and votes. Ideal pixels, imager frame.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "core/base/progress.h"
#include "core/base/random.h"
#include "core/fiducial/bead_bundle.h"

namespace fluorocut::detection {

struct Shadow {
    Vector2 ideal_px;
    double radius_px;
    Vector3 direction;  // unit, from the source
};

struct PoseHypothesis {
    Rigid3 imager_from_layout;
    int votes = 0;
};

struct SearchLimits {
    double focal_length_mm;
    double vote_distance_px;
    int columns, rows;
    bool use_sizes;
    int least_votes;
};

// From places in the image to the shadow that is nearest, if one is within the distance.
class VotingGrid {
  public:
    VotingGrid(const std::vector<Shadow>& shadows, int columns, int rows, double distance_px);
    // -1: none.
    int at(const Vector2& ideal_px) const;

  private:
    static constexpr double kCellPx = 2;
    double margin_;
    int columns_, rows_;
    std::vector<std::int16_t> cells_;
};

class PoseSearch {
  public:
    PoseSearch(const BeadLayout& layout, const std::vector<Shadow>& shadows, const PixelIntrinsics& intrinsics,
               const SearchLimits& limits);

    // All poses that take some three beads to these three shadows and that many others agree with; most votes first,
    // `most` at the utmost. Adds to `tried`.
    std::vector<PoseHypothesis> posesFor(const std::array<std::size_t, 3>& triple, std::size_t most,
                                         std::atomic<long long>& tried, const Progress& progress) const;

  private:
    int votes(const Matrix3& rotation, const Vector3& translation) const;

    const BeadLayout& layout_;
    const std::vector<Shadow>& shadows_;
    PixelIntrinsics intrinsics_;
    SearchLimits limits_;
    VotingGrid grid_;
    std::vector<std::size_t> order_;  // of beads: each as far as can be from those before it
};

// Triples of shadows, none twice: those that span much of the image, in random order, then the narrower ones.
std::vector<std::array<std::size_t, 3>> wideTriples(const std::vector<Shadow>& shadows, std::size_t count,
                                                    Random& random);

}  // namespace fluorocut::detection
