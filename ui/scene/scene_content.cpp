#include "ui/scene/scene_content.h"

#include <algorithm>
#include <array>
#include <numbers>

#include "core/geometry/mesh_tools.h"
#include "core/geometry/primitives.h"
#include "core/image/bone_surface.h"
#include "ui/spreadsheet/gray_levels.h"
#include "ui/spreadsheet/overlay.h"

namespace fluorocut::ui {
namespace {

// What things are made of; lines and plans have the inks of the images' overlays.
constexpr QColor kBone(233, 222, 196), kSteel(176, 184, 192), kHousing(214, 219, 224), kHead(232, 234, 236);
constexpr QColor kConeEdge(92, 108, 124), kDetectorEdge(170, 186, 200);

SceneItem shape(std::shared_ptr<const ShadedMesh> surface) {
    SceneItem item;
    item.surface = std::move(surface);
    measure(item);
    return item;
}

SceneItem shape(const TriangleMesh& mesh) {
    return shape(std::make_shared<const ShadedMesh>(shadedMesh(mesh)));
}

SceneItem shape(SceneLines lines) {
    SceneItem item;
    item.lines = std::make_shared<const SceneLines>(std::move(lines));
    measure(item);
    return item;
}

// A cavity's mesh is finer than the eye needs, and in parts the implant's own surface: a little outside, the two can be
// told apart.
SceneItem cavityShape(const TriangleMesh& mesh) {
    constexpr std::size_t kMany = 40000;  // triangles
    constexpr double kCoarser_mm = 0.8, kOutward_mm = 0.2;
    ShadedMesh surface = shadedMesh(mesh.triangles.size() > kMany ? weldVertices(mesh, kCoarser_mm) : mesh);
    for (std::size_t i = 0; i < surface.vertices.size(); ++i)
        surface.vertices[i] += kOutward_mm * surface.normals[i];
    return shape(std::make_shared<const ShadedMesh>(std::move(surface)));
}

SceneItem placed(SceneItem item, SceneKind kind, const QColor& color, const Rigid3& femur_from_item) {
    item.kind = kind;
    item.color = color;
    item.femur_from_item = femur_from_item;
    return item;
}

// The last image whose pose is known.
const TakenImage* latestImage(const CaseView& view) {
    for (auto taken = view.after.rbegin(); taken != view.after.rend(); ++taken)
        if (taken->imager_from_femur) return &*taken;
    return view.before.imager_from_femur ? &view.before : nullptr;
}

// The detector's border in the imager frame, along the outer edges of its pixels, from the upper left corner to the
// right and round. With distortion the sides are curved.
std::vector<Vector3> detectorBorder(const CArm& carm, int pieces) {
    const double right = carm.columns - 0.5, bottom = carm.rows - 0.5;
    const std::array<Vector2, 5> corners{Vector2(-0.5, -0.5), Vector2(right, -0.5), Vector2(right, bottom),
                                         Vector2(-0.5, bottom), Vector2(-0.5, -0.5)};
    std::vector<Vector3> border;
    for (std::size_t side = 0; side < 4; ++side)
        for (int i = 0; i < pieces; ++i) {
            const double t = static_cast<double>(i) / pieces;
            border.push_back(carm.detectorPoint((1 - t) * corners[side] + t * corners[side + 1]));
        }
    border.push_back(border.front());
    return border;
}

// The detector as a grid of cells, each seen from the source; those outside of a distortion's map are left out.
SceneItem detector(const CArm& carm, const Image& image, int pieces) {
    auto surface = std::make_shared<ShadedMesh>();
    auto picture = std::make_shared<ScenePicture>();
    const GrayLevels levels(image);
    picture->image = levels.render(levels.fittingWindow());
    for (int row = 0; row <= pieces; ++row)
        for (int column = 0; column <= pieces; ++column) {
            const Vector2 place(static_cast<double>(column) / pieces, static_cast<double>(row) / pieces);
            const Vector2 pixel(place.x() * carm.columns - 0.5, place.y() * carm.rows - 0.5);
            surface->vertices.push_back(carm.detectorPoint(pixel));
            surface->normals.push_back(-Vector3::UnitZ());
            picture->places.push_back(place);
        }
    const auto known = [&](int vertex) { return surface->vertices[static_cast<std::size_t>(vertex)].allFinite(); };
    for (int row = 0; row < pieces; ++row)
        for (int column = 0; column < pieces; ++column) {
            const int a = row * (pieces + 1) + column, b = a + 1, d = a + pieces + 1, c = d + 1;
            if (!known(a) || !known(b) || !known(c) || !known(d)) continue;
            surface->triangles.push_back({a, d, c});
            surface->triangles.push_back({a, c, b});
        }
    for (Vector3& vertex : surface->vertices)
        if (!vertex.allFinite()) vertex.setZero();  // of no triangle
    SceneItem item = shape(std::move(surface));
    item.kind = SceneKind::views;
    item.picture = std::move(picture);
    item.one_sided = true;
    return item;
}

// The edges of the cone, from the source to the detector's corners, and the detector's border: lines that end where
// the distortion's map does.
std::array<SceneLines, 2> coneLines(const CArm& carm, int pieces) {
    const std::vector<Vector3> border = detectorBorder(carm, pieces);
    SceneLines edges, outline;
    std::vector<Vector3> run;
    for (std::size_t i = 0; i < border.size(); ++i) {
        const bool known = border[i].allFinite(), last = i + 1 == border.size();
        if (known) run.push_back(border[i]);
        if (known && !last && i % static_cast<std::size_t>(pieces) == 0) edges.push_back({Vector3::Zero(), border[i]});
        if (!known || last) {
            if (run.size() > 1) outline.push_back(run);
            run.clear();
        }
    }
    return {edges, outline};
}

bool sameImager(const CArm& a, const CArm& b) {
    return a.columns == b.columns && a.rows == b.rows && a.pixel_mm == b.pixel_mm &&
           a.focal_length_mm == b.focal_length_mm && a.principal_point_px == b.principal_point_px &&
           a.distortion == b.distortion;
}

// Detector with its image (if there is one), cone, border, source.
std::vector<SceneItem> viewItems(const CArm& carm, const std::shared_ptr<const Image>& image) {
    const int pieces = carm.distortion ? 24 : 1;
    std::vector<SceneItem> items;
    if (image && !image->empty()) items.push_back(detector(carm, *image, pieces));
    const auto [edges, outline] = coneLines(carm, pieces);
    items.push_back(placed(shape(edges), SceneKind::views, kConeEdge, {}));
    items.push_back(placed(shape(outline), SceneKind::views, kDetectorEdge, {}));
    items.back().width_px = 2;
    items.push_back(placed(shape(makeSphere(9, 3)), SceneKind::views, kDetectorEdge, {}));
    return items;
}

// Shapes of the cutter's own frame: the ball's centre at the origin, z along the spindle and out of the bone.
TriangleMesh along(const TriangleMesh& shape, double from_z_mm, double length_mm) {
    return transformed(shape, Rigid3::fromTranslation({0, 0, from_z_mm + 0.5 * length_mm}));
}

TriangleMesh cutterMesh(double radius_mm) {
    TriangleMesh mesh = makeSphere(radius_mm, 3);
    mesh = merged(std::move(mesh), along(makeCylinder(0.5 * radius_mm, 75, 24), 0, 75));
    return merged(std::move(mesh), along(makeFrustum(5, 9, 20, 32), 70, 20));
}

TriangleMesh handpieceMesh() {
    TriangleMesh mesh = along(makeCylinder(17, 95, 40), 90, 95);
    mesh = merged(std::move(mesh), along(makeCylinder(34, 14, 48), 185, 14));
    return merged(std::move(mesh), along(makeFrustum(34, 26, 60, 48), 199, 60));
}

}  // namespace

Result<std::shared_ptr<const ShadedMesh>> boneOf(const Volume& ct, Progress& progress) {
    const Result<TriangleMesh> surface = boneSurface(ct, {}, progress);
    if (!surface) return surface.error();
    if (surface->triangles.empty()) return std::shared_ptr<const ShadedMesh>();
    // Bone has no edges: noise between voxels must not look like some.
    return std::shared_ptr<const ShadedMesh>(std::make_shared<ShadedMesh>(shadedMesh(*surface, std::numbers::pi)));
}

template <class Source, class Made, class Make>
const Made& SceneBuilder::keep(Keep<Source, Made>& kept, const std::shared_ptr<const Source>& source,
                               const Make& make) {
    Kept<Source, Made>& entry = kept[source.get()];
    if (!entry.source) entry = {source, make(*source), true};
    entry.used = true;
    return entry.made;
}

void SceneBuilder::setBone(std::shared_ptr<const Volume> ct, std::shared_ptr<const ShadedMesh> surface) {
    ct_ = std::move(ct);
    bone_ = shape(std::move(surface));
}

Scene SceneBuilder::build(const CaseState& state) {
    const auto each = [this](const auto& visit) {
        visit(meshes_);
        visit(heads_);
        visit(paths_);
    };
    each([](auto& kept) {
        for (auto& [source, entry] : kept)
            entry.used = false;
    });
    for (KeptView& view : views_)
        view.used = false;

    Scene scene;
    for (const CaseView& view : state.views)
        addView(view, scene);
    addRobot(state, scene);
    addImplant(state.plan, scene);
    if (state.plan.tool_path && state.plan.tool_path->size() > 1) {
        const SceneItem& path = keep(paths_, state.plan.tool_path,
                                     [](const std::vector<Vector3>& points) { return shape(SceneLines{points}); });
        scene.items.push_back(placed(path, SceneKind::path, colorOf(Ink::found), state.plan.femur_from_implant));
    }
    // From the inside out, as translucent things have to be drawn.
    addCavities(state.plan, scene);
    if (state.ct && hasBone(state.ct) && bone_.surface) {
        SceneItem bone = placed(bone_, SceneKind::bone, kBone, {});
        bone.opacity = 0.2;
        bone.rim_opacity = 0.85;
        bone.ambient = 0.6;
        bone.one_sided = true;
        scene.items.push_back(std::move(bone));
    }

    each([](auto& kept) { std::erase_if(kept, [](const auto& entry) { return !entry.second.used; }); });
    std::erase_if(views_, [](const KeptView& view) { return !view.used; });
    return scene;
}

void SceneBuilder::addImplant(const ImplantPlan& plan, Scene& scene) {
    if (!plan.mesh) return;
    const SceneItem& stem = keep(meshes_, plan.mesh, [](const TriangleMesh& mesh) { return shape(mesh); });
    scene.items.push_back(placed(stem, SceneKind::implant, colorOf(Ink::implant), plan.femur_from_implant));
    scene.items.back().shine = 0.45;
    if (!plan.implant || plan.implant->parts.size() < 2) return;
    const SceneItem& rest = keep(heads_, plan.implant, [](const Implant& implant) {
        TriangleMesh parts;
        for (std::size_t i = 1; i < implant.parts.size(); ++i)
            parts = merged(std::move(parts), implant.parts[i].mesh);
        return shape(parts);
    });
    scene.items.push_back(placed(rest, SceneKind::implant, kHead, plan.femur_from_implant));
    scene.items.back().shine = 0.6;
}

void SceneBuilder::addCavities(const ImplantPlan& plan, Scene& scene) {
    // Insets fall: the first stage is the innermost.
    for (std::size_t stage = 0; stage < plan.cavities.size(); ++stage) {
        if (!plan.cavities[stage]) continue;
        const SceneItem& cavity = keep(meshes_, plan.cavities[stage], cavityShape);
        SceneItem item = placed(cavity, SceneKind::cavities, colorOf(Ink::stage), plan.femur_from_implant);
        const bool last = stage + 1 == plan.cavities.size();
        item.opacity = last ? 0.14 : 0.1;
        item.rim_opacity = last ? 0.75 : 0.5;
        item.ambient = 0.7;
        item.one_sided = true;
        scene.items.push_back(std::move(item));
    }
}

void SceneBuilder::addView(const CaseView& view, Scene& scene) {
    const TakenImage* taken = latestImage(view);
    if (!taken || !view.carm.validate()) return;
    auto kept = std::find_if(views_.begin(), views_.end(), [&](const KeptView& known) {
        return known.image == taken->image && sameImager(known.carm, view.carm);
    });
    if (kept == views_.end()) {
        kept = views_.insert(kept, {view.carm, taken->image, viewItems(view.carm, taken->image), true});
    }
    kept->used = true;
    const Rigid3 femur_from_imager = taken->imager_from_femur->target_from_source.inverse();
    for (SceneItem item : kept->items) {
        item.femur_from_item = femur_from_imager;
        scene.items.push_back(std::move(item));
    }
    const Vector3 above = view.carm.detectorPoint({0.5 * (view.carm.columns - 1), -0.5});
    if (above.allFinite()) {
        scene.labels.push_back({SceneKind::views, femur_from_imager * above, QString::fromStdString(view.name)});
    }
}

void SceneBuilder::addRobot(const CaseState& state, Scene& scene) {
    if (!state.femur_from_cutter) return;
    if (cutter_radius_mm_ != state.plan.cutter_radius_mm) {
        cutter_radius_mm_ = state.plan.cutter_radius_mm;
        cutter_ = shape(cutterMesh(cutter_radius_mm_));
    }
    static const SceneItem kHandpiece = shape(handpieceMesh());
    scene.items.push_back(placed(cutter_, SceneKind::robot, kSteel, *state.femur_from_cutter));
    scene.items.back().shine = 0.6;
    scene.items.push_back(placed(kHandpiece, SceneKind::robot, kHousing, *state.femur_from_cutter));
    scene.items.back().shine = 0.15;
}

}  // namespace fluorocut::ui
