#include "tests/ui/session/full_case.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/geometry/primitives.h"

namespace fluorocut::test {
namespace {

using namespace ui;

// Rotations are made orthonormal again when they are read: a few units in the last place.
constexpr double kPose = 1e-12;

Pose poseOf(double seed, Frame target, Frame source) {
    Pose pose{target, source, Rigid3::fromRotationVector({0.1 * seed, 0.2, -0.3}), std::nullopt};
    pose.target_from_source = Rigid3::fromTranslation({seed, 1.0 / 3, -700.123456789}) * pose.target_from_source;
    Matrix6 root = Matrix6::Identity() * 0.01;
    root(0, 3) = 0.003 * seed;
    pose.covariance = root * root.transpose();
    return pose;
}

std::shared_ptr<const Image> imageOf(float seed, bool whole) {
    Image image(7, 5);
    for (int y = 0; y < 5; ++y)
        for (int x = 0; x < 7; ++x)
            image(x, y) = whole ? seed * 1000.0F + static_cast<float>(7 * y + x)
                                : std::sin(seed + 0.1F * static_cast<float>(7 * y + x));
    return std::make_shared<const Image>(std::move(image));
}

std::shared_ptr<const TriangleMesh> meshOf(double size) {
    TriangleMesh mesh = makeBox(Vector3(size, size / 3, 2 * size));
    return std::make_shared<const TriangleMesh>(std::move(mesh));
}

void expectSame(const Rigid3& a, const Rigid3& b) {
    EXPECT_LT(a.deltaFrom(b).norm(), kPose);
}

void expectSame(const std::optional<Pose>& a, const std::optional<Pose>& b) {
    ASSERT_EQ(a.has_value(), b.has_value());
    if (!a) return;
    EXPECT_EQ(a->target, b->target);
    EXPECT_EQ(a->source, b->source);
    expectSame(a->target_from_source, b->target_from_source);
    ASSERT_EQ(a->covariance.has_value(), b->covariance.has_value());
    if (a->covariance) {
        EXPECT_LT((*a->covariance - *b->covariance).norm(), 1e-18);
    }
}

template <class T, class Same>
void expectSame(const std::shared_ptr<const T>& a, const std::shared_ptr<const T>& b, const Same& same) {
    ASSERT_EQ(a == nullptr, b == nullptr);
    if (a) {
        EXPECT_TRUE(same(*a, *b));
    }
}

// The same corners to the last bit, triangle by triangle; the vertices may be numbered otherwise.
bool sameMesh(const TriangleMesh& a, const TriangleMesh& b) {
    if (a.vertices.size() != b.vertices.size() || a.triangles.size() != b.triangles.size()) return false;
    for (std::size_t t = 0; t < a.triangles.size(); ++t)
        for (std::size_t c = 0; c < 3; ++c)
            if (a.vertices[static_cast<std::size_t>(a.triangles[t][c])] !=
                b.vertices[static_cast<std::size_t>(b.triangles[t][c])])
                return false;
    return true;
}

void expectSame(const TakenImage& a, const TakenImage& b) {
    expectSame(a.image, b.image, std::equal_to<>());
    expectSame(a.imager_from_femur, b.imager_from_femur);
    expectSame(a.imager_from_corkscrew, b.imager_from_corkscrew);
    EXPECT_EQ(a.unregistered_because, b.unregistered_because);
    EXPECT_EQ(a.registration_mm, b.registration_mm);
}

void expectSame(const ImplantPlan& a, const ImplantPlan& b) {
    EXPECT_EQ(a.family, b.family);
    EXPECT_EQ(a.size, b.size);
    EXPECT_EQ(a.head_mm, b.head_mm);
    EXPECT_EQ(a.neck_mm, b.neck_mm);
    EXPECT_EQ(a.locked, b.locked);
    EXPECT_EQ(a.cutter_radius_mm, b.cutter_radius_mm);
    EXPECT_EQ(a.insets_mm, b.insets_mm);
    expectSame(a.femur_from_implant, b.femur_from_implant);
    expectSame(a.mesh, b.mesh, sameMesh);
    expectSame(a.tool_path, b.tool_path, std::equal_to<>());
    ASSERT_EQ(a.cavities.size(), b.cavities.size());
    for (std::size_t i = 0; i < a.cavities.size(); ++i)
        expectSame(a.cavities[i], b.cavities[i], sameMesh);
    expectSame(a.implant, b.implant, [](const Implant& x, const Implant& y) {
        return x.family == y.family && x.size == y.size && x.side == y.side && x.parts.size() == y.parts.size() &&
               x.parts[0].name == y.parts[0].name && x.parts[0].material == y.parts[0].material &&
               sameMesh(x.parts[0].mesh, y.parts[0].mesh) && sameMesh(x.in_bone, y.in_bone) &&
               x.head_center == y.head_center && x.head_radius_mm == y.head_radius_mm &&
               x.resection_z_mm == y.resection_z_mm && x.stem_length_mm == y.stem_length_mm;
    });
}

}  // namespace

CaseState fullCase() {
    CaseState state;
    state.patient = "Müller, \"Anna\"";
    state.side = "left";
    state.calibrated_utc = "2026-03-01T09:30:00.125Z";
    VolumeGrid grid;
    grid.size = {4, 3, 2};
    grid.spacing_mm = {0.8, 0.8, 1.5};
    grid.origin_mm = {-12.25, 3.5, 100};
    Volume ct(grid, -1000.0F);
    for (std::size_t i = 0; i < ct.voxels().size(); ++i)
        ct.voxels()[i] = 0.37F * static_cast<float>(i) - 5;
    state.ct = std::make_shared<const Volume>(std::move(ct));
    state.mu_water_per_mm = 0.1 + 0.2;  // not a round number
    state.canal = CanalAxis{{1, 2, -100.5}, {1.0 / 3, 2, 20}};
    state.beads = {{1, 2, 3}, {4, 5, 1.0 / 7}};
    state.corkscrew = {{{0, 0, 0}, {1, 0, 0}}, {{0, 1, 0}, {0, 1, 1}, {0, 2, 1}}};
    for (int i = 0; i < 2; ++i) {
        CaseView view;
        view.name = i == 0 ? "AP" : "lateral";
        view.position = {0.5 * i, -0.1, {1, 2, 3.0 * i}};
        view.carm.name = "imager";
        view.carm.columns = 7;
        view.carm.rows = 5;
        view.carm.pixel_mm = {0.32, 0.33};
        view.carm.focal_length_mm = 987.6 + i;
        view.carm.principal_point_px = {3.1, 2.2};
        view.before.image = imageOf(1.0F + static_cast<float>(i), true);
        view.before.imager_from_femur = poseOf(1 + i, Frame::imager, Frame::femur);
        view.before.registration_mm = 0.12345678901234567;
        view.before.imager_from_corkscrew = poseOf(2 + i, Frame::imager, Frame::corkscrew);
        TakenImage after;
        after.image = imageOf(3.0F + static_cast<float>(i), false);
        after.unregistered_because = "its beads were not recognised";
        view.after = {after, TakenImage{}};
        state.views.push_back(std::move(view));
    }
    ImplantPlan& plan = state.plan;
    plan.family = "straight";
    plan.size = "12";
    plan.head_mm = 36;
    plan.neck_mm = -4;
    plan.locked = true;
    plan.mesh = meshOf(30);
    Implant implant;
    implant.family = "straight";
    implant.size = "12";
    implant.side = Side::right;
    implant.parts = {{"stem", Material::cobaltChrome, *plan.mesh}};
    implant.in_bone = *meshOf(20);
    implant.head_center = {40, 1.0 / 3, 31};
    implant.head_radius_mm = 18;
    implant.resection_z_mm = 0.5;
    implant.stem_length_mm = 120;
    plan.implant = std::make_shared<const Implant>(std::move(implant));
    plan.femur_from_implant = poseOf(5, Frame::femur, Frame::cavity).target_from_source;
    plan.cutter_radius_mm = 2.5;
    plan.insets_mm = {1.5, 0.75, 0};
    plan.cavities = {meshOf(10), meshOf(11), meshOf(12)};
    plan.tool_path = std::make_shared<const std::vector<Vector3>>(std::vector<Vector3>{{1, 2, 3}, {4, 5, 1.0 / 9}});
    state.femur_from_cutter = poseOf(8, Frame::femur, Frame::cutter).target_from_source;
    state.measures = {{MeasureKind::length, 1, {{1.5, 2.5}, {3.25, 1.0 / 3}}},
                      {MeasureKind::angle, 0, {{0, 0}, {1, 1}, {2, 0.5}, {3, 3}}}};
    state.head_center = {{1, {2.5, 3.5}}};
    state.found_cavities = {poseOf(7, Frame::femur, Frame::cavity)};
    return state;
}

void expectSame(const CaseState& a, const CaseState& b) {
    EXPECT_EQ(a.patient, b.patient);
    EXPECT_EQ(a.side, b.side);
    EXPECT_EQ(a.calibrated_utc, b.calibrated_utc);
    EXPECT_EQ(a.mu_water_per_mm, b.mu_water_per_mm);
    expectSame(a.ct, b.ct,
               [](const Volume& x, const Volume& y) { return x.grid() == y.grid() && x.voxels() == y.voxels(); });
    ASSERT_EQ(a.canal.has_value(), b.canal.has_value());
    if (a.canal) {
        EXPECT_TRUE(a.canal->distal == b.canal->distal && a.canal->proximal == b.canal->proximal);
    }
    EXPECT_EQ(a.beads, b.beads);
    EXPECT_EQ(a.corkscrew, b.corkscrew);
    ASSERT_EQ(a.views.size(), b.views.size());
    for (std::size_t i = 0; i < a.views.size(); ++i) {
        const CaseView &x = a.views[i], &y = b.views[i];
        EXPECT_EQ(x.name, y.name);
        EXPECT_EQ(x.position, y.position);
        EXPECT_EQ(x.carm.name, y.carm.name);
        EXPECT_EQ(x.carm.columns, y.carm.columns);
        EXPECT_EQ(x.carm.rows, y.carm.rows);
        EXPECT_EQ(x.carm.pixel_mm, y.carm.pixel_mm);
        EXPECT_EQ(x.carm.focal_length_mm, y.carm.focal_length_mm);
        EXPECT_EQ(x.carm.principal_point_px, y.carm.principal_point_px);
        expectSame(x.before, y.before);
        ASSERT_EQ(x.after.size(), y.after.size());
        for (std::size_t j = 0; j < x.after.size(); ++j)
            expectSame(x.after[j], y.after[j]);
    }
    expectSame(a.plan, b.plan);
    ASSERT_EQ(a.femur_from_cutter.has_value(), b.femur_from_cutter.has_value());
    if (a.femur_from_cutter) expectSame(*a.femur_from_cutter, *b.femur_from_cutter);
    ASSERT_EQ(a.measures.size(), b.measures.size());
    for (std::size_t i = 0; i < a.measures.size(); ++i) {
        EXPECT_EQ(a.measures[i].kind, b.measures[i].kind);
        EXPECT_EQ(a.measures[i].view, b.measures[i].view);
        EXPECT_EQ(a.measures[i].points_px, b.measures[i].points_px);
    }
    ASSERT_EQ(a.head_center.size(), b.head_center.size());
    for (std::size_t i = 0; i < a.head_center.size(); ++i) {
        EXPECT_EQ(a.head_center[i].view, b.head_center[i].view);
        EXPECT_EQ(a.head_center[i].at_px, b.head_center[i].at_px);
    }
    ASSERT_EQ(a.found_cavities.size(), b.found_cavities.size());
    for (std::size_t i = 0; i < a.found_cavities.size(); ++i)
        expectSame(std::optional(a.found_cavities[i]), std::optional(b.found_cavities[i]));
}

}  // namespace fluorocut::test
