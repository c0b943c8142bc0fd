#include "core/procedure/setup_items.h"

#include <utility>

#include "core/distortion/distortion_map.h"
#include "core/io/mesh_file.h"
#include "core/io/volume_file.h"
#include "core/procedure/json_archive.h"

namespace fluorocut {

namespace fs = std::filesystem;

// What lies in the case in the place of the setup: numbers, and hashes of what is large.
struct StoredView {
    ProcedureView view;
    std::string distortion;  // hash; empty: none
};

struct StoredSetup {
    ProcedureSetup setup;
    std::vector<StoredView> views;
    std::string ct, implant, beads, corkscrew;
};

template <class Archive>
static void describe(Archive& json, Cutter& cutter) {
    json.number("radius_mm", cutter.radius_mm);
    json.number("length_mm", cutter.length_mm);
}

template <class Archive>
static void describe(Archive& json, ToolPathOptions& options) {
    json.object("cutter", options.cutter);
    json.number("step_down_mm", options.step_down_mm);
    json.number("step_over_mm", options.step_over_mm);
    json.number("most_cusp_mm", options.most_cusp_mm);
    json.number("tolerance_mm", options.tolerance_mm);
    json.number("clearance_mm", options.clearance_mm);
    json.number("most_tilt_rad", options.most_tilt_rad);  // bit for bit: an input of what is recomputed
    json.number("most_feed_mm_s", options.most_feed_mm_s);
    json.number("plunge_feed_mm_s", options.plunge_feed_mm_s);
    json.number("rapid_mm_s", options.rapid_mm_s);
    json.number("removal_rate_mm3_s", options.removal_rate_mm3_s);
}

template <class Archive>
static void describe(Archive& json, CavityOptions& options) {
    json.number("offset_mm", options.offset_mm);
    json.number("cutter_radius_mm", options.cutter_radius_mm);
    json.optional("top_mm", options.top_mm);
    json.number("spacing_mm", options.spacing_mm);
}

template <class Archive>
static void describe(Archive& json, ProcedurePlan& plan) {
    json.text("implant", plan.implant);
    json.rigid("femur_from_cavity", plan.femur_from_cavity);
    json.object("cavity", plan.cavity);
    json.object("path", plan.path);
    json.integer("stages", plan.stages);
    json.numbers("insets_mm", plan.insets_mm);
}

template <class Archive>
static void describe(Archive& json, ProcedureCalibration& calibration) {
    json.pose("flange_from_corkscrew", calibration.flange_from_corkscrew);
    json.rigid("flange_from_cutter", calibration.flange_from_cutter);
    json.number("focal_length_sigma_mm", calibration.focal_length_sigma_mm);
    json.number("image_centre_sigma_px", calibration.image_centre_sigma_px);
    json.number("bead_sigma_mm", calibration.bead_sigma_mm);
    json.number("corkscrew_sigma_mm", calibration.corkscrew_sigma_mm);
    json.number("local_distortion_mm", calibration.local_distortion_mm);
    json.number("robot_sigma_mm", calibration.robot_sigma_mm);
    json.number("robot_sigma_rad", calibration.robot_sigma_rad);
    json.number("location_sigma_mm", calibration.location_sigma_mm);
    json.number("location_sigma_rad", calibration.location_sigma_rad);
    json.number("location_sigma_roll_rad", calibration.location_sigma_roll_rad);
    json.text("calibrated_utc", calibration.calibrated_utc);
}

template <class Archive>
static void describe(Archive& json, ProcedureLimits& limits) {
    json.number("contained_probability", limits.contained_probability);
    json.number("envelope_delta_mm", limits.envelope_delta_mm);
    json.number("least_probability", limits.least_probability);
    json.number("most_view_turn_rad", limits.most_view_turn_rad);
}

template <class Archive>
static void describe(Archive& json, CArm& carm) {
    json.text("name", carm.name);
    json.integer("columns", carm.columns);
    json.integer("rows", carm.rows);
    json.vector("pixel_mm", carm.pixel_mm);
    json.number("focal_length_mm", carm.focal_length_mm);
    json.vector("principal_point_px", carm.principal_point_px);
}

template <class Archive>
static void describe(Archive& json, StoredView& stored) {
    json.text("name", stored.view.name);
    json.number("orbital_rad", stored.view.position.orbital_rad);
    json.number("angulation_rad", stored.view.position.angulation_rad);
    json.vector("isocentre_in_room_mm", stored.view.position.isocentre_in_room);
    json.object("carm", stored.view.carm);
    json.text("distortion", stored.distortion);
}

template <class Archive>
static void describe(Archive& json, StoredSetup& stored) {
    ProcedureSetup& setup = stored.setup;
    json.text("patient", setup.patient.name);
    json.text("side", setup.patient.side);
    json.text("ct", stored.ct);
    json.number("mu_water_per_mm", setup.patient.mu_water_per_mm);
    json.text("beads", stored.beads);
    json.text("implant_mesh", stored.implant);
    json.object("plan", setup.plan);
    json.text("corkscrew", stored.corkscrew);
    json.object("calibration", setup.calibration);
    json.object("limits", setup.limits);
    json.list("views", stored.views);
}

namespace {

constexpr const char* kSchema = "fluorocut/procedure-setup/1";

class Collector {
  public:
    // The hash of a file's bytes; empty, and failed, when it cannot be written.
    std::string add(const std::string& role, ItemKind kind, const std::string& schema, const std::string& file_name,
                    const std::function<Result<void>(const fs::path&)>& write) {
        if (!failed) return {};
        Result<std::string> bytes = bytesOf(file_name, write);
        if (!bytes) {
            failed = bytes.error();
            return {};
        }
        CaseContentItem made;
        made.item.kind = kind;
        made.item.schema = schema;
        made.item.file_name = file_name;
        made.bytes = std::move(*bytes);
        result.inputs.push_back({role, made.hash()});
        result.items.push_back(std::move(made));
        return result.inputs.back().hash;
    }

    Result<void> failed;
    SetupItems result;
};

template <class Read>
auto readItem(const ContentReader& content, const std::string& hash, const std::string& file_name, const Read& read)
    -> decltype(read(fs::path())) {
    const Result<std::string> bytes = content(hash);
    if (!bytes) return bytes.error();
    return readBytes(file_name, *bytes, read);
}

}  // namespace

Result<SetupItems> setupItems(const ProcedureSetup& setup) {
    if (auto good = setup.validate(); !good) return good.error();
    Collector to;
    StoredSetup stored;
    stored.setup = setup;
    if (setup.patient.ct) {
        stored.ct = to.add("ct", ItemKind::volume, "image/x-metaimage", "ct.mha",
                           [&](const fs::path& path) { return writeVolume(path, *setup.patient.ct); });
    }
    stored.implant = to.add("implant", ItemKind::mesh, "model/stl", "implant.stl",
                            [&](const fs::path& path) { return writeMesh(path, setup.plan.mesh); });
    stored.beads = to.add("beads", ItemKind::calibration, "fluorocut/beads/1", "beads.json",
                          [&](const fs::path& path) { return writeBeadLayout(path, setup.patient.beads); });
    stored.corkscrew = to.add("corkscrew", ItemKind::calibration, "fluorocut/corkscrew/1", "corkscrew.json",
                              [&](const fs::path& path) { return writeCorkscrew(path, setup.calibration.corkscrew); });
    for (const ProcedureView& view : setup.views) {
        std::string distortion;
        if (view.carm.distortion) {
            const DistortionMap* map = mapOf(*view.carm.distortion);  // validate() has seen to it that there is one
            distortion = to.add("distortion of " + view.name, ItemKind::calibration, "fluorocut/distortion/1",
                                "distortion_" + view.name + ".json",
                                [&](const fs::path& path) { return writeDistortionMap(path, *map); });
        }
        stored.views.push_back({view, distortion});
    }
    if (!to.failed) return to.failed.error();
    JsonWriter writer;
    writer.json["schema"] = kSchema;
    describe(writer, stored);
    CaseContentItem made;
    made.item.kind = ItemKind::plan;
    made.item.schema = kSchema;
    made.item.file_name = "setup.json";
    made.bytes = writer.json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
    to.result.items.push_back(std::move(made));
    return std::move(to.result);
}

Result<ProcedureSetup> readSetup(std::string_view text, const ContentReader& content) {
    Result<JsonObject> file = parseJson(text, "setup.json", kSchema);
    if (!file) return file.error();
    JsonReader reader(*file);
    StoredSetup stored;
    describe(reader, stored);
    if (auto read = reader.json.finish(); !read) return read.error();
    ProcedureSetup& setup = stored.setup;
    if (!stored.ct.empty()) {
        Result<VolumeFile> ct =
            readItem(content, stored.ct, "ct.mha", [](const fs::path& path) { return readVolume(path); });
        if (!ct) return ct.error();
        setup.patient.ct = std::make_shared<const Volume>(std::move(ct->volume));
    }
    Result<MeshFile> mesh =
        readItem(content, stored.implant, "implant.stl", [](const fs::path& path) { return readMesh(path); });
    if (!mesh) return mesh.error();
    setup.plan.mesh = std::move(mesh->mesh);
    Result<BeadLayout> beads = readItem(content, stored.beads, "beads.json", readBeadLayout);
    if (!beads) return beads.error();
    setup.patient.beads = std::move(*beads);
    Result<CorkscrewLayout> corkscrew = readItem(content, stored.corkscrew, "corkscrew.json", readCorkscrew);
    if (!corkscrew) return corkscrew.error();
    setup.calibration.corkscrew = std::move(*corkscrew);
    for (StoredView& one : stored.views) {
        ProcedureView& view = one.view;
        if (!one.distortion.empty()) {
            const Result<DistortionMap> map =
                readItem(content, one.distortion, "distortion_" + view.name + ".json", readDistortionMap);
            if (!map) return map.error();
            Result<std::shared_ptr<const Distortion>> distortion = distortionOf(*map, view.carm);
            if (!distortion) return distortion.error();
            view.carm.distortion = std::move(*distortion);
        }
        setup.views.push_back(std::move(view));
    }
    if (auto good = setup.validate(); !good) return good.error();
    return std::move(setup);
}

}  // namespace fluorocut
