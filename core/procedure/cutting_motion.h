// From a tool path to a motion of the robot: the path is carried into the robot's frame, and the cutter brought from
// where it stands to the path's start and back again.
//
//   lift      straight up (+z of `cavity`) from where it stands, kTravel_mm above the way in, its spindle unmoved
//   travel    there to above the path's start, the spindle turning to the path's
//   descend   straight down into the way in
//   path      move by move
//   and back  in the same order from the end: the cutter ends where it began, out of the images' way
//
// Two checkers, written independently of each other, carry a motion's poses back into the cavity's frame and ask of it
// the same rules; each uses another of cutting's two envelope checks for what lies below the way in:
//
//   * where the cutter is below kFree_mm above the open end of the envelope it may only rise straight up from its first
//     pose, sink straight down onto its last one, or pass straight up and down over the envelope's opening;
//   * it is below the open end in one stretch only (but for its first and last pose), of which every move is inside
//     the envelope with the spindle kept, by the envelope check.
//
// That nothing is in the way above kFree_mm, nor over the place where the cutter stands, is what they take for granted.
//
// Frames: `robot`, `cavity`, `cutter`. The turn of the cutter about its spindle is free and kept as small as can be.
#pragma once

#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/cutting/tool_path.h"
#include "core/geometry/rigid3.h"
#include "core/geometry/triangle_mesh.h"
#include "core/robot/checked_motion.h"

namespace fluorocut {

inline constexpr double kTravel_mm = 60;  // above the open end
inline constexpr double kFree_mm = 20;

struct CuttingPlace {
    Rigid3 robot_from_cavity;
    Rigid3 robot_from_cutter;  // where the cutter stands
    double open_mm = 0;        // z of the envelope's open end (ToolPathOptions::openPlane)
};

// invalidInput when the path is empty or does not begin and end just below the open end.
Result<std::vector<MotionStep>> cuttingMotion(const ToolPath& path, const CuttingPlace& place);

// What both checkers hold a motion against; each has its own copy.
struct MotionEnvelope {
    Cutter mounted;
    TriangleMesh envelope;  // opened upward (core/cutting/envelope_check.h)
    double open_mm = 0;
    Rigid3 robot_from_cavity;
};

class MeshMotionChecker final : public MotionChecker {
  public:
    explicit MeshMotionChecker(MotionEnvelope envelope) : envelope_(std::move(envelope)) {}
    std::string name() const override { return "envelope, by mesh"; }

  private:
    Result<void> judge(const MotionProposal& proposal) const override;
    MotionEnvelope envelope_;
};

class VoxelMotionChecker final : public MotionChecker {
  public:
    explicit VoxelMotionChecker(MotionEnvelope envelope) : envelope_(std::move(envelope)) {}
    std::string name() const override { return "envelope, by voxels"; }

  private:
    Result<void> judge(const MotionProposal& proposal) const override;
    MotionEnvelope envelope_;
};

}  // namespace fluorocut
