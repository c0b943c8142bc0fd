// How a motion is run through in time: trapezoids of speed along its way.
//
// MotionTrack: the way. Length of a step: the larger of what the cutter's tip moves and what a point `lever_mm` away
// from it moves by the turn, so that turns on the spot take time too. Feeds are along this length.
//
// SpeedProfile: the fastest run from rest, with at most `acceleration` either way, below every step's feed, and at rest
// at the end. At the joint of two steps at an angle phi the speed is at most cos(phi) of the slower feed, zero from 90
// degrees on and beside turns on the spot. Exact pieces of constant acceleration. One straight step of length L at feed
// v from rest to rest takes
//
//     L / v + v / a    where L >= v^2 / a,    else 2 sqrt(L / a)
//
// mm, s, rad.
#pragma once

#include <cstddef>
#include <vector>

#include "core/robot/checked_motion.h"

namespace fluorocut {

class MotionTrack {
  public:
    MotionTrack(const std::vector<MotionStep>& steps, double lever_mm);

    double length() const { return end_mm_.back(); }
    std::size_t steps() const { return feed_mm_s_.size(); }
    double endOf(std::size_t step) const { return end_mm_[step + 1]; }
    double feedOf(std::size_t step) const { return feed_mm_s_[step]; }
    // On the joint between a step and the next.
    double jointSpeed(std::size_t step) const;
    // The step at this length: the first that ends beyond it, at the end the last.
    std::size_t stepAt(double along_mm) const;
    Rigid3 poseAt(double along_mm) const;

  private:
    std::vector<Rigid3> poses_;
    std::vector<double> end_mm_;  // of the length, at every pose
    std::vector<double> feed_mm_s_;
    std::vector<Vector3> direction_;  // zero: turns on the spot
};

class SpeedProfile {
  public:
    struct State {
        double along_mm = 0;
        double speed_mm_s = 0;
    };

    // From rest at `from_mm` to the track's end.
    SpeedProfile(const MotionTrack& track, double from_mm, double acceleration_mm_s2);

    double duration() const { return end_s_; }
    State at(double time_s) const;

  private:
    struct Piece {
        double start_s, along_mm, speed_mm_s, acceleration_mm_s2;
    };
    void addPiece(double until_speed_mm_s, double acceleration_mm_s2);

    std::vector<Piece> pieces_;
    double end_s_ = 0;
    State last_;
};

}  // namespace fluorocut
