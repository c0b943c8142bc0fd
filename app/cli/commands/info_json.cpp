#include "app/cli/commands/info_json.h"

#include <functional>
#include <limits>
#include <map>

#include "app/cli/files.h"
#include "app/cli/numbers.h"
#include "core/base/units.h"
#include "core/cutting/tool_path_file.h"
#include "core/distortion/distortion_acceptance.h"
#include "core/distortion/distortion_map_set.h"
#include "core/distortion/grooved_plate.h"
#include "core/fiducial/bead_layout.h"
#include "core/fiducial/corkscrew_layout.h"
#include "core/io/json_file.h"
#include "core/io/pose_file.h"
#include "core/planning/implant_file.h"
#include "core/registration/registration_file.h"

namespace fluorocut::cli {
namespace {

Report reportOf(const Pose& pose) {
    const Vector3 angles = pose.target_from_source.twistRollPitch();
    const Vector3 angles_deg(degreesFromRadians(angles.x()), degreesFromRadians(angles.y()),
                             degreesFromRadians(angles.z()));
    Report report;
    report.json = {{"kind", "pose"},
                   {"format", "JSON"},
                   {"target", name(pose.target)},
                   {"source", name(pose.source)},
                   {"matrix", rowsOf(pose.target_from_source.matrix())}};
    report.line("pose", fmt::format("{} from {}", name(pose.target), name(pose.source)));
    report.line("translation", listText(pose.target_from_source.translation(), "{:.6g}") + " mm");
    report.line("twist, roll, pitch", listText(angles_deg, "{:.6g}") + " degrees");
    if (pose.covariance) {
        report.json["covariance"] = rowsOf(*pose.covariance);
        const Vector6 deviation = pose.covariance->diagonal().cwiseSqrt();
        const Vector3 turns_deg = deviation.tail<3>() * degreesFromRadians(1);
        report.line("std. deviation", fmt::format("{} mm, {} degrees", listText(Vector3(deviation.head<3>()), "{:.3g}"),
                                                  listText(turns_deg, "{:.3g}")));
    } else {
        report.json["covariance"] = nullptr;
    }
    return report;
}

// A family of stems, or one stem that a mesh gives.
Result<Report> infoOfImplant(const std::filesystem::path& file) {
    Report report;
    if (const Result<ImplantFamily> family = readImplantFamily(file); family) {
        std::vector<std::string> sizes;
        for (const StemSize& size : family->sizes)
            sizes.push_back(size.name);
        report.json = {{"kind", "implant family"},     {"format", "JSON"},
                       {"name", family->name},         {"sizes", sizes},
                       {"necks_mm", family->necks_mm}, {"heads_mm", family->heads_mm}};
        report.line("implants", family->name + ": " + family->description);
        report.line("sizes", fmt::format("{}, {} to {}", sizes.size(), sizes.front(), sizes.back()));
        return report;
    }
    const Result<Implant> implant = loadImplant(file.string());
    if (!implant) return implant.error();
    report.json = {{"kind", "implant"},
                   {"format", "JSON"},
                   {"name", implant->family},
                   {"side", name(implant->side)},
                   {"stem_length_mm", implant->stem_length_mm}};
    report.line("implant", fmt::format("{}, {}, {:.1f} mm long below the resection", implant->family,
                                       name(implant->side), implant->stem_length_mm));
    return report;
}

Report reportOf(const RegistrationFile& file) {
    Report report;
    nlohmann::ordered_json views = nlohmann::ordered_json::array(), points = nlohmann::ordered_json::array();
    for (std::size_t i = 0; i < file.problem.views.size(); ++i) {
        const std::string& view = file.problem.views[i].name;
        views.push_back({{"name", view}, {"time", file.times[i]}});
        report.line("view", file.times[i].empty() ? view : view + ", " + file.times[i]);
    }
    for (const NamedPoint& point : file.points) {
        points.push_back({{"name", point.name}, {"in_femur_mm", arrayOf(point.in_femur)}});
        report.line("point", point.name + " at " + listText(point.in_femur, "{:.6g}") + " mm in the femur");
    }
    report.json = {{"kind", "registration"}, {"format", "JSON"}, {"views", views}, {"points", points}};
    return report;
}

Report reportOf(const CArm& carm) {
    Report report;
    report.json = {{"kind", "carm"},
                   {"format", "JSON"},
                   {"name", carm.name},
                   {"size", {carm.columns, carm.rows}},
                   {"pixel_mm", arrayOf(carm.pixel_mm)},
                   {"focal_length_mm", carm.focal_length_mm},
                   {"principal_point_px", arrayOf(carm.principal_point_px)},
                   {"has_distortion", carm.distortion != nullptr}};
    report.line("C-arm", carm.name);
    report.line("size", fmt::format("{} x {} px", carm.columns, carm.rows));
    report.line("pixel", listText(carm.pixel_mm, "{:.5g}", " x ") + " mm");
    report.line("focal length", fmt::format("{:.6g} mm", carm.focal_length_mm));
    report.line("principal point", listText(carm.principal_point_px, "{:.6g}") + " px");
    report.line("distortion", carm.distortion ? "yes" : "none");
    return report;
}

Report reportOf(const GroovedPlate& plate) {
    Report report;
    report.json = {{"kind", "plate"},
                   {"format", "JSON"},
                   {"pitch_mm", plate.pitch_mm},
                   {"groove_width_mm", plate.groove_width_mm},
                   {"groove_depth_mm", plate.groove_depth_mm},
                   {"thickness_mm", plate.thickness_mm},
                   {"material", name(plate.material)},
                   {"groove_contrast", plate.grooveContrast()}};
    report.line("plate", fmt::format("{} {:.5g} mm thick", name(plate.material), plate.thickness_mm));
    report.line("grooves", fmt::format("{:.5g} mm wide, {:.5g} mm deep, every {:.5g} mm", plate.groove_width_mm,
                                       plate.groove_depth_mm, plate.pitch_mm));
    if (plate.grooves) {
        report.json["grooves"] = *plate.grooves;
        report.line("number", fmt::format("{} along y, {} along x", (*plate.grooves)[0], (*plate.grooves)[1]));
    }
    report.line("contrast", fmt::format("{:.1f} % at 60 keV, without scatter", 100 * plate.grooveContrast()));
    return report;
}

Report reportOf(const BeadLayout& layout) {
    Vector3 low = layout.beads.front().center_mm, high = low;
    double least_mm = layout.beads.front().diameter_mm, most_mm = least_mm;
    for (const Bead& bead : layout.beads) {
        low = low.cwiseMin(bead.center_mm);
        high = high.cwiseMax(bead.center_mm);
        least_mm = std::min(least_mm, bead.diameter_mm);
        most_mm = std::max(most_mm, bead.diameter_mm);
    }
    Report report;
    report.json = {{"kind", "beads"},
                   {"format", "JSON"},
                   {"frame", name(layout.frame)},
                   {"beads", layout.beads.size()},
                   {"least_mm", arrayOf(low)},
                   {"most_mm", arrayOf(high)}};
    report.line("beads", fmt::format("{} in frame {}", layout.beads.size(), name(layout.frame)));
    report.line("diameters", fmt::format("{:.4g} to {:.4g} mm", least_mm, most_mm));
    report.line("extent", listText(Vector3(high - low), "{:.4g}", " x ") + " mm");
    return report;
}

Report reportOf(const CorkscrewLayout& layout) {
    Eigen::VectorXd places(static_cast<Eigen::Index>(layout.rings.size()));
    for (Eigen::Index i = 0; i < places.size(); ++i)
        places[i] = layout.rings[static_cast<std::size_t>(i)].x_mm;
    const CorkscrewHelix& helix = layout.helix;
    const bool right = helix.handedness == Handedness::right;
    Report report;
    report.json = {{"kind", "corkscrew"},
                   {"format", "JSON"},
                   {"rod_radius_mm", layout.rod_radius_mm},
                   {"rod_x_mm", layout.rod_x_mm},
                   {"shaft_radius_mm", layout.shaft_radius_mm},
                   {"shaft_x_mm", layout.shaft_x_mm},
                   {"rings_x_mm", arrayOf(places)},
                   {"helix_x_mm", {helix.x_start_mm, helix.x_end_mm}},
                   {"helix_turns", helix.turns},
                   {"helix_handedness", right ? "right" : "left"},
                   {"beads", layout.beads.size()}};
    report.line("corkscrew", fmt::format("rod of {:.5g} mm, {} mm long, {}", 2 * layout.rod_radius_mm,
                                         layout.rod_x_mm[1] - layout.rod_x_mm[0], name(layout.rod)));
    report.line("shaft", fmt::format("{:.4g} mm thick, from {} to {} mm, {}", 2 * layout.shaft_radius_mm,
                                     layout.shaft_x_mm[0], layout.shaft_x_mm[1], name(layout.shaft)));
    report.line("rings", "at " + listText(places, "{:.5g}") + " mm");
    report.line("helix", fmt::format("{:.4g} turns from {} to {} mm, {}-handed, radius {:.4g} mm", helix.turns,
                                     helix.x_start_mm, helix.x_end_mm, right ? "right" : "left", helix.radius_mm));
    report.line("wire", fmt::format("{:.3g} mm thick, {}", 2 * helix.wire_radius_mm, name(layout.wire)));
    report.line("beads", std::to_string(layout.beads.size()));
    return report;
}

std::string positionText(const DistortionMapParts& parts) {
    if (!parts.position) return "not stated";
    return fmt::format("orbital {:.4g}, angulation {:.4g} degrees", degreesFromRadians(parts.position->orbital_rad),
                       degreesFromRadians(parts.position->angulation_rad));
}

Report reportOf(const DistortionMap& map) {
    const DistortionQuality& quality = map.quality();
    const MapUncertainty uncertainty = uncertaintyOf(map);
    Report report;
    report.json = {
        {"kind", "distortion"},
        {"format", "JSON"},
        {"model", map.model().name()},
        {"size", {map.columns(), map.rows()}},
        {"pixel_mm", map.pixelMm()},
        {"residual_px", quality.rms_px},
        {"residual_mm", quality.rms_mm},
        {"points_used", quality.points_used},
        {"coverage", quality.coverage},
        {"uncertainty_mm",
         {{"middle", uncertainty.middle_mm}, {"rms", uncertainty.rms_mm}, {"largest", uncertainty.largest_mm}}},
        {"measured_at", map.parts().measured_at}};
    report.line("distortion map", std::string(map.model().name()));
    report.line("size", fmt::format("{} x {} px of {:.5f} mm", map.columns(), map.rows(), map.pixelMm()));
    report.line("points", fmt::format("{} used, {} rejected", quality.points_used, quality.points_rejected));
    report.line("coverage", fmt::format("{:.0f} % of the image", 100 * quality.coverage));
    report.line("residual", fmt::format("{:.3f} px, {:.4f} mm rms", quality.rms_px, quality.rms_mm));
    report.line("uncertainty", fmt::format("{:.4f} mm in the middle, {:.4f} mm at most", uncertainty.middle_mm,
                                           uncertainty.largest_mm));
    report.line("C-arm", positionText(map.parts()));
    report.line("measured", map.parts().measured_at.empty() ? "not stated" : map.parts().measured_at);
    for (const std::string& warning : quality.warnings)
        report.line("warning", warning);
    return report;
}

Report reportOf(const DistortionMapSet& set) {
    Report report;
    report.json = {{"kind", "distortion-set"}, {"format", "JSON"}, {"maps", nlohmann::ordered_json::array()}};
    report.line("distortion maps", std::to_string(set.maps().size()));
    for (const DistortionMap& map : set.maps()) {
        const DistortionMapParts& parts = map.parts();
        report.json["maps"].push_back({{"orbital_deg", degreesFromRadians(parts.position->orbital_rad)},
                                       {"angulation_deg", degreesFromRadians(parts.position->angulation_rad)},
                                       {"measured_at", parts.measured_at}});
        report.line("map", positionText(parts) + ", " + parts.measured_at);
    }
    return report;
}

Report reportOf(const ToolPath& path) {
    Vector3 low = Vector3::Constant(std::numeric_limits<double>::infinity()), high = -low;
    for (const ToolMove& move : path.moves) {
        low = low.cwiseMin(move.segment.from_mm).cwiseMin(move.segment.to_mm);
        high = high.cwiseMax(move.segment.from_mm).cwiseMax(move.segment.to_mm);
    }
    Report report;
    report.json = {{"kind", "tool-path"},
                   {"format", "JSON"},
                   {"cutter_radius_mm", path.cutter.radius_mm},
                   {"cutter_length_mm", path.cutter.length_mm},
                   {"moves", path.moves.size()},
                   {"layers", path.layers},
                   {"cutting_mm", path.cutting_mm},
                   {"time_s", path.time_s}};
    report.line("tool path",
                fmt::format("{} moves in {} layers, a proposal that is not checked", path.moves.size(), path.layers));
    report.line("cutter",
                fmt::format("ball of {:g} mm radius, shank of {:g} mm", path.cutter.radius_mm, path.cutter.length_mm));
    report.line("cutting", fmt::format("{:.0f} mm, {:.0f} s in all", path.cutting_mm, path.time_s));
    if (!path.moves.empty()) report.line("extent", listText(Vector3(high - low), "{:.4g}", " x ") + " mm");
    for (const std::string& warning : path.warnings)
        report.line("warning", warning);
    return report;
}

template <class T>
Result<Report> reportOrError(const Result<T>& read) {
    if (!read) return read.error();
    return reportOf(*read);
}

using Reader = std::function<Result<Report>(const std::filesystem::path&)>;

const std::map<std::string, Reader>& readers() {
    static const std::map<std::string, Reader> all{
        {"fluorocut/pose/1", [](const auto& file) { return reportOrError(readPose(file)); }},
        {"fluorocut/carm/1", [](const auto& file) { return reportOrError(readImager(file)); }},
        {"fluorocut/plate/1", [](const auto& file) { return reportOrError(readGroovedPlate(file)); }},
        {"fluorocut/corkscrew/1", [](const auto& file) { return reportOrError(readCorkscrew(file)); }},
        {"fluorocut/beads/1", [](const auto& file) { return reportOrError(readBeadLayout(file)); }},
        {"fluorocut/implant/1", infoOfImplant},
        {"fluorocut/tool-path/1", [](const auto& file) { return reportOrError(readToolPath(file)); }},
        {"fluorocut/registration/1", [](const auto& file) { return reportOrError(readRegistration(file)); }},
        {"fluorocut/distortion/1", [](const auto& file) { return reportOrError(readDistortionMap(file)); }},
        {"fluorocut/distortion-set/1", [](const auto& file) { return reportOrError(readDistortionMapSet(file)); }},
    };
    return all;
}

}  // namespace

Result<Report> infoOfJson(const std::filesystem::path& file) {
    const Result<std::string> schema = jsonSchema(file);
    if (!schema) return schema.error();
    const auto reader = readers().find(*schema);
    if (reader != readers().end()) return reader->second(file);
    std::string known;
    for (const auto& [name, read] : readers())
        known += (known.empty() ? "" : ", ") + name;
    return invalidInput(file.string() + ", field schema", schema->empty() ? "nothing" : fmt::format("\"{}\"", *schema),
                        "one of " + known);
}

}  // namespace fluorocut::cli
