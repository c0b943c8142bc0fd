#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "core/base/units.h"
#include "core/geometry/mesh_section.h"
#include "core/image/distance_field.h"
#include "core/planning/line_fit.h"
#include "core/planning/stem_fill.h"
#include "core/planning/templating.h"
#include "core/planning/templating_search.h"

namespace fluorocut {
namespace {

class WallFilling final : public Filling {
  public:
    WallFilling(const BoneWalls& walls, const TemplateOptions& options) : walls_(walls), options_(options) {}

    double canal(const Vector3& p) const { return sampleField(walls_.canal_field, p, kWallBandMm); }
    double outer(const Vector3& p) const { return sampleField(walls_.outer_field, p, kWallBandMm); }

    double excess(const Vector3& p, Vector3& gradient) const override {
        const double c = canal(p), cut = c - options_.most_reaming_mm;
        const double wall = outer(p) + options_.least_wall_mm;
        if (cut >= std::min(c, wall)) {
            gradient = fieldGradient(walls_.canal_field, p);
            return cut;
        }
        gradient = fieldGradient(c < wall ? walls_.canal_field : walls_.outer_field, p);
        return std::min(c, wall);
    }

  private:
    const BoneWalls& walls_;
    const TemplateOptions& options_;
};

// The canal's middle line over the stem's length: the start that a bowed shaft asks for.
Rigid3 startAlong(const BoneWalls& walls, const StemSeat& seat, double length, double turn) {
    std::vector<Vector3> centers;
    Vector3 top = seat.point;
    double nearest = std::numeric_limits<double>::infinity();
    for (const WallLevel& level : walls.levels) {
        const double below = (seat.point - level.center).dot(seat.axis);
        if (below > -2 && below < length) centers.push_back(walls.canalCenter(level));
        if (std::abs(below) < nearest) {
            nearest = std::abs(below);
            top = walls.canalCenter(level);
        }
    }
    StemSeat local = seat;
    local.point = top + (seat.point - top).dot(seat.axis) * seat.axis;
    if (const LineFit line = fitLine(centers); std::isfinite(line.rms_mm)) {
        local.axis = line.direction.dot(seat.axis) > 0 ? line.direction : Vector3(-line.direction);
        // Where the line meets the resection.
        local.point = line.point + (seat.point - line.point).dot(seat.axis) / local.axis.dot(seat.axis) * local.axis;
    }
    local.medial = Eigen::AngleAxisd(turn, local.axis) * seat.medial;
    return local.femurFromCavity();
}

}  // namespace

Result<TemplateProposal> proposeStem(const std::vector<Implant>& sizes, const BoneWalls& walls, const StemSeat& seat,
                                     const TemplateOptions& options, Progress& progress) {
    if (sizes.empty()) throw std::logic_error("proposeStem: no sizes");
    if (walls.levels.empty()) throw std::logic_error("proposeStem: no walls");
    const WallFilling filling(walls, options);
    const double middle_length = sizes[sizes.size() / 2].stem_length_mm;
    const auto complaint = [&](const Vector3& p, double) {
        const double c = filling.canal(p), left = -filling.outer(p);
        if (c - options.most_reaming_mm >= std::min(c, options.least_wall_mm - left))
            return fmt::format("would cut {:.1f} mm into the cortex (allowed {:g} mm)", c, options.most_reaming_mm);
        return left > 0 ? fmt::format("would leave a wall of {:.1f} mm (limit {:g} mm)", left, options.least_wall_mm)
                        : fmt::format("would break through the wall by {:.1f} mm", -left);
    };
    TemplateBone bone{filling, complaint, walls.levels.front().center, {}};
    for (const double turn : {0.0, radiansFromDegrees(12), radiansFromDegrees(-12)})
        bone.starts.push_back(startAlong(walls, seat, middle_length, turn) *
                              Rigid3::fromTranslation({0, 0, -sizes.front().resection_z_mm}));
    if ((walls.levels.back().center - seat.point).dot(seat.axis) < -1)
        return invalidInput("walls", "walls that end below the resection", "walls up to it");
    Result<TemplateProposal> proposal = searchSizes(sizes, seat, bone, options, progress);
    if (!proposal) return proposal;

    const Implant& implant = implantOfSize(sizes, proposal->size);
    const Rigid3& pose = proposal->femur_from_cavity;
    Result<std::vector<FillLevel>> fill = stemFill(implant, pose, walls, options.level_step_mm);
    if (!fill) return fill.error();
    proposal->fill = std::move(*fill);
    proposal->least_wall = leastWall(implant, pose, walls, false);
    proposal->least_cut = leastWall(implant, pose, walls, true);
    for (const std::string& warning : walls.warnings)
        proposal->warnings.push_back(warning);
    return proposal;
}

}  // namespace fluorocut
