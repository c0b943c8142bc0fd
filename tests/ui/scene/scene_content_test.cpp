#include "ui/scene/scene_content.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "core/geometry/primitives.h"
#include "core/imaging/standard_views.h"

namespace fluorocut::ui {
namespace {

std::size_t count(const Scene& scene, SceneKind kind) {
    return static_cast<std::size_t>(std::count_if(scene.items.begin(), scene.items.end(),
                                                  [&](const SceneItem& item) { return item.kind == kind; }));
}

std::vector<SceneItem> of(const Scene& scene, SceneKind kind) {
    std::vector<SceneItem> items;
    for (const SceneItem& item : scene.items)
        if (item.kind == kind) items.push_back(item);
    return items;
}

std::shared_ptr<const TriangleMesh> box(double size_mm) {
    return std::make_shared<const TriangleMesh>(makeBox(Vector3::Constant(size_mm)));
}

CaseView view(const std::string& name, const Rigid3& imager_from_femur) {
    CaseView made;
    made.name = name;
    made.carm = standardCArm();
    made.before.image = std::make_shared<const Image>(made.carm.columns, made.carm.rows, 100.0F);
    made.before.imager_from_femur = Pose{Frame::imager, Frame::femur, imager_from_femur, std::nullopt};
    return made;
}

// Enlarges by a tenth, and turns.
class Turned : public Distortion {
  public:
    Vector2 distorted(const Vector2& p) const override { return 1.1 * (Eigen::Rotation2Dd(0.1) * p); }
    Vector2 undistorted(const Vector2& p) const override { return Eigen::Rotation2Dd(-0.1) * p / 1.1; }
};

CaseState everything() {
    CaseState state;
    state.views = {view("AP", standardView(StandardView::ap, {1, 2, 3}, 700)),
                   view("Lateral", standardView(StandardView::lateral, {1, 2, 3}, 650))};
    state.plan.mesh = box(10);
    state.plan.femur_from_implant = Rigid3::fromTranslation({4, 5, 6}) * Rigid3::fromRotationVector({0.1, 0.2, 0.3});
    state.plan.cavities = {box(6), box(8), box(10)};
    state.plan.tool_path = std::make_shared<const std::vector<Vector3>>(std::vector<Vector3>{{0, 0, 0}, {0, 0, 5}});
    state.femur_from_cutter = Rigid3::fromTranslation({7, 8, 9});
    return state;
}

TEST(SceneContent, AnEmptyCaseIsAnEmptyScene) {
    const Scene scene = SceneBuilder().build({});
    EXPECT_TRUE(scene.items.empty());
    EXPECT_TRUE(scene.labels.empty());
}

TEST(SceneContent, EverythingIsInItsPlace) {
    const CaseState state = everything();
    const Scene scene = SceneBuilder().build(state);
    EXPECT_EQ(count(scene, SceneKind::implant), 1u);
    EXPECT_EQ(count(scene, SceneKind::cavities), 3u);
    EXPECT_EQ(count(scene, SceneKind::path), 1u);
    EXPECT_EQ(count(scene, SceneKind::robot), 2u);
    EXPECT_EQ(count(scene, SceneKind::views), 2 * 4u);  // image, cone, border, source
    EXPECT_EQ(count(scene, SceneKind::bone), 0u);
    ASSERT_EQ(scene.labels.size(), 2u);
    EXPECT_EQ(scene.labels[1].text, "Lateral");
    for (const SceneKind kind : {SceneKind::implant, SceneKind::cavities, SceneKind::path})
        for (const SceneItem& item : of(scene, kind))
            EXPECT_EQ(item.femur_from_item.matrix(), state.plan.femur_from_implant.matrix());
    for (const SceneItem& item : of(scene, SceneKind::robot))
        EXPECT_EQ(item.femur_from_item.matrix(), state.femur_from_cutter->matrix());
    for (const SceneItem& item : scene.items)
        EXPECT_GT(item.radius_mm, 0);
}

TEST(SceneContent, CavitiesAreGlassFromTheInsideOutAndTheImplantIsSolid) {
    const Scene scene = SceneBuilder().build(everything());
    EXPECT_TRUE(of(scene, SceneKind::implant).front().isOpaque());
    double radius = 0;
    for (const SceneItem& cavity : of(scene, SceneKind::cavities)) {
        EXPECT_FALSE(cavity.isOpaque());
        EXPECT_GT(cavity.radius_mm, radius);
        radius = cavity.radius_mm;
    }
}

TEST(SceneContent, TheDetectorsCornersAreWhereTheCArmSeesItsPixelsCorners) {
    CaseState state = everything();
    state.views[1].carm.distortion = std::make_shared<const Turned>();
    const Scene scene = SceneBuilder().build(state);
    const auto items = of(scene, SceneKind::views);
    for (std::size_t i = 0; i < state.views.size(); ++i) {
        const CArm& carm = state.views[i].carm;
        const Rigid3 imager_from_femur = state.views[i].before.imager_from_femur->target_from_source;
        const SceneItem& detector = items[4 * i];
        const SceneItem& cone = items[4 * i + 1];
        ASSERT_TRUE(detector.picture);
        // Every vertex, seen by the C-arm, is the pixel that the picture has there; it lies in the detector's plane.
        for (std::size_t v = 0; v < detector.surface->vertices.size(); ++v) {
            const Vector3 in_imager = imager_from_femur * (detector.femur_from_item * detector.surface->vertices[v]);
            const Vector2 pixel = carm.project(in_imager);
            const Vector2& place = detector.picture->places[v];
            EXPECT_NEAR(pixel.x(), place.x() * carm.columns - 0.5, 1e-9);
            EXPECT_NEAR(pixel.y(), place.y() * carm.rows - 0.5, 1e-9);
            EXPECT_NEAR(in_imager.z(), carm.focal_length_mm, 1e-9);
        }
        // Its front is toward the source.
        const auto at = [&](std::size_t k) {
            return detector.surface->vertices[static_cast<std::size_t>(detector.surface->triangles[0][k])];
        };
        EXPECT_LT((at(1) - at(0)).cross(at(2) - at(0)).dot(at(0)), 0);
        // Four edges, each from the source to a corner.
        ASSERT_EQ(cone.lines->size(), 4u);
        const Vector2 corners[] = {
            {-0.5, -0.5}, {carm.columns - 0.5, -0.5}, {carm.columns - 0.5, carm.rows - 0.5}, {-0.5, carm.rows - 0.5}};
        for (std::size_t k = 0; k < 4; ++k) {
            const auto& edge = (*cone.lines)[k];
            EXPECT_NEAR((imager_from_femur * (cone.femur_from_item * edge.front())).norm(), 0, 1e-9);
            const Vector2 end = carm.project(imager_from_femur * (cone.femur_from_item * edge.back()));
            EXPECT_NEAR((end - corners[k]).norm(), 0, 1e-9);
        }
        // Its name stands over the middle of the upper edge.
        const Vector2 name = carm.project(imager_from_femur * scene.labels[i].at);
        EXPECT_NEAR((name - Vector2(0.5 * (carm.columns - 1), -0.5)).norm(), 0, 1e-9);
    }
}

TEST(SceneContent, TheLatestImageWithAPoseIsShown) {
    CaseState state;
    state.views = {view("AP", standardView(StandardView::ap, {0, 0, 0}, 700))};
    TakenImage after = view("", standardView(StandardView::ap, {0, 0, 30}, 600)).before;
    TakenImage lost = after;
    lost.imager_from_femur.reset();
    state.views[0].after = {after, lost};
    const Scene scene = SceneBuilder().build(state);
    ASSERT_EQ(count(scene, SceneKind::views), 4u);
    EXPECT_NEAR(
        (scene.items[0].femur_from_item.matrix() - after.imager_from_femur->target_from_source.inverse().matrix())
            .norm(),
        0, 1e-12);
    state.views[0].after.clear();
    state.views[0].before.imager_from_femur.reset();
    EXPECT_TRUE(SceneBuilder().build(state).items.empty());
}

TEST(SceneContent, WhatIsUnchangedIsNotMadeAnew) {
    SceneBuilder builder;
    CaseState state = everything();
    const Scene first = builder.build(state);
    state.plan.femur_from_implant = Rigid3::fromTranslation({1, 1, 1}) * state.plan.femur_from_implant;
    const Scene moved = builder.build(state);
    ASSERT_EQ(moved.items.size(), first.items.size());
    for (std::size_t i = 0; i < first.items.size(); ++i) {
        const SceneKind kind = first.items[i].kind;
        if (kind == SceneKind::implant || kind == SceneKind::cavities) {
            EXPECT_EQ(moved.items[i].surface, first.items[i].surface);
            EXPECT_NE(moved.items[i].femur_from_item.translation(), first.items[i].femur_from_item.translation());
        }
        if (kind == SceneKind::views) {
            EXPECT_EQ(moved.items[i].surface, first.items[i].surface);
            EXPECT_EQ(moved.items[i].picture, first.items[i].picture);
            EXPECT_EQ(moved.items[i].lines, first.items[i].lines);
        }
    }
    // Another mesh is another surface.
    state.plan.mesh = box(12);
    const Scene other = builder.build(state);
    EXPECT_NE(of(other, SceneKind::implant)[0].surface, of(first, SceneKind::implant)[0].surface);
}

TEST(SceneContent, TheBoneBelongsToItsCt) {
    VolumeGrid grid;
    grid.size = {40, 40, 40};
    Volume ct(grid);
    for (int k = 0; k < 40; ++k)
        for (int j = 0; j < 40; ++j)
            for (int i = 0; i < 40; ++i)
                ct(i, j, k) = (Vector3(i, j, k) - Vector3::Constant(19.5)).norm() < 12 ? 1000.0F : 0.0F;
    CaseState state;
    state.ct = std::make_shared<const Volume>(ct);
    SceneBuilder builder;
    EXPECT_FALSE(builder.hasBone(state.ct));
    EXPECT_EQ(count(builder.build(state), SceneKind::bone), 0u);
    const auto surface = boneOf(*state.ct, Progress::none());
    ASSERT_TRUE(surface);
    builder.setBone(state.ct, *surface);
    const Scene scene = builder.build(state);
    ASSERT_EQ(count(scene, SceneKind::bone), 1u);
    EXPECT_FALSE(scene.items[0].isOpaque());
    EXPECT_NEAR((scene.items[0].middle - Vector3::Constant(19.5)).norm(), 0, 1);
    EXPECT_NEAR(scene.items[0].radius_mm, 12, 2);  // voxels of 2 mm
    // Another CT's bone is another's.
    state.ct = std::make_shared<const Volume>(ct);
    EXPECT_EQ(count(builder.build(state), SceneKind::bone), 0u);
    EXPECT_FALSE(*boneOf(Volume(grid, 0.0F), Progress::none()));
}

TEST(SceneBall, HoldsEverythingWhereItIs) {
    SceneItem a, b;
    a.lines = b.lines = std::make_shared<const SceneLines>(SceneLines{{{-5, 0, 0}, {5, 0, 0}}});
    measure(a);
    measure(b);
    EXPECT_DOUBLE_EQ(a.radius_mm, 5);
    b.femur_from_item = Rigid3::fromTranslation({100, 0, 0});
    const SceneBall ball = ballAround({a, b});
    EXPECT_NEAR((ball.middle - Vector3(50, 0, 0)).norm(), 0, 1e-12);
    EXPECT_NEAR(ball.radius_mm, 55, 1e-12);
    EXPECT_EQ(ballAround({}).radius_mm, 0);
}

}  // namespace
}  // namespace fluorocut::ui
