#include "core/procedure/setup.h"

#include <cmath>
#include <set>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/utc.h"
#include "core/distortion/distortion_map.h"

namespace fluorocut {
namespace {

Result<void> requireText(const char* field, const std::string& text) {
    if (!text.empty()) return {};
    return invalidOption(field, "nothing", "a name");
}

Result<void> checkPatient(const ProcedurePatient& patient) {
    if (auto good = requireText("patient.name", patient.name); !good) return good;
    if (patient.side != "left" && patient.side != "right")
        return invalidOption("patient.side", "'" + patient.side + "'", "left or right");
    if (auto good = patient.beads.validate(); !good) return good;
    if (patient.beads.frame != Frame::femur)
        return invalidOption("patient.beads", fmt::format("frame {}", name(patient.beads.frame)), "frame femur");
    if (patient.ct && patient.ct->empty()) return invalidOption("patient.ct", "no voxels", "a CT, or none at all");
    return requireRange("patient.mu_water_per_mm", patient.mu_water_per_mm, 1e-3, 1, "1/mm");
}

Result<void> checkPlan(const ProcedurePlan& plan) {
    if (auto good = requireText("plan.implant", plan.implant); !good) return good;
    if (plan.mesh.triangles.empty()) return invalidOption("plan.mesh", "no triangles", "a closed surface");
    if (auto good = plan.cavity.validate(); !good) return good;
    if (auto good = plan.path.validate(); !good) return good;
    if (plan.cavity.cutter_radius_mm != plan.path.cutter.radius_mm) {
        return invalidOption("plan.path.cutter.radius_mm", fmt::format("{:g}", plan.path.cutter.radius_mm),
                             fmt::format("{:g} mm, as plan.cavity has it", plan.cavity.cutter_radius_mm));
    }
    if (plan.stages < 1 || plan.stages > 20)
        return invalidOption("plan.stages", fmt::format("{}", plan.stages), "1 to 20");
    if (plan.insets_mm.empty()) return {};
    if (plan.insets_mm.size() != static_cast<std::size_t>(plan.stages)) {
        return invalidOption("plan.insets_mm", fmt::format("{} insets", plan.insets_mm.size()),
                             fmt::format("one for each of {} stages, or none", plan.stages));
    }
    return checkInsets("plan.insets_mm", plan.insets_mm);
}

Result<void> checkCalibration(const ProcedureCalibration& calibration) {
    if (auto good = calibration.corkscrew.validate(); !good) return good;
    const Pose& mount = calibration.flange_from_corkscrew;
    if (mount.target != Frame::flange || mount.source != Frame::corkscrew || !mount.covariance) {
        return invalidOption("calibration.flange_from_corkscrew",
                             fmt::format("{} from {}{}", name(mount.target), name(mount.source),
                                         mount.covariance ? "" : " without covariance"),
                             "flange from corkscrew, with its covariance");
    }
    if (!daysFromUtc(calibration.calibrated_utc)) {
        return invalidOption("calibration.calibrated_utc", "'" + calibration.calibrated_utc + "'",
                             "a time like 2026-03-01T09:30:00Z");
    }
    return requireRanges({{"calibration.focal_length_sigma_mm", calibration.focal_length_sigma_mm, 0, 100, "mm"},
                          {"calibration.image_centre_sigma_px", calibration.image_centre_sigma_px, 0, 100, "px"},
                          {"calibration.bead_sigma_mm", calibration.bead_sigma_mm, 0, 5, "mm"},
                          {"calibration.corkscrew_sigma_mm", calibration.corkscrew_sigma_mm, 0, 5, "mm"},
                          {"calibration.local_distortion_mm", calibration.local_distortion_mm, 0, 1, "mm"},
                          {"calibration.robot_sigma_mm", calibration.robot_sigma_mm, 1e-4, 5, "mm"},
                          {"calibration.robot_sigma_rad", calibration.robot_sigma_rad, 1e-6, 0.1, "rad"},
                          {"calibration.location_sigma_mm", calibration.location_sigma_mm, 0, 5, "mm"},
                          {"calibration.location_sigma_rad", calibration.location_sigma_rad, 0, 0.1, "rad"},
                          {"calibration.location_sigma_roll_rad", calibration.location_sigma_roll_rad, 0, 0.1, "rad"}});
}

}  // namespace

Result<void> checkInsets(const char* field, const std::vector<double>& insets_mm) {
    const std::string expected = fmt::format("insets that fall to 0, the first at most {:g} mm", kMostInset_mm);
    for (std::size_t n = 0; n < insets_mm.size(); ++n) {
        const double next = n + 1 < insets_mm.size() ? insets_mm[n + 1] : -1;
        if (!(insets_mm[n] > next && insets_mm[n] >= 0 && insets_mm[n] <= kMostInset_mm))
            return invalidOption(field, fmt::format("{:g} in place {}", insets_mm[n], n + 1), expected);
    }
    if (!insets_mm.empty() && insets_mm.back() != 0)
        return invalidOption(field, fmt::format("{:g} at the end", insets_mm.back()), expected);
    return {};
}

Result<void> ProcedureLimits::validate() const {
    return requireRanges({{"limits.contained_probability", contained_probability, 0.5, 0.9999, ""},
                          {"limits.envelope_delta_mm", envelope_delta_mm, 0.5, 1, "mm"},
                          {"limits.least_probability", least_probability, 1e-9, 0.1, ""},
                          {"limits.most_view_turn_rad", most_view_turn_rad, 0.01, 3.2, "rad"}});
}

Result<void> ProcedureSetup::validate() const {
    if (auto good = checkPatient(patient); !good) return good;
    if (auto good = checkPlan(plan); !good) return good;
    if (auto good = checkCalibration(calibration); !good) return good;
    if (auto good = limits.validate(); !good) return good;
    if (views.empty()) return invalidOption("views", "none", "at least one");
    std::set<std::string> names;
    for (const ProcedureView& view : views) {
        if (auto good = requireText("views.name", view.name); !good) return good;
        if (view.name.find_first_of("/\\") != std::string::npos || view.name.front() == '.')
            return invalidOption("views.name", "'" + view.name + "'", "a name that a file can have");
        if (!names.insert(view.name).second)
            return invalidOption("views.name", view.name + " a second time", "another name for each view");
        if (auto good = view.position.validate(); !good) return good;
        if (auto good = view.carm.validate(); !good) return good;
        if (view.carm.distortion && !mapOf(*view.carm.distortion)) {
            return invalidOption("views." + view.name + ".carm.distortion", "one that is no measured map",
                                 "a map of core/distortion/distortion_map.h, or none");
        }
    }
    return {};
}

}  // namespace fluorocut
