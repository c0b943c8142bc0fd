#include "core/robot/motion_profile.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace fluorocut {

MotionTrack::MotionTrack(const std::vector<MotionStep>& steps, double lever_mm) {
    if (steps.size() < 2 || !(lever_mm > 0)) throw std::logic_error("a motion has two steps and a lever");
    poses_.push_back(steps.front().robot_from_cutter);
    end_mm_.push_back(0);
    for (std::size_t i = 1; i < steps.size(); ++i) {
        const Rigid3& to = steps[i].robot_from_cutter;
        const Vector3 way = to.translation() - poses_.back().translation();
        const double turn_mm = lever_mm * poses_.back().rotation().angularDistance(to.rotation());
        const double length = std::max(way.norm(), turn_mm);
        if (!(length > 1e-9)) continue;  // the same pose again
        poses_.push_back(to);
        end_mm_.push_back(end_mm_.back() + length);
        feed_mm_s_.push_back(steps[i].feed_mm_s);
        direction_.push_back(way.norm() >= turn_mm ? Vector3(way.normalized()) : Vector3(Vector3::Zero()));
    }
}

double MotionTrack::jointSpeed(std::size_t step) const {
    if (step + 1 >= steps()) return 0;
    // A straight line in pieces has cosines a rounding above or below one.
    const double cosine = direction_[step].dot(direction_[step + 1]);
    return std::clamp(cosine > 1 - 1e-12 ? 1.0 : cosine, 0.0, 1.0) * std::min(feedOf(step), feedOf(step + 1));
}

std::size_t MotionTrack::stepAt(double along_mm) const {
    const auto end = std::upper_bound(end_mm_.begin() + 1, end_mm_.end(), along_mm);
    const auto step = static_cast<std::size_t>(end - end_mm_.begin()) - 1;
    return std::min(step, steps() == 0 ? 0 : steps() - 1);
}

Rigid3 MotionTrack::poseAt(double along_mm) const {
    if (!(along_mm > 0)) return poses_.front();
    if (along_mm >= length()) return poses_.back();
    const std::size_t step = stepAt(along_mm);
    const double part = (along_mm - end_mm_[step]) / (end_mm_[step + 1] - end_mm_[step]);
    const Rigid3& from = poses_[step];
    const Rigid3& to = poses_[step + 1];
    return {from.rotation().slerp(part, to.rotation()),
            from.translation() + part * (to.translation() - from.translation())};
}

SpeedProfile::SpeedProfile(const MotionTrack& track, double from_mm, double acceleration_mm_s2) {
    const double a = acceleration_mm_s2;
    if (!(a > 0 && from_mm >= 0)) throw std::logic_error("a motion begins on its way and is accelerated");
    last_.along_mm = std::min(from_mm, track.length());
    if (last_.along_mm >= track.length()) return;
    const std::size_t first = track.stepAt(last_.along_mm), count = track.steps() - first;
    // Speeds at the joints: what is allowed there, what can still be braked from, what can be reached.
    std::vector<double> joint(count + 1, 0.0), length(count);
    for (std::size_t i = 0; i < count; ++i)
        length[i] = track.endOf(first + i) - (i == 0 ? last_.along_mm : track.endOf(first + i - 1));
    for (std::size_t i = count; i-- > 0;) {
        const double allowed = i == 0 ? 0 : track.jointSpeed(first + i - 1);
        joint[i] = std::min(allowed, std::sqrt(joint[i + 1] * joint[i + 1] + 2 * a * length[i]));
    }
    for (std::size_t i = 0; i < count; ++i) {
        joint[i + 1] = std::min(joint[i + 1], std::sqrt(joint[i] * joint[i] + 2 * a * length[i]));
        const double in = joint[i], out = joint[i + 1];
        // Up to `peak`, along, down to `out`.
        const double peak = std::min(track.feedOf(first + i), std::sqrt((in * in + out * out) / 2 + a * length[i]));
        addPiece(peak, a);
        const double cruise = track.endOf(first + i) - last_.along_mm - (peak * peak - out * out) / (2 * a);
        if (cruise > 0 && peak > 0) {
            pieces_.push_back({end_s_, last_.along_mm, peak, 0});
            end_s_ += cruise / peak;
            last_.along_mm += cruise;
        }
        addPiece(out, -a);
        last_ = {track.endOf(first + i), out};
    }
}

void SpeedProfile::addPiece(double until_speed_mm_s, double acceleration_mm_s2) {
    const double time = (until_speed_mm_s - last_.speed_mm_s) / acceleration_mm_s2;
    if (!(time > 0)) return;
    pieces_.push_back({end_s_, last_.along_mm, last_.speed_mm_s, acceleration_mm_s2});
    last_.along_mm += 0.5 * (last_.speed_mm_s + until_speed_mm_s) * time;
    last_.speed_mm_s = until_speed_mm_s;
    end_s_ += time;
}

SpeedProfile::State SpeedProfile::at(double time_s) const {
    if (pieces_.empty() || time_s >= end_s_) return last_;
    const auto next = std::upper_bound(pieces_.begin() + 1, pieces_.end(), time_s,
                                       [](double time, const Piece& piece) { return time < piece.start_s; });
    const Piece& piece = *(next - 1);
    const double time = std::max(time_s - piece.start_s, 0.0);
    return {piece.along_mm + time * (piece.speed_mm_s + 0.5 * time * piece.acceleration_mm_s2),
            piece.speed_mm_s + time * piece.acceleration_mm_s2};
}

}  // namespace fluorocut
