#include "core/procedure/cutting_motion.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace fluorocut {
namespace {

constexpr double kTravelFeed_mm_s = 30;
constexpr double kLongest_mm = 100;  // of a step; robots refuse jumps
constexpr double kWidest_rad = 0.3;
constexpr double kAboveEntry_mm =
    0.5;  // where the straight way down ends: between the clearance plane and the open end

// In the cavity's frame, carried over step by step.
class Motion {
  public:
    Motion(const Rigid3& robot_from_cavity, const Rigid3& cavity_from_cutter)
        : robot_from_cavity_(robot_from_cavity), now_(cavity_from_cutter) {
        steps_.push_back({robot_from_cavity_ * now_, kTravelFeed_mm_s});
    }

    const Rigid3& now() const { return now_; }

    void to(const Vector3& place, const Eigen::Quaterniond& rotation, double feed_mm_s) {
        const Rigid3 from = now_, end(rotation, place);
        const double way = (place - from.translation()).norm(), turn = from.rotation().angularDistance(end.rotation());
        if (!(way > 1e-9) && !(turn > 1e-9)) return;
        const int parts = std::max(1, static_cast<int>(std::ceil(std::max(way / kLongest_mm, turn / kWidest_rad))));
        for (int i = 1; i <= parts; ++i) {
            const double share = static_cast<double>(i) / parts;
            now_ = i == parts ? end
                              : Rigid3(from.rotation().slerp(share, end.rotation()),
                                       Vector3(from.translation() + share * (place - from.translation())));
            steps_.push_back({robot_from_cavity_ * now_, feed_mm_s});
        }
    }
    void to(const Vector3& place, double feed_mm_s = kTravelFeed_mm_s) { to(place, now_.rotation(), feed_mm_s); }
    void turn(const Eigen::Quaterniond& rotation) { to(now_.translation(), rotation, kTravelFeed_mm_s); }
    // The smallest turn that brings the spindle there.
    Eigen::Quaterniond towards(const Vector3& spindle) const {
        return Eigen::Quaterniond::FromTwoVectors(now_.rotate(Vector3::UnitZ()), spindle) * now_.rotation();
    }

    std::vector<MotionStep> steps_;

  private:
    Rigid3 robot_from_cavity_, now_;
};

Vector3 at(const Vector3& place, double z) {
    return {place.x(), place.y(), z};
}

}  // namespace

Result<std::vector<MotionStep>> cuttingMotion(const ToolPath& path, const CuttingPlace& place) {
    if (path.moves.empty()) return invalidInput("tool path", "no moves", "at least one", "plan the path again");
    const Vector3 first = path.moves.front().segment.from_mm, last = path.moves.back().segment.to_mm;
    for (const Vector3& end : {first, last}) {
        if (!(end.z() <= place.open_mm - kAboveEntry_mm && end.z() >= place.open_mm - 2)) {
            return invalidInput("tool path", fmt::format("an end at z = {:.2f} mm", end.z()),
                                fmt::format("just below the way in's end at {:.2f} mm", place.open_mm),
                                "plan the path again");
        }
    }
    const Rigid3 standing = place.robot_from_cavity.inverse() * place.robot_from_cutter;
    const Vector3& home = standing.translation();
    const double high = std::max(home.z(), place.open_mm + kTravel_mm);
    Motion motion(place.robot_from_cavity, standing);
    motion.to(at(home, high));
    motion.to(at(first, high), motion.towards(path.moves.front().segment.spindle), kTravelFeed_mm_s);
    motion.to(at(first, place.open_mm - kAboveEntry_mm));
    for (const ToolMove& move : path.moves) {
        motion.turn(motion.towards(move.segment.spindle));
        motion.to(move.segment.from_mm, move.feed_mm_s);
        motion.to(move.segment.to_mm, move.feed_mm_s);
    }
    motion.to(at(last, high));
    motion.to(at(home, high), standing.rotation(), kTravelFeed_mm_s);
    motion.to(home);
    return std::move(motion.steps_);
}

}  // namespace fluorocut
