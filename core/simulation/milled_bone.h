// A bone under the cutter: it is told where the cutter truly goes, answers at once, roughly, how much that takes away,
// and, when it is asked, exactly what is left.
//
// At once: the CT's voxels are divided into parts of at most 0.5 mm, each hard or not by the voxel's HU, each gone as
// soon as the ball has been over it. What a step takes is handed out over some twenty steps, since matter that comes
// in lumps is felt as force.
//
// Exactly: the way, thinned so that no place on it is off by more than 5 um (20 um at 60 mm up the shank), and what
// ball and shank sweep on all of it (core/cutting/removal.h), as parts of voxels. The shank is as thick as the ball:
// it cuts only where the ball was not above before, which is looked for (to 1 mm) and rare; where it does not, the few
// mm next to the ball are all that is swept.
//
//     HU_left = (1 - c) HU + c fill        c: fraction of the voxel that is gone
//
// Where the cutter passes through air alone nothing is kept. Frame `femur`, mm, HU.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/cutting/tool_path.h"
#include "core/image/volume.h"

namespace fluorocut {

struct MilledBoneOptions {
    double fill_hu = -1000;         // what a cavity is full of: air; 0 to 50 for fluid and blood
    double hard_above_hu = 100;     // what the cutter feels
    double matter_above_hu = -500;  // what is worth keeping the way through

    Result<void> validate() const;
};

class MilledBone {
  public:
    // Options that are not valid, or no volume, throw std::logic_error.
    MilledBone(std::shared_ptr<const Volume> whole, const Cutter& cutter, const MilledBoneOptions& options = {});

    // Straight from one pose to the next; mm^3 of hard matter, as felt.
    double cut(const Rigid3& femur_from_cutter_before, const Rigid3& femur_from_cutter);

    // Whether ball or shank may touch anything but air.
    bool nearMatter(const Rigid3& femur_from_cutter) const;

    // Of every voxel of the CT, by everything so far.
    Volume removedFraction() const;
    std::shared_ptr<const Volume> remaining() const;

    std::size_t segments() const { return way_.size() + shank_way_.size(); }

  private:
    struct Place {
        Vector3 ball, shank;
    };
    void take(const Place& place);
    // From the first place of the run to its last.
    void appendRun(std::vector<ToolMove>& way) const;
    void endRun();
    double removeBall(const Vector3& center);
    // Marks what the shank alone takes; false: nothing.
    bool removeShank(const Place& place);
    bool isThere(const Vector3& point) const;
    bool hard(int i, int j, int k) const;

    std::shared_ptr<const Volume> whole_;
    Cutter cutter_;
    MilledBoneOptions options_;

    std::vector<ToolMove> way_, shank_way_;  // the second: where the shank cuts too
    std::vector<Place> run_;                 // since the last kept place, which is its first
    // Coarse blocks of the CT that hold matter, grown by the cutter's radius.
    std::array<int, 3> block_voxels_{}, blocks_{};
    std::vector<bool> matter_;

    std::array<int, 3> parts_{};  // of a voxel
    std::vector<bool> gone_;
    Vector3 felt_at_ = Vector3::Constant(1e9);
    double pending_mm3_ = 0;
};

}  // namespace fluorocut
