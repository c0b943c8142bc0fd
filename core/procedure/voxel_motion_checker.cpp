// The checker that first splits a motion where it is high, and then looks at each part. No code in common with
// mesh_motion_checker.cpp.
#include <algorithm>

#include <fmt/format.h>

#include "core/cutting/envelope_check.h"
#include "core/procedure/cutting_motion.h"

namespace fluorocut {
namespace {

constexpr double kPlumb_mm = 1e-3;
constexpr double kStill = 1e-12;  // 1 - cos of half a turn: 3e-6 rad

// Homogeneous matrices all through.
struct Track {
    std::vector<Matrix4> cavity_from_cutter;
    std::vector<double> feeds;

    Vector3 place(std::size_t i) const { return cavity_from_cutter[i].topRightCorner<3, 1>(); }
    Vector3 spindle(std::size_t i) const { return cavity_from_cutter[i].block<3, 1>(0, 2); }
    bool keepsRotation(std::size_t a, std::size_t b) const {
        const Matrix3 turn =
            cavity_from_cutter[a].topLeftCorner<3, 3>().transpose() * cavity_from_cutter[b].topLeftCorner<3, 3>();
        return turn.trace() >= 3 - 8 * kStill;
    }
    // Poses a to b lie over each other, z falling or rising all along, and look alike.
    bool plumb(std::size_t a, std::size_t b, int sign) const {
        for (std::size_t i = a; i < b; ++i) {
            const Vector3 step = place(i + 1) - place(i);
            if (!(std::hypot(step.x(), step.y()) <= kPlumb_mm && sign * step.z() >= 0 && keepsRotation(i, i + 1)))
                return false;
        }
        return true;
    }
};

Error unfit(const std::string& found, const std::string& expected) {
    return noSolution("motion, checked by voxels", found, expected, "nothing is moved; plan the cut again");
}

}  // namespace

Result<void> VoxelMotionChecker::judge(const MotionProposal& proposal) const {
    const Matrix4 robot_from_cavity = envelope_.robot_from_cavity.matrix();
    const Matrix3 back = robot_from_cavity.topLeftCorner<3, 3>().transpose();
    Matrix4 cavity_from_robot = Matrix4::Identity();
    cavity_from_robot.topLeftCorner<3, 3>() = back;
    cavity_from_robot.topRightCorner<3, 1>() = -back * robot_from_cavity.topRightCorner<3, 1>();
    Track track;
    for (const MotionStep& step : proposal.steps) {
        track.cavity_from_cutter.emplace_back(cavity_from_robot * step.robot_from_cutter.matrix());
        track.feeds.push_back(step.feed_mm_s);
    }
    const std::size_t count = track.feeds.size();
    const auto isHigh = [&](std::size_t i) { return track.place(i).z() >= envelope_.open_mm + kFree_mm; };
    const auto isBelow = [&](std::size_t i) { return track.place(i).z() < envelope_.open_mm; };

    // The first and last places that are high, and between them the one stretch that is not.
    std::size_t first = 0, last = count;
    while (first < count && !isHigh(first))
        ++first;
    while (last > first && !isHigh(last - 1))
        --last;
    if (first == count) return unfit("a motion that is never above the field", "travel above it");
    --last;
    if (!track.plumb(0, first, +1)) return unfit("a start that does not rise straight up", "one that does");
    if (!track.plumb(last, count - 1, -1)) return unfit("an end that does not sink straight down", "one that does");
    if (last + 1 < count && !((track.place(count - 1) - track.place(0)).norm() <= kPlumb_mm))
        return unfit("another end than the start", "the cutter back where it began");
    std::size_t in = first, out = last;
    while (in < last && isHigh(in + 1))
        ++in;
    while (out > in && isHigh(out - 1))
        --out;
    if (in >= out) return unfit("a motion that never goes down to the cavity", "a path");
    // in and out are high; all between must be the way down, the path, and the way up.
    std::size_t a = in + 1, b = out - 1;
    while (a < b && !isBelow(a))
        ++a;
    while (b > a && !isBelow(b))
        --b;
    if (!track.plumb(in, a, -1) || !track.plumb(b, out, +1))
        return unfit("a way to the opening that is not straight down and up", "one that is");
    ToolPath path;
    path.cutter = envelope_.mounted;
    for (std::size_t i = a; i < b; ++i) {
        if (!isBelow(i) || !isBelow(i + 1)) return unfit("a path that leaves the envelope's opening", "one that stays");
        const bool moves = (track.place(i + 1) - track.place(i)).norm() > kPlumb_mm;
        if (!track.keepsRotation(i, i + 1)) {
            if (moves) return unfit("a turn on the way", "moves that keep the spindle's direction");
            continue;
        }
        ToolMove move;
        move.segment.from_mm = path.moves.empty() ? track.place(i) : path.moves.back().segment.to_mm;
        move.segment.to_mm = track.place(i + 1);
        move.segment.spindle = track.spindle(i + 1).normalized();
        move.feed_mm_s = track.feeds[i + 1];
        path.moves.push_back(move);
    }
    if (path.moves.empty()) return unfit("no move inside the envelope", "a path");
    const Result<EnvelopeVerdict> verdict = checkByVoxels(path, envelope_.envelope);
    if (!verdict) return verdict.error();
    if (!verdict->passed())
        return unfit(
            fmt::format("the cutter {:.3f} mm beyond the envelope in move {}", verdict->worst_mm, verdict->worst_move),
            "a path inside it");
    return {};
}

}  // namespace fluorocut
