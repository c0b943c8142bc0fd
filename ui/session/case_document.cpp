#include "ui/session/case_document.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <fstream>
#include <functional>
#include <string_view>
#include <utility>

#include <unistd.h>

#include "core/casestore/content.h"
#include "core/casestore/sha256.h"
#include "core/io/json_file.h"
#include "core/io/json_values.h"
#include "core/io/mesh_file.h"
#include "core/io/pose_file.h"
#include "core/io/volume_file.h"

namespace fluorocut::ui {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

namespace {

constexpr std::string_view kSchema = "fluorocut/desktop/1";
constexpr std::array<std::string_view, 2> kMeasures{"length", "angle"};
constexpr int kMostPixels = 16384;

Json orNull(double value) {
    return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json jsonOf(const Pose& pose) {
    Json json{{"target", name(pose.target)},
              {"source", name(pose.source)},
              {"matrix", rowsOf(pose.target_from_source.matrix())}};
    json["covariance"] = pose.covariance ? rowsOf(*pose.covariance) : Json(nullptr);
    return json;
}

Pose poseFrom(JsonObject json) {
    Pose pose;
    for (auto [field, frame] : {std::pair{"target", &pose.target}, {"source", &pose.source}}) {
        const std::string text = json.text(field);
        if (const std::optional<Frame> known = frameFromName(text))
            *frame = *known;
        else
            json.fail(field, "\"" + text + "\"", "a frame, such as imager or femur");
    }
    pose.target_from_source = json.rigid("matrix");
    pose.covariance = readCovariance(json, "covariance");
    return pose;
}

// x, y, z of one point after the other.
Json pointsOf(const std::vector<Vector3>& points) {
    Json json = Json::array();
    for (const Vector3& point : points)
        json.insert(json.end(), {point.x(), point.y(), point.z()});
    return json;
}

std::vector<Vector3> pointsFrom(JsonObject& json, const char* field) {
    const std::vector<double> numbers = json.numbers(field);
    if (numbers.size() % 3 != 0) json.fail(field, std::to_string(numbers.size()) + " numbers", "three for each point");
    std::vector<Vector3> points;
    for (std::size_t i = 0; i + 2 < numbers.size(); i += 3)
        points.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
    return points;
}

Json jsonOf(const CArm& carm) {
    return {{"name", carm.name},
            {"columns", carm.columns},
            {"rows", carm.rows},
            {"pixel_mm", arrayOf(carm.pixel_mm)},
            {"focal_length_mm", carm.focal_length_mm},
            {"principal_point_px", arrayOf(carm.principal_point_px)}};
}

CArm carmFrom(JsonObject json) {
    CArm carm;
    carm.name = json.text("name");
    carm.columns = json.integer("columns", 1, kMostPixels);
    carm.rows = json.integer("rows", 1, kMostPixels);
    carm.pixel_mm = json.vector<2>("pixel_mm");
    carm.focal_length_mm = json.number("focal_length_mm");
    carm.principal_point_px = json.vector<2>("principal_point_px");
    if (!json.failed())
        if (const Result<void> good = carm.validate(); !good)
            json.fail(good.error().where, good.error().found, good.error().expected);
    return carm;
}

// Binary PLY of doubles: STL would round. Read by core/io/mesh_file.h.
std::string bytesOf(const TriangleMesh& mesh) {
    static_assert(std::endian::native == std::endian::little);
    std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(mesh.vertices.size()) +
                        "\nproperty double x\nproperty double y\nproperty double z\nelement face " +
                        std::to_string(mesh.triangles.size()) +
                        "\nproperty list uchar int vertex_indices\nend_header\n";
    const auto append = [&bytes](const void* data, std::size_t size) {
        bytes.append(static_cast<const char*>(data), size);
    };
    for (const Vector3& vertex : mesh.vertices)
        append(vertex.data(), 3 * sizeof(double));
    for (const Triangle& triangle : mesh.triangles) {
        bytes.push_back(3);
        append(triangle.data(), 3 * sizeof(std::int32_t));
    }
    return bytes;
}

Result<CaseContentItem> itemOf(const std::string& name, const TriangleMesh& mesh) {
    return CaseContentItem{{.kind = ItemKind::mesh, .schema = "model/ply", .file_name = name + ".ply"}, bytesOf(mesh)};
}

Result<CaseContentItem> itemOf(const std::string& name, const Volume& volume) {
    const std::string file_name = name + ".mha";
    Result<std::string> bytes =
        fluorocut::bytesOf(file_name, [&](const fs::path& path) -> Result<void> { return writeVolume(path, volume); });
    if (!bytes) return bytes.error();
    return CaseContentItem{{.kind = ItemKind::volume, .schema = "image/x-metaimage", .file_name = file_name},
                           std::move(*bytes)};
}

Result<CaseContentItem> itemOf(const std::string& name, const Image& image) {
    return imageItem(name, image);
}

}  // namespace

// Puts into the store what a state refers to, and gives its name there. The first failure stays.
class CaseWriter::Naming {
  public:
    explicit Naming(CaseWriter& writer) : writer_(writer) {}

    template <class T>
    Json hash(const std::string& name, const std::shared_ptr<const T>& object) {
        if (!object || failure_) return nullptr;
        auto& [alive, hash] = writer_.known_[object.get()];
        if (!alive.expired() && writer_.held_.contains(hash)) return hash;
        Result<CaseContentItem> made = itemOf(name, *object);
        if (!made) return fail(made.error());
        std::string digest = sha256(made->bytes);
        if (!writer_.held_.contains(digest)) {
            const Result<Item> added = writer_.store_.addItem(made->item, made->bytes);
            if (!added) return fail(added.error());
            writer_.held_.insert(digest);
        }
        alive = object;
        hash = std::move(digest);
        return hash;
    }

    Json image(const std::string& name, const TakenImage& taken) {
        Json json{{"image", hash(name, taken.image)}};
        json["pose"] = taken.imager_from_femur ? jsonOf(*taken.imager_from_femur) : Json(nullptr);
        json["unregistered_because"] = taken.unregistered_because;
        json["registration_mm"] = orNull(taken.registration_mm);
        json["corkscrew_pose"] = taken.imager_from_corkscrew ? jsonOf(*taken.imager_from_corkscrew) : Json(nullptr);
        return json;
    }

    Json implant(const std::shared_ptr<const Implant>& implant) {
        if (!implant) return nullptr;
        Json json{{"family", implant->family},
                  {"size", implant->size},
                  {"side", name(implant->side)},
                  {"parts", Json::array()},
                  {"in_bone", hash("implant_in_bone", std::shared_ptr<const TriangleMesh>(implant, &implant->in_bone))},
                  {"head_radius_mm", orNull(implant->head_radius_mm)},
                  {"resection_z_mm", implant->resection_z_mm},
                  {"stem_length_mm", implant->stem_length_mm}};
        json["head_center"] = implant->head_center.allFinite() ? arrayOf(implant->head_center) : Json(nullptr);
        for (const ImplantPart& part : implant->parts) {
            json["parts"].push_back(
                {{"name", part.name},
                 {"material", name(part.material)},
                 {"mesh", hash("implant_part", std::shared_ptr<const TriangleMesh>(implant, &part.mesh))}});
        }
        return json;
    }

    Json view(std::size_t number, const CaseView& view) {
        if (view.carm.distortion) {
            fail(invalidInput("view " + view.name, "a C-arm with a distortion map",
                              "one without: the case file cannot hold it yet", "straighten the images first"));
        }
        const std::string name = "view" + std::to_string(number + 1);
        Json json{{"name", view.name},
                  {"orbital_rad", view.position.orbital_rad},
                  {"angulation_rad", view.position.angulation_rad},
                  {"isocentre_in_room", arrayOf(view.position.isocentre_in_room)},
                  {"carm", jsonOf(view.carm)},
                  {"before", image(name + "_before", view.before)},
                  {"after", Json::array()}};
        for (std::size_t cut = 0; cut < view.after.size(); ++cut)
            json["after"].push_back(image(name + "_after" + std::to_string(cut + 1), view.after[cut]));
        return json;
    }

    const std::optional<Error>& failure() const { return failure_; }

  private:
    Json fail(const Error& error) {
        if (!failure_) failure_ = error;
        return nullptr;
    }

    CaseWriter& writer_;
    std::optional<Error> failure_;
};

Result<CaseWriter> CaseWriter::create(const fs::path& path, const std::string& label) {
    Result<CaseStore> store = CaseStore::create(path, label.empty() ? "case" : label);
    if (!store) return store.error();
    return CaseWriter(std::move(*store));
}

Result<CaseWriter> CaseWriter::append(const fs::path& path) {
    Result<CaseStore> store = CaseStore::open(path, CaseStore::Access::write);
    if (!store) return store.error();
    const Result<CaseContent> content = store->content();
    if (!content) return content.error();
    CaseWriter writer(std::move(*store));
    for (const Item& item : content->items)
        writer.held_.insert(item.hash);
    return writer;
}

Result<void> CaseWriter::write(const CaseState& state, const std::string& edit) {
    std::erase_if(known_, [](const auto& entry) { return entry.second.first.expired(); });
    Naming naming(*this);
    Json json{{"schema", kSchema},
              {"edit", edit},
              {"patient", state.patient},
              {"side", state.side},
              {"calibrated_utc", state.calibrated_utc},
              {"ct", naming.hash("ct", state.ct)},
              {"mu_water_per_mm", state.mu_water_per_mm},
              {"canal", nullptr},
              {"beads", pointsOf(state.beads)},
              {"corkscrew", Json::array()},
              {"views", Json::array()}};
    if (state.canal) json["canal"] = pointsOf({state.canal->distal, state.canal->proximal});
    for (const std::vector<Vector3>& wire : state.corkscrew)
        json["corkscrew"].push_back({{"points", pointsOf(wire)}});
    for (std::size_t i = 0; i < state.views.size(); ++i)
        json["views"].push_back(naming.view(i, state.views[i]));
    const ImplantPlan& plan = state.plan;
    json["plan"] = {{"family", plan.family},
                    {"size", plan.size},
                    {"head_mm", plan.head_mm},
                    {"neck_mm", plan.neck_mm},
                    {"implant", naming.implant(plan.implant)},
                    {"locked", plan.locked},
                    {"mesh", naming.hash("implant", plan.mesh)},
                    {"femur_from_implant", rowsOf(plan.femur_from_implant.matrix())},
                    {"cutter_radius_mm", plan.cutter_radius_mm},
                    {"insets_mm", plan.insets_mm},
                    {"cavities", Json::array()}};
    for (std::size_t i = 0; i < plan.cavities.size(); ++i)
        json["plan"]["cavities"].push_back(naming.hash("cavity" + std::to_string(i + 1), plan.cavities[i]));
    json["plan"]["tool_path"] = plan.tool_path ? pointsOf(*plan.tool_path) : Json(nullptr);
    json["measures"] = Json::array();
    for (const PlacedMeasure& measure : state.measures) {
        Json points = Json::array();
        for (const Vector2& point : measure.points_px) {
            points.push_back(point.x());
            points.push_back(point.y());
        }
        json["measures"].push_back({{"kind", kMeasures.at(static_cast<std::size_t>(measure.kind))},
                                    {"view", measure.view},
                                    {"points_px", std::move(points)}});
    }
    json["head_center"] = Json::array();
    for (const SeenPoint& point : state.head_center)
        json["head_center"].push_back({{"view", point.view}, {"at_px", arrayOf(point.at_px)}});
    json["found_cavities"] = Json::array();
    for (const Pose& pose : state.found_cavities)
        json["found_cavities"].push_back(jsonOf(pose));
    json["femur_from_cutter"] = state.femur_from_cutter ? rowsOf(state.femur_from_cutter->matrix()) : Json(nullptr);
    if (naming.failure()) return *naming.failure();

    const Item document{.kind = ItemKind::plan, .schema = std::string(kSchema), .file_name = "desktop.json"};
    // Text that is no UTF-8 (a patient's name from a file) must not throw.
    const std::string text = json.dump(1, ' ', false, Json::error_handler_t::replace);
    if (const Result<Item> added = store_.addItem(document, text); !added) return added.error();
    return {};
}

namespace {

// What a document refers to, each read once.
class Contents {
  public:
    Contents(const CaseStore& store, std::map<std::string, std::string> file_names)
        : store_(store), file_names_(std::move(file_names)) {}

    template <class T>
    std::shared_ptr<const T> find(JsonObject& json, const std::string& field, const std::string& hash) {
        auto& kept = read_[hash];
        if (!kept) {
            Result<std::string> bytes = store_.bytes(hash);
            Result<std::shared_ptr<const T>> object = bytes ? read<T>(file_names_[hash], *bytes) : bytes.error();
            if (!object) {
                json.fail(field, object.error().message(), "content of this case");
                return nullptr;
            }
            kept = *object;
        }
        return std::static_pointer_cast<const T>(kept);
    }

    template <class T>
    std::shared_ptr<const T> optional(JsonObject& json, const std::string& field) {
        const std::optional<std::string> hash = json.optionalText(field);
        return hash ? find<T>(json, field, *hash) : nullptr;
    }

  private:
    template <class T>
    static Result<std::shared_ptr<const T>> read(const std::string& file_name, std::string_view bytes) {
        if constexpr (std::is_same_v<T, Image>) {
            Result<Image> image = imageFrom(file_name, bytes);
            if (!image) return image.error();
            return std::make_shared<const Image>(std::move(*image));
        } else if constexpr (std::is_same_v<T, Volume>) {
            auto file = readBytes(file_name, bytes, [](const fs::path& path) { return readVolume(path); });
            if (!file) return file.error();
            return std::make_shared<const Volume>(std::move(file->volume));
        } else {
            auto file = readBytes(file_name, bytes, [](const fs::path& path) {
                return readMesh(path, {.unit = LengthUnit::mm, .require_solid = false});
            });
            if (!file) return file.error();
            return std::make_shared<const TriangleMesh>(std::move(file->mesh));
        }
    }

    const CaseStore& store_;
    std::map<std::string, std::string> file_names_;  // by hash
    // By hash; one kind of thing each, as the document's fields say: a reader refuses bytes of another kind.
    std::map<std::string, std::shared_ptr<const void>> read_;
};

TakenImage takenFrom(JsonObject json, Contents& contents) {
    TakenImage taken;
    taken.image = contents.optional<Image>(json, "image");
    if (!json.isNull("pose")) taken.imager_from_femur = poseFrom(json.object("pose"));
    taken.unregistered_because = json.text("unregistered_because");
    taken.registration_mm = json.numberOr("registration_mm", std::numeric_limits<double>::quiet_NaN());
    if (!json.isNull("corkscrew_pose")) taken.imager_from_corkscrew = poseFrom(json.object("corkscrew_pose"));
    return taken;
}

CaseView viewFrom(JsonObject json, Contents& contents) {
    CaseView view;
    view.name = json.text("name");
    view.position.orbital_rad = json.number("orbital_rad");
    view.position.angulation_rad = json.number("angulation_rad");
    view.position.isocentre_in_room = json.vector<3>("isocentre_in_room");
    view.carm = carmFrom(json.object("carm"));
    view.before = takenFrom(json.object("before"), contents);
    for (JsonObject& after : json.objects("after"))
        view.after.push_back(takenFrom(after, contents));
    return view;
}

std::shared_ptr<const Implant> implantFrom(JsonObject json, Contents& contents) {
    static constexpr std::array kSides{Side::left, Side::right};
    const auto meshOf = [&contents](JsonObject& owner, const char* field) {
        const std::shared_ptr<const TriangleMesh> mesh = contents.optional<TriangleMesh>(owner, field);
        return mesh ? *mesh : TriangleMesh();
    };
    auto implant = std::make_shared<Implant>();
    implant->family = json.text("family");
    implant->size = json.text("size");
    implant->side = kSides.at(json.choice("side", {name(kSides[0]), name(kSides[1])}));
    for (JsonObject& part : json.objects("parts")) {
        const std::string material = part.text("material");
        const std::optional<Material> known = materialFromName(material);
        if (!known) part.fail("material", "\"" + material + "\"", "a material, such as titanium");
        implant->parts.push_back({part.text("name"), known.value_or(Material::titanium), meshOf(part, "mesh")});
    }
    implant->in_bone = meshOf(json, "in_bone");
    if (!json.isNull("head_center")) implant->head_center = json.vector<3>("head_center");
    implant->head_radius_mm = json.numberOr("head_radius_mm", std::numeric_limits<double>::quiet_NaN());
    implant->resection_z_mm = json.number("resection_z_mm");
    implant->stem_length_mm = json.number("stem_length_mm");
    return implant;
}

ImplantPlan planFrom(JsonObject json, Contents& contents) {
    ImplantPlan plan;
    plan.family = json.text("family");
    plan.size = json.text("size");
    plan.head_mm = json.number("head_mm");
    plan.neck_mm = json.number("neck_mm");
    if (!json.isNull("implant")) plan.implant = implantFrom(json.object("implant"), contents);
    plan.locked = json.boolean("locked");
    plan.mesh = contents.optional<TriangleMesh>(json, "mesh");
    plan.femur_from_implant = json.rigid("femur_from_implant");
    plan.cutter_radius_mm = json.number("cutter_radius_mm");
    plan.insets_mm = json.numbers("insets_mm");
    for (const std::string& hash : json.texts("cavities"))
        plan.cavities.push_back(contents.find<TriangleMesh>(json, "cavities", hash));
    if (!json.isNull("tool_path"))
        plan.tool_path = std::make_shared<const std::vector<Vector3>>(pointsFrom(json, "tool_path"));
    return plan;
}

PlacedMeasure measureFrom(JsonObject json, std::size_t views) {
    PlacedMeasure measure;
    measure.kind = static_cast<MeasureKind>(json.choice("kind", {kMeasures.begin(), kMeasures.end()}));
    measure.view = static_cast<std::size_t>(json.integer("view", 0, std::max(0, static_cast<int>(views) - 1)));
    const std::vector<double> numbers = json.numbers("points_px", measure.kind == MeasureKind::length ? 4U : 8U);
    for (std::size_t i = 0; i + 1 < numbers.size(); i += 2)
        measure.points_px.emplace_back(numbers[i], numbers[i + 1]);
    return measure;
}

}  // namespace

Result<CaseState> readCase(const fs::path& path, Progress& progress) {
    const Result<CaseStore> store = CaseStore::open(path, CaseStore::Access::read);
    if (!store) return store.error();
    const Result<CaseContent> content = store->content();
    if (!content) return content.error();
    const Item* newest = nullptr;
    std::map<std::string, std::string> file_names;
    for (const Item& item : content->items) {
        file_names.emplace(item.hash, item.file_name);
        if (item.schema == kSchema) newest = &item;
    }
    if (newest == nullptr)
        return invalidInput(path.string(), "a case that the desktop has not written to", "one that was saved by it");
    const Result<std::string> text = store->bytes(newest->hash);
    if (!text) return text.error();
    Result<JsonObject> parsed = parseJson(*text, path, kSchema);
    if (!parsed) return parsed.error();
    JsonObject& json = *parsed;

    Contents contents(*store, std::move(file_names));
    CaseState state;
    (void)json.text("edit");
    state.patient = json.text("patient");
    state.side = json.text("side");
    state.calibrated_utc = json.text("calibrated_utc");
    progress.report(0.1, "reading the CT");
    state.ct = contents.optional<Volume>(json, "ct");
    state.mu_water_per_mm = json.number("mu_water_per_mm");
    if (!json.isNull("canal")) {
        const std::vector<Vector3> ends = pointsFrom(json, "canal");
        if (ends.size() == 2)
            state.canal = CanalAxis{ends[0], ends[1]};
        else
            json.fail("canal", std::to_string(ends.size()) + " points", "two: distal, proximal");
    }
    state.beads = pointsFrom(json, "beads");
    for (JsonObject& wire : json.objects("corkscrew"))
        state.corkscrew.push_back(pointsFrom(wire, "points"));
    progress.report(0.6, "reading the images");
    for (JsonObject& view : json.objects("views")) {
        if (progress.isCancelled()) return cancelled(path.string());
        state.views.push_back(viewFrom(view, contents));
    }
    progress.report(0.9, "reading the plan");
    state.plan = planFrom(json.object("plan"), contents);
    for (JsonObject& measure : json.objects("measures"))
        state.measures.push_back(measureFrom(measure, state.views.size()));
    for (JsonObject& point : json.objects("head_center")) {
        SeenPoint seen;
        seen.view =
            static_cast<std::size_t>(point.integer("view", 0, std::max(0, static_cast<int>(state.views.size()) - 1)));
        seen.at_px = point.vector<2>("at_px");
        state.head_center.push_back(seen);
    }
    for (JsonObject& pose : json.objects("found_cavities"))
        state.found_cavities.push_back(poseFrom(pose));
    if (!json.isNull("femur_from_cutter")) state.femur_from_cutter = json.rigid("femur_from_cutter");
    if (const Result<void> read = json.finish(); !read) return read.error();
    return state;
}

Result<void> writeCase(const fs::path& path, const CaseState& state) {
    // Beside the target under a name of its own: SQLite's files and the lock come and go with it.
    const fs::path part = path.string() + ".part-" + std::to_string(getpid());
    const auto clean = [&part] {
        std::error_code ignored;
        for (const char* suffix : {"", "-wal", "-shm", ".lock"})
            fs::remove(part.string() + suffix, ignored);
    };
    clean();
    Result<void> written = [&]() -> Result<void> {
        Result<CaseWriter> writer = CaseWriter::create(part, state.patient);
        if (!writer) return writer.error();
        return writer->write(state, "");
    }();
    std::error_code failed;
    if (written) fs::rename(part, path, failed);
    clean();
    if (!written) return written;
    if (failed) return outputFailed(path.string(), failed.message(), "choose another place");
    return {};
}

bool looksLikeCase(const fs::path& path) {
    static constexpr std::string_view kMagic("SQLite format 3\0", 16);
    std::array<char, kMagic.size()> head{};
    std::ifstream stream(path, std::ios::binary);
    stream.read(head.data(), head.size());
    return stream && std::string_view(head.data(), head.size()) == kMagic;
}

}  // namespace fluorocut::ui
