#include "core/planning/templating_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/stopwatch.h"
#include "core/planning/containment.h"

namespace fluorocut {
namespace {

constexpr std::size_t kPointsToJudge = 6000;

struct Trial {
    SizeTrial outcome;
    bool too_long = false;
};

Trial trySize(const Implant& implant, const StemSeat& seat, const TemplateBone& bone, const TemplateOptions& options) {
    Trial trial;
    trial.outcome.size = implant.size;
    const double known = (seat.point - bone.lowest).dot(seat.axis);
    if (implant.stem_length_mm > known) {
        trial.too_long = true;
        trial.outcome.reason =
            fmt::format("size {} reaches {:.0f} mm below the resection, {:.0f} mm beyond where the bone is known",
                        implant.size, implant.stem_length_mm, implant.stem_length_mm - known);
        return trial;
    }
    const std::vector<Vector3> search = stemSurface(implant, static_cast<std::size_t>(options.points));
    StemFit best;
    for (const Rigid3& start : bone.starts) {
        const StemFit fit = fitStem(search, bone.filling, start, seat.axis);
        if (fit.excess_mm < best.excess_mm) best = fit;
    }
    const std::vector<Vector3> all = stemSurface(implant, kPointsToJudge);
    const StemFit judged = evaluateStem(all, bone.filling, best.femur_from_cavity);
    trial.outcome.femur_from_cavity = judged.femur_from_cavity;
    trial.outcome.excess_mm = judged.excess_mm;
    trial.outcome.fits = judged.excess_mm <= options.tolerance_mm;
    if (!trial.outcome.fits) {
        const Vector3& p = all[judged.worst];
        trial.outcome.reason = fmt::format("size {} {}, {:.0f} mm below the resection on the {} side", implant.size,
                                           bone.complaint(judged.femur_from_cavity * p, judged.excess_mm),
                                           implant.resection_z_mm - p.z(), sideOf(p, implant.side));
    }
    return trial;
}

}  // namespace

Result<void> TemplateOptions::validate() const {
    return requireRanges({{"least_wall_mm", least_wall_mm, 0, 20, "mm"},
                          {"most_reaming_mm", most_reaming_mm, -3, 10, "mm"},
                          {"tolerance_mm", tolerance_mm, 0, 1, "mm"},
                          {"points", static_cast<double>(points), 100, 50000, ""},
                          {"level_step_mm", level_step_mm, 1, 100, "mm"}});
}

Rigid3 StemSeat::femurFromCavity(double resection_z_mm) const {
    Matrix3 axes;
    axes.col(2) = axis.normalized();
    axes.col(0) = (medial - medial.dot(axes.col(2)) * axes.col(2)).normalized();
    axes.col(1) = axes.col(2).cross(axes.col(0));
    return Rigid3(axes, point - resection_z_mm * axes.col(2));
}

std::vector<Vector3> stemSurface(const Implant& implant, std::size_t most) {
    std::vector<Vector3> points;
    for (const SurfacePoint& p : surfacePoints(implant.in_bone, most))
        if (!(p.normal.z() > 0.9 && p.position.z() > implant.resection_z_mm - 0.5)) points.push_back(p.position);
    return points;
}

std::string sideOf(const Vector3& p, Side side) {
    const double anterior = side == Side::left ? p.y() : -p.y();
    const double angle = std::atan2(anterior, p.x());  // from medial toward anterior
    static constexpr std::array<const char*, 8> kNames{"medial",  "antero-medial",   "anterior",  "antero-lateral",
                                                       "lateral", "postero-lateral", "posterior", "postero-medial"};
    const long octant = std::lround(angle / (0.25 * 3.14159265358979323846));
    return kNames[static_cast<std::size_t>((octant + 8) % 8)];
}

const Implant& implantOfSize(const std::vector<Implant>& sizes, const std::string& size) {
    const auto found = std::find_if(sizes.begin(), sizes.end(), [&](const Implant& i) { return i.size == size; });
    if (found == sizes.end()) throw std::logic_error("implantOfSize: no size " + size);
    return *found;
}

Result<TemplateProposal> searchSizes(const std::vector<Implant>& sizes, const StemSeat& seat, const TemplateBone& bone,
                                     const TemplateOptions& options, Progress& progress) {
    constexpr const char* kStep = "trying sizes";
    const Stopwatch stopwatch;
    if (auto good = options.validate(); !good) return good.error();
    if (sizes.empty() || bone.starts.empty()) throw std::logic_error("searchSizes: no sizes or nowhere to start");
    for (const Implant& implant : sizes)
        if (implant.side != seat.side)
            return invalidInput("implant " + implant.family, fmt::format("a {} stem", name(implant.side)),
                                fmt::format("a {} one for this femur", name(seat.side)));
    TemplateProposal proposal;
    bool found = false;
    for (std::size_t n = sizes.size(); n-- > 0;) {
        if (progress.isCancelled()) return cancelled(kStep);
        progress.report(static_cast<double>(sizes.size() - 1 - n) / static_cast<double>(sizes.size()), kStep);
        Trial trial = trySize(sizes[n], seat, bone, options);
        proposal.trials.push_back(trial.outcome);
        if (found) break;  // the one below the proposal
        if (!trial.outcome.fits) continue;
        found = true;
        proposal.size = trial.outcome.size;
        proposal.femur_from_cavity = trial.outcome.femur_from_cavity;
        proposal.excess_mm = trial.outcome.excess_mm;
        if (proposal.trials.size() > 1) proposal.next_size_reason = proposal.trials[proposal.trials.size() - 2].reason;
        if (n + 1 == sizes.size())
            proposal.warnings.push_back("the largest size of the family fits: a larger one might fill better");
    }
    if (!found)
        return noSolution("stem " + sizes.front().family, proposal.trials.back().reason,
                          fmt::format("one of {} sizes that fits", sizes.size()),
                          "take another family, a lower wall limit or another level of resection");
    proposal.elapsed_ms = stopwatch.ms();
    return proposal;
}

}  // namespace fluorocut
