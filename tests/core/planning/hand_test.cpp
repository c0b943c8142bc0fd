#include "core/planning/hand.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/base/units.h"
#include "core/geometry/primitives.h"
#include "core/imaging/standard_views.h"
#include "core/planning/implant_file.h"
#include "core/planning/stem_numbers.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

// A swirl about the principal point, with its exact inverse.
class Swirl final : public Distortion {
  public:
    Vector2 distorted(const Vector2& p) const override { return Eigen::Rotation2Dd(angle(p)) * p; }
    Vector2 undistorted(const Vector2& p) const override { return Eigen::Rotation2Dd(-angle(p)) * p; }

  private:
    static double angle(const Vector2& p) { return 1e-5 * p.squaredNorm(); }  // 0.06 rad at the border
};

struct Scene {
    View view;
    Rigid3 femur_from_implant;
};

// A C-arm somewhere about a stem somewhere; every second with distortion.
Scene sceneOf(std::uint64_t seed) {
    Random random(seed);
    const auto draw = [&] { return Vector3(random.normal(), random.normal(), random.normal()); };
    Scene scene;
    scene.view.carm = standardCArm();
    if (seed % 2 == 1) scene.view.carm.distortion = std::make_shared<Swirl>();
    const Rigid3 turn = Rigid3::fromRotationVector(0.5 * draw());
    const StandardView standard = seed % 3 == 0 ? StandardView::ap : StandardView::lateral;
    scene.view.imager_from_world = standardView(standard, 5 * draw(), 700) * turn;
    scene.femur_from_implant = Rigid3(expRotation(0.4 * draw()), 15 * draw());
    return scene;
}

Vector2 seen(const Scene& scene, const Rigid3& pose, const Vector3& p) {
    return scene.view.carm.project(scene.view.imager_from_world * (pose * p));
}
Vector3 inImager(const Scene& scene, const Rigid3& pose, const Vector3& p) {
    return scene.view.imager_from_world * (pose * p);
}

constexpr double kRounding = 1e-9;  // of doubles over some ten operations on numbers up to 1000

class Hand : public testing::TestWithParam<std::uint64_t> {};
INSTANTIATE_TEST_SUITE_P(Scenes, Hand, testing::Range<std::uint64_t>(0, 12));

TEST_P(Hand, WhatIsHeldStaysUnderTheHandAtItsDepth) {
    const Scene scene = sceneOf(GetParam());
    const Vector3 held(4, -3, -60);
    const Vector2 to = seen(scene, scene.femur_from_implant, held) + Vector2(37.25, -18.5);
    const auto next = dragged(scene.view, scene.femur_from_implant, held, to);
    ASSERT_TRUE(next);
    EXPECT_LT((seen(scene, *next, held) - to).norm(), kRounding);
    // All depths and all directions are as before.
    for (const Vector3& p : {Vector3(0, 0, 0), Vector3(9, 2, -20), Vector3(-3, 5, -110)})
        EXPECT_NEAR(inImager(scene, *next, p).z(), inImager(scene, scene.femur_from_implant, p).z(), kRounding);
    EXPECT_LT(next->rotation().angularDistance(scene.femur_from_implant.rotation()), 1e-12);
    // And back.
    const auto back = dragged(scene.view, *next, held, seen(scene, scene.femur_from_implant, held));
    ASSERT_TRUE(back);
    EXPECT_LT((back->translation() - scene.femur_from_implant.translation()).norm(), kRounding);
}

TEST_P(Hand, AShiftIsInMillimetresOfTheImagePlane) {
    const Scene scene = sceneOf(GetParam());
    const Rigid3 next = shifted(scene.view, scene.femur_from_implant, {0.1, -0.3});
    const Vector3 by = inImager(scene, next, {1, 2, 3}) - inImager(scene, scene.femur_from_implant, {1, 2, 3});
    EXPECT_LT((by - Vector3(0.1, -0.3, 0)).norm(), kRounding);
}

TEST_P(Hand, ATurnKeepsDepthsAndThePivot) {
    const Scene scene = sceneOf(GetParam());
    const Vector3 pivot(0, 0, -10), point(8, 1, -90);
    const double angle = 0.3;
    const Rigid3 next = turned(scene.view, scene.femur_from_implant, pivot, angle);
    EXPECT_LT((next * pivot - scene.femur_from_implant * pivot).norm(), kRounding);
    const Vector3 before =
        inImager(scene, scene.femur_from_implant, point) - inImager(scene, scene.femur_from_implant, pivot);
    const Vector3 after = inImager(scene, next, point) - inImager(scene, next, pivot);
    EXPECT_NEAR(after.z(), before.z(), kRounding);
    const Vector2 expected = Eigen::Rotation2Dd(angle) * before.head<2>();
    EXPECT_LT((after.head<2>() - expected).norm(), kRounding);
    const Rigid3 back = turned(scene.view, next, pivot, -angle);
    EXPECT_LT((back.matrix() - scene.femur_from_implant.matrix()).norm(), kRounding);
}

TEST_P(Hand, AHandleComesUnderTheHandWhereItCanReachIt) {
    const Scene scene = sceneOf(GetParam());
    const Vector3 pivot(0, 0, 0), tip(0, 0, -120);
    // Where the tip would be after a known turn: within its reach, so it is found under the hand.
    for (const double angle : {0.02, -0.7, 2.5}) {
        const Vector2 to = seen(scene, turned(scene.view, scene.femur_from_implant, pivot, angle), tip);
        const auto found = turnToward(scene.view, scene.femur_from_implant, pivot, tip, to);
        ASSERT_TRUE(found);
        // 1e-9: a pixel's rounding (1e-12 px) over the stem's picture, at worst foreshortened to some pixels.
        EXPECT_NEAR(*found, angle, 1e-9);
    }
}

TEST_P(Hand, ATiltTurnsAboutTheLineAcrossTheStemInTheImagePlane) {
    const Scene scene = sceneOf(GetParam());
    const Vector3 pivot(0, 0, 0);
    const auto stem = [&](const Rigid3& pose) {
        return Vector3((scene.view.imager_from_world * pose).rotate(Vector3::UnitZ()));
    };
    const double angle = radiansFromDegrees(7);
    const Rigid3 next = tilted(scene.view, scene.femur_from_implant, pivot, angle);
    EXPECT_LT((next * pivot - scene.femur_from_implant * pivot).norm(), kRounding);
    const Vector3 before = stem(scene.femur_from_implant), after = stem(next);
    EXPECT_NEAR(std::acos(before.dot(after)), angle, 1e-9);
    // The picture of the axis keeps its direction; the tip (along -z) comes nearer to the detector.
    EXPECT_NEAR(before.x() * after.y() - before.y() * after.x(), 0, kRounding);
    EXPECT_LT(after.z(), before.z());
    const Rigid3 back = tilted(scene.view, next, pivot, -angle);
    EXPECT_LT((back.matrix() - scene.femur_from_implant.matrix()).norm(), kRounding);
}

TEST_P(Hand, ARollKeepsTheStemsAxis) {
    const Scene scene = sceneOf(GetParam());
    const Vector3 pivot(0, 0, -40);
    const Rigid3 next = rolled(scene.femur_from_implant, pivot, 0.2);
    for (const double z : {0.0, -40.0, -120.0})
        EXPECT_LT((next * Vector3(0, 0, z) - scene.femur_from_implant * Vector3(0, 0, z)).norm(), kRounding);
    EXPECT_LT(
        (next * Vector3(10, 0, -5) - scene.femur_from_implant * Vector3(10 * std::cos(0.2), 10 * std::sin(0.2), -5))
            .norm(),
        kRounding);
}

TEST_P(Hand, SnappingBringsTheAxisOntoTheCanalByTheLeastTurn) {
    const Scene scene = sceneOf(GetParam());
    const AxisLine canal{{5, 3, -140}, {-4, 7, 20}};
    const Vector3 w = canal.direction(), reference(0, 0, -2);
    const Rigid3 next = snappedTo(canal, scene.femur_from_implant, reference);
    const auto away = [&](const Vector3& p) { return (p - canal.distal).cross(w).norm(); };
    for (const double z : {0.0, -60.0, -120.0})
        EXPECT_LT(away(next * Vector3(0, 0, z)), kRounding);
    EXPECT_NEAR(next.rotate(Vector3::UnitZ()).dot(w), 1, 1e-12);
    EXPECT_NEAR(w.dot(next * reference - scene.femur_from_implant * reference), 0, kRounding);
    // The least turn: by the angle between the axes. (1e-7: acos near 0.)
    EXPECT_NEAR(next.rotation().angularDistance(scene.femur_from_implant.rotation()),
                std::acos(std::min(1.0, scene.femur_from_implant.rotate(Vector3::UnitZ()).dot(w))), 1e-7);
    EXPECT_LT((snappedTo(canal, next, reference).matrix() - next.matrix()).norm(), 1e-7);
}

TEST(Hand, AStemAlongTheViewsAxisTiltsAboutTheImagesX) {
    Scene scene;
    scene.view.carm = standardCArm();
    scene.femur_from_implant = Rigid3::fromTranslation({0, 0, 600});  // its z is the imager's
    const Rigid3 next = tilted(scene.view, scene.femur_from_implant, Vector3::Zero(), 0.1);
    EXPECT_NEAR(next.rotate(Vector3::UnitX()).x(), 1, 1e-12);
    EXPECT_NEAR(next.rotate(Vector3::UnitZ()).z(), std::cos(0.1), 1e-12);
}

TEST(Hand, NothingIsDraggedFromBehindTheSourceOrToNowhere) {
    Scene scene;
    scene.view.carm = standardCArm();
    EXPECT_FALSE(dragged(scene.view, Rigid3::fromTranslation({0, 0, -5}), Vector3::Zero(), {100, 100}));
    const Rigid3 good = Rigid3::fromTranslation({0, 0, 600});
    EXPECT_FALSE(dragged(scene.view, good, Vector3::Zero(), {std::nan(""), 100}));
    EXPECT_FALSE(turnToward(scene.view, good, Vector3::Zero(), Vector3::Zero(), {100, 100}));  // pivot is the handle
}

// A ball of 10 mm at 600 mm in front of the source: its picture has the angle asin(10 / 600).
TEST(Hand, OnlyWhatLiesUnderThePixelIsHeld) {
    View view;
    view.carm = standardCArm();
    const TriangleMesh ball = makeSphere(10, 4);
    const Rigid3 place = Rigid3::fromTranslation({3, -2, 600});
    const auto middle = underPixel(view, ball, place, view.carm.project({3, -2, 600}));
    ASSERT_TRUE(middle);
    EXPECT_LT(middle->norm(), 0.02);  // midway through the ball: facets lie up to 0.01 mm inside it
    const double f = view.carm.focal_length_mm;
    const Vector2 center = view.carm.project({0, 0, 600});
    for (int i = 0; i < 16; ++i) {
        const double angle = std::numbers::pi * i / 8;
        const Vector2 out =
            Vector2(std::cos(angle), std::sin(angle)) * f * std::tan(std::asin(10.0 / 600)) / view.carm.pixel_mm.x();
        const Rigid3 straight = Rigid3::fromTranslation({0, 0, 600});
        // 0.4 %: by how much the facets of 5120 triangles lie inside the ball.
        EXPECT_TRUE(underPixel(view, ball, straight, center + 0.996 * out)) << i;
        EXPECT_FALSE(underPixel(view, ball, straight, center + 1.001 * out)) << i;
    }
    EXPECT_FALSE(underPixel(view, ball, Rigid3::fromTranslation({0, 0, -600}), center));  // behind the source
}

TEST(Hand, AStemIsHeldAtItsResectionAndItsTip) {
    const TriangleMesh stem = makeStem({});
    const StemGrip grip = gripOf(stem, -3);
    EXPECT_EQ(grip.shoulder, Vector3(0, 0, -3));
    EXPECT_NEAR(grip.tip.z(), -118, 1e-9);
    EXPECT_NEAR(grip.length(), 115, 1e-9);
}

TEST(Hand, AnotherSizeKeepsThePointAskedFor) {
    const auto small = loadImplant("straight", {"9"}), large = loadImplant("straight", {"13"});
    ASSERT_OK(small);
    ASSERT_OK(large);
    const Rigid3 pose(expRotation({0.1, -0.2, 0.3}), {10, 20, 30});
    for (const KeptPoint kept : {KeptPoint::resection, KeptPoint::entry}) {
        const Rigid3 next = resized(pose, *small, *large, kept);
        EXPECT_LT((next * keptPoint(*large, kept) - pose * keptPoint(*small, kept)).norm(), kRounding);
        EXPECT_LT(next.rotation().angularDistance(pose.rotation()), 1e-12);
        EXPECT_LT((resized(next, *large, *small, kept).matrix() - pose.matrix()).norm(), kRounding);
    }
    // The entry is the lateral end of the section at the resection: half of the width the family states, and the whole
    // growth of the late part lies medially (core/planning/implant_family.h).
    const Vector3 entry = keptPoint(*small, KeptPoint::entry);
    const double late = 0.5 * (25.9 - 9);  // (1 - even_taper) of the growth
    EXPECT_NEAR(entry.x(), -(0.5 * 25.9 - 0.5 * late), 1e-6);
    EXPECT_NEAR(entry.z(), 0, 1e-9);
}

TEST(Hand, NeighbouringSizesEndWithTheFamily) {
    ImplantFamily family;
    for (const char* size : {"8", "9", "10"})
        family.sizes.push_back({.name = size, .distal_mm = {0, 0}, .proximal_mm = {0, 0}});
    EXPECT_EQ(neighbourSize(family, "9", 1), "10");
    EXPECT_EQ(neighbourSize(family, "9", -1), "8");
    EXPECT_FALSE(neighbourSize(family, "10", 1));
    EXPECT_FALSE(neighbourSize(family, "8", -1));
    EXPECT_FALSE(neighbourSize(family, "12", 1));
}

class Numbers : public testing::TestWithParam<Side> {
  protected:
    // Left femur: the head at -x (LPS); the front is -y.
    StemSeat seat() const {
        StemSeat seat;
        seat.point = {10, -20, 30};
        seat.axis = Vector3::UnitZ();
        seat.side = GetParam();
        seat.medial = seat.side == Side::left ? Vector3(-1, 0, 0) : Vector3(1, 0, 0);
        return seat;
    }
};
INSTANTIATE_TEST_SUITE_P(Sides, Numbers, testing::Values(Side::left, Side::right));

TEST_P(Numbers, AreWhatTheirNamesSay) {
    const StemSeat femur = seat();
    const double angle = radiansFromDegrees(5);
    const auto tip = [&](const StemNumbers& n) {
        return Vector3(femurFromCavity(femur, n, 2).rotate(-Vector3::UnitZ()));
    };
    EXPECT_NEAR(tip({.varus_rad = angle}).dot(femur.medial), -std::sin(angle), 1e-12);  // laterally
    EXPECT_NEAR(tip({.flexion_rad = angle}).y(), -std::sin(angle), 1e-12);              // forward: -y in LPS
    const Vector3 neck = femurFromCavity(femur, {.version_rad = angle}).rotate(Vector3::UnitX());
    EXPECT_NEAR(neck.y(), -std::sin(angle), 1e-12);
    EXPECT_NEAR(neck.dot(femur.medial), std::cos(angle), 1e-12);
    const Vector3 reference =
        femurFromCavity(femur, {.medial_mm = 1, .anterior_mm = 2, .height_mm = 3}, -4) * Vector3(0, 0, -4);
    EXPECT_LT((reference - (femur.point + femur.medial + Vector3(0, -2, 3))).norm(), 1e-9);
}

TEST_P(Numbers, ComeBackFromThePose) {
    const StemSeat femur = seat();
    Random random(7);
    for (int i = 0; i < 50; ++i) {
        const StemNumbers n{0.4 * random.normal(), 0.4 * random.normal(), 0.6 * random.normal(),
                            9 * random.normal(),   9 * random.normal(),   9 * random.normal()};
        const StemNumbers back = stemNumbers(femur, femurFromCavity(femur, n, 1.5), 1.5);
        if (std::abs(n.varus_rad) > 1.5 || std::abs(n.flexion_rad) > 1.5) continue;
        EXPECT_NEAR(back.varus_rad, n.varus_rad, 1e-9);
        EXPECT_NEAR(back.flexion_rad, n.flexion_rad, 1e-9);
        EXPECT_NEAR(back.version_rad, n.version_rad, 1e-9);
        EXPECT_NEAR(back.medial_mm, n.medial_mm, 1e-9);
        EXPECT_NEAR(back.anterior_mm, n.anterior_mm, 1e-9);
        EXPECT_NEAR(back.height_mm, n.height_mm, 1e-9);
    }
}

}  // namespace
}  // namespace fluorocut
