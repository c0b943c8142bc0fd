// The checker that walks through a motion pose by pose. No code in common with voxel_motion_checker.cpp.
#include <cmath>

#include <fmt/format.h>

#include "core/cutting/envelope_check.h"
#include "core/procedure/cutting_motion.h"

namespace fluorocut {
namespace {

constexpr double kSame_mm = 1e-3, kSame_rad = 1e-6;

enum class Phase { lifting, travelling, sinking, cutting, rising, leaving, landing };

struct Leg {
    Rigid3 from, to;

    double aside() const { return (to.translation() - from.translation()).head<2>().norm(); }
    double up() const { return to.translation().z() - from.translation().z(); }
    double turn() const { return from.rotation().angularDistance(to.rotation()); }
    bool straightUpOrDown() const { return aside() <= kSame_mm && turn() <= kSame_rad; }
    double low() const { return std::min(from.translation().z(), to.translation().z()); }
};

Error refused(std::size_t step, const std::string& found, const std::string& expected) {
    return noSolution(fmt::format("motion, step {}, checked by mesh", step), found, expected,
                      "nothing is moved; plan the cut again");
}

}  // namespace

Result<void> MeshMotionChecker::judge(const MotionProposal& proposal) const {
    const Rigid3 cavity_from_robot = envelope_.robot_from_cavity.inverse();
    const double free_mm = envelope_.open_mm + kFree_mm;
    ToolPath below;
    below.cutter = envelope_.mounted;
    Phase phase = Phase::lifting;
    for (std::size_t i = 1; i < proposal.steps.size(); ++i) {
        const Leg leg{cavity_from_robot * proposal.steps[i - 1].robot_from_cutter,
                      cavity_from_robot * proposal.steps[i].robot_from_cutter};
        const bool ends_low = leg.to.translation().z() < envelope_.open_mm;
        // On to the phase that this leg belongs to.
        if (phase == Phase::lifting && !(leg.straightUpOrDown() && leg.up() >= 0)) phase = Phase::travelling;
        if (phase == Phase::travelling && leg.low() < free_mm) phase = Phase::sinking;
        if (phase == Phase::cutting && !ends_low) phase = Phase::rising;
        if (phase == Phase::rising && leg.low() >= free_mm) phase = Phase::leaving;
        if (phase == Phase::leaving && leg.low() < free_mm) phase = Phase::landing;

        if (phase == Phase::sinking || phase == Phase::rising) {
            const bool right_way = phase == Phase::sinking ? leg.up() <= 0 : leg.up() >= 0;
            if (!(leg.straightUpOrDown() && right_way))
                return refused(i, "a move aside near the opening", "straight down into it or straight up out of it");
            if (phase == Phase::sinking && ends_low) phase = Phase::cutting;
        } else if (phase == Phase::landing) {
            if (!(leg.straightUpOrDown() && leg.up() <= 0))
                return refused(i, "a move aside near the bone", "straight down to where the cutter began");
        } else if (phase == Phase::cutting) {
            const double way = (leg.to.translation() - leg.from.translation()).norm();
            if (leg.turn() > kSame_rad) {
                if (way > kSame_mm) return refused(i, "a turn on the way", "moves that keep the spindle's direction");
                continue;  // the envelope check looks at what comes after it
            }
            const Vector3 from = below.moves.empty() ? leg.from.translation() : below.moves.back().segment.to_mm;
            below.moves.push_back({{from, leg.to.translation(), leg.to.rotate(Vector3::UnitZ()).normalized()},
                                   ToolMotion::cut,
                                   proposal.steps[i].feed_mm_s});
        } else if (!(leg.low() >= free_mm || phase == Phase::lifting)) {
            return refused(i, "a move through the field", fmt::format("{:g} mm above the opening", kFree_mm));
        }
    }
    if (below.moves.empty()) return refused(0, "no move inside the envelope", "a path");
    if (phase != Phase::landing && phase != Phase::leaving)
        return refused(proposal.steps.size() - 1, "an end in the field", "the cutter back where it began");
    const double gap =
        (proposal.steps.back().robot_from_cutter.translation() - proposal.steps.front().robot_from_cutter.translation())
            .norm();
    if (phase == Phase::landing && !(gap <= kSame_mm))
        return refused(proposal.steps.size() - 1, fmt::format("an end {:.2f} mm from the start", gap),
                       "the cutter back where it began");
    const Result<EnvelopeVerdict> verdict = checkByMesh(below, envelope_.envelope);
    if (!verdict) return verdict.error();
    if (!verdict->passed()) {
        return refused(verdict->worst_move, fmt::format("the cutter {:.3f} mm beyond the envelope", verdict->worst_mm),
                       "a path inside it");
    }
    return {};
}

}  // namespace fluorocut
