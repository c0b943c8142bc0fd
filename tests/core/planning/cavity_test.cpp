#include "core/planning/cavity.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/geometry/mesh_properties.h"
#include "core/geometry/mesh_tools.h"
#include "core/geometry/primitives.h"
#include "core/image/distance_field.h"
#include "core/image/isosurface.h"
#include "core/planning/containment.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
constexpr double kPi = std::numbers::pi;

CavityOptions withOffset(double offset_mm) {
    CavityOptions options;
    options.offset_mm = offset_mm;
    return options;
}

void expectClosedAtTheTop(const Cavity& cavity) {
    const MeshProperties properties = meshProperties(cavity.mesh);
    EXPECT_TRUE(properties.closedManifold());
    EXPECT_EQ(properties.degenerate_triangles, 0u);
    EXPECT_EQ(properties.max_corner.z(), cavity.top_mm);
    EXPECT_EQ(properties.min_corner.z(), cavity.bottom_mm);
    EXPECT_EQ(properties.volume_mm3, cavity.volume_mm3);
    // A sharp rim: the flat top is no narrower than the walls under it, which widen upward.
    double top = 0, under = 0;
    for (const Vector3& v : cavity.mesh.vertices)
        (v.z() == cavity.top_mm ? top : under) = std::max(v.z() == cavity.top_mm ? top : under, v.x());
    EXPECT_GT(top, under - 5e-3);
}

// A flat-bottomed cylinder: the cutter rounds the bottom edge. What stays is a ring whose section is a square of R less
// a quarter circle, area (1 - pi/4) R^2, its centroid (10 - 3 pi) / (12 - 3 pi) R from the wall (Pappus).
TEST(Cavity, OfACylinderIsTheCylinderWithARoundedBottomEdgeAtAnyOffset) {
    const double R = 3, length = 60;
    for (const double offset : {0.0, 1.0, -0.5}) {
        const auto cavity = planCavity(makeCylinder(9, length, 360), withOffset(offset));
        ASSERT_OK(cavity);
        const double r = 9 + offset, deep = length + offset;
        const double left = (1 - kPi / 4) * R * R * 2 * kPi * (r - (10 - 3 * kPi) / (12 - 3 * kPi) * R);
        // Walls lie up to 3 h^2 / (8 r) = 0.01 mm inside, the volume by up to twice that of 9 mm: 0.25 %.
        EXPECT_NEAR(cavity->volume_mm3 / (kPi * r * r * deep - left), 1, 0.0025) << offset;
        EXPECT_NEAR(cavity->bottom_mm, -30 - offset, 0.002) << offset;
        EXPECT_NEAR(cavity->undercut_mm3, 0, 1e-3);
        // What an outward offset has rounded already, the cutter need not.
        const double before = offset > 0 ? (1 - kPi / 4) * 2 * kPi * (r - 0.2234) : 0;
        EXPECT_NEAR(cavity->unreachable_mm3, left - before, 0.03 * left) << offset;
        EXPECT_NEAR(cavity->unreachable_mm, (std::sqrt(2.0) - 1) * (R - std::max(offset, 0.0)),
                    offset < 0 ? 0.25 : 0.06)
            << offset;
        EXPECT_THAT(cavity->warnings, ElementsAre(HasSubstr("in corners or gaps")));
        expectClosedAtTheTop(*cavity);
        // walls: straight above the bottom
        for (const Vector3& v : cavity->mesh.vertices) {
            if (v.z() > -20 && v.z() < 30) {
                ASSERT_NEAR(std::hypot(v.x(), v.y()), r, 0.02);
            }
        }
    }
}

// A cone on its tip: the ball hangs in it, its centre R / sin(a) above the apex.
TEST(Cavity, OfAConeEndsInTheBallThatFitsIntoItsTip) {
    const double R = 3, r = 12, length = 60, slope = std::atan(r / length);
    const auto cavity = planCavity(makeFrustum(0, r, length, 360));
    ASSERT_OK(cavity);
    const double centre = R / std::sin(slope), touch = centre - R * std::sin(slope);  // heights over the apex
    const double cap = R - R * std::sin(slope);  // the ball's part below the circle where it touches
    const double tip = kPi / 3 * std::pow(touch * std::tan(slope), 2) * touch - kPi * cap * cap * (R - cap / 3);
    // The cone in which the ball's centre may be ends in a tip narrower than a voxel: 0.12 mm of it may be lost.
    EXPECT_NEAR(cavity->bottom_mm, -30 + centre - R, 0.12);
    EXPECT_NEAR(cavity->volume_mm3 / (kPi / 3 * r * r * length - tip), 1, 0.004);
    EXPECT_NEAR(cavity->unreachable_mm3, tip, 0.03 * tip);
    EXPECT_NEAR(cavity->unreachable_mm, centre - R, 0.12);
    EXPECT_NEAR(cavity->undercut_mm3, 0, 1e-3);
    expectClosedAtTheTop(*cavity);
}

// Half a sphere and a cylinder up to its top.
TEST(Cavity, OfASphereIsSweptToItsTop) {
    const double r = 10;
    const auto cavity = planCavity(makeSphere(r, 6));
    ASSERT_OK(cavity);
    EXPECT_NEAR(cavity->volume_mm3 / (kPi * r * r * r * 5 / 3), 1, 0.004);
    EXPECT_NEAR(cavity->undercut_mm3, kPi * r * r * r / 3, 0.002 * 4189);  // the facets' and the voxels' share
    EXPECT_LT(cavity->unreachable_mm3, 1);
    EXPECT_LT(cavity->unreachable_mm, 0.06);
    EXPECT_THAT(cavity->warnings, ElementsAre(HasSubstr("undercut")));
    expectClosedAtTheTop(*cavity);
}

// A squared stem, turned against the grid: its section is a rectangle whose corners the cutter rounds.
TEST(Cavity, CornersOfASquaredStemAreRoundedAsInTheClosedForm) {
    const double R = 3;
    const Vector2 half(10, 7);
    for (const double turn : {0.0, 0.5, 0.785}) {
        const Rigid3 turned = Rigid3::fromRotationVector({0, 0, turn});
        const auto cavity = planCavity(transformed(makeBox({20, 14, 60}), turned));
        ASSERT_OK(cavity);
        double worst = 0;
        for (const Vector3& v : cavity->mesh.vertices) {
            if (!(v.z() > -20 && v.z() < 30)) continue;
            const Vector3 p = turned.inverse() * v;
            const Vector2 beyond = p.head<2>().cwiseAbs() - half + Vector2::Constant(R);
            const double distance = beyond.cwiseMax(0).norm() + std::min(beyond.maxCoeff(), 0.0) - R;
            worst = std::max(worst, std::abs(distance));
        }
        // the arc's own 3 h^2 / (8 R) = 0.03 mm
        EXPECT_LT(worst, 0.04) << turn;
        // where three faces meet, the ball's centre is R from each
        EXPECT_NEAR(cavity->unreachable_mm, (std::sqrt(3.0) - 1) * R, 0.05) << turn;
    }
}

// A collar whose underside is the resection plane, and a neck: nothing of them is cavity.
TEST(Cavity, EndsAtTheResectionWhateverIsAboveIt) {
    const TriangleMesh stem = makeStem();
    const TriangleMesh collar = transformed(makeBox({50, 40, 6}), Rigid3::fromTranslation({0, 0, 3}));
    CavityOptions options;
    options.top_mm = 0;
    const auto alone = planCavity(stem), below = planCavity(merged(stem, collar), options);
    ASSERT_OK(alone);
    ASSERT_OK(below);
    EXPECT_EQ(below->top_mm, 0);
    EXPECT_NEAR(below->volume_mm3, alone->volume_mm3, 1e-4 * alone->volume_mm3);
    EXPECT_NEAR(meshProperties(below->mesh).max_corner.x(), meshProperties(alone->mesh).max_corner.x(), 1e-3);
    EXPECT_NEAR(below->undercut_mm3, 0, 1e-3);
    // cut lower: what was above is gone
    options.top_mm = -20.3;
    const auto lower = planCavity(stem, options);
    ASSERT_OK(lower);
    expectClosedAtTheTop(*lower);
    EXPECT_EQ(lower->top_mm, -20.3);
    EXPECT_NEAR(lower->bottom_mm, alone->bottom_mm, 0.03);  // facets of another phase in a tip of 3 mm
}

// With the opening above it, closed by the end of the grid.
MeshDistance openCavity(const Cavity& cavity) {
    return MeshDistance::build(isosurface(cavity.field, 0)).value();
}

// The smallest distance of a stage's wall from the next one's, both open at the top.
double leastLayer(const Cavity& inner, const Cavity& outer) {
    const MeshDistance next = openCavity(outer);
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t n = 0; n < inner.mesh.vertices.size(); n += 7)
        least = std::min(least, -next.signedDistance(inner.mesh.vertices[n]));
    return least;
}

TEST(Cavity, EveryStageLiesInsideTheNextByTheLayerBetweenThem) {
    const auto final = planCavity(makeStem());
    ASSERT_OK(final);
    const std::vector<double> insets = stageInsets(3, 1.6);
    std::vector<Cavity> stages;
    for (const double inset : insets) {
        auto stage = insetCavity(*final, inset);
        ASSERT_OK(stage);
        expectClosedAtTheTop(*stage);
        stages.push_back(std::move(*stage));
    }
    for (std::size_t n = 0; n + 1 < stages.size(); ++n) {
        EXPECT_GT(stages[n].volume_mm3, 1000);
        EXPECT_LT(stages[n].volume_mm3, stages[n + 1].volume_mm3);
        // The outer mesh's facets lie up to 3 h^2 / (8 R) = 0.031 mm inside its corners.
        EXPECT_GT(leastLayer(stages[n], stages[n + 1]), insets[n] - insets[n + 1] - 0.035);
        // The stem's own surface knows no such error; 0.005 mm are the stage's.
        double least = 1e9;
        for (const Vector3& v : stages[n].mesh.vertices)
            least = std::min(least, final->wall->nearest(v).distance_mm);
        EXPECT_GT(least, insets[n] - 0.005);
    }
    // not smaller than it need be: on the stem's flat flanks the layer is the inset
    EXPECT_LT(leastLayer(stages[0], stages[2]), insets[0] + 0.005);
    // an inset of an inset is their sum
    const auto twice = insetCavity(stages[1], 0.8);
    ASSERT_OK(twice);
    EXPECT_NEAR(twice->volume_mm3 / stages[0].volume_mm3, 1, 1e-3);
}

// What the inset is for, with real distances: displaced by errors drawn from the covariance, the first stage stays
// inside the final cavity as often as was asked.
TEST(Cavity, DisplacedFirstStagesStayInsideTheFinalCavitySlow) {
    const auto final = planCavity(makeStem());
    ASSERT_OK(final);
    Matrix6 covariance = Matrix6::Zero();
    covariance.diagonal() << 0.04, 0.02, 0.09, 1e-5, 2e-5, 3e-5;
    std::vector<SurfacePoint> walls;
    for (const SurfacePoint& point : surfacePoints(final->mesh)) {
        if (point.position.z() < -1e-6) walls.push_back(point);
    }
    const double inset = containedInset(walls, Vector3::Zero(), covariance);
    EXPECT_GT(inset, 0.3);
    const auto stage = insetCavity(*final, inset);
    ASSERT_OK(stage);
    const MeshDistance envelope = openCavity(*final);
    Random random(11);
    const int draws = 300;
    int inside = 0;
    for (int draw = 0; draw < draws; ++draw) {
        Vector6 error;
        for (int i = 0; i < 6; ++i)
            error[i] = std::sqrt(covariance(i, i)) * random.normal();
        const Rigid3 displaced = Rigid3().perturbed(error);
        bool stays = true;
        for (std::size_t n = 0; n < stage->mesh.vertices.size() && stays; n += 11) {
            const Vector3 p = displaced * stage->mesh.vertices[n];
            if (sampleField(final->field, p, 1) < -0.1) continue;  // no less deep than that
            stays = envelope.signedDistance(p) <= 0.01;            // the two surfaces' own errors
        }
        inside += stays;
    }
    // Binomial: 99 % of 300 has a standard deviation of 0.6 %.
    EXPECT_GE(inside, 292);
    EXPECT_LT(inside, draws);  // and the inset is no larger than it need be
}

// A cavity is its own cavity: what the cutter has rounded it can cut.
TEST(Cavity, OfACavityIsThatCavity) {
    const auto once = planCavity(makeStem());
    ASSERT_OK(once);
    const auto again = planCavity(once->mesh);
    ASSERT_OK(again);
    EXPECT_NEAR(again->volume_mm3 / once->volume_mm3, 1, 0.003);
    EXPECT_LT(again->unreachable_mm, 0.1);
    EXPECT_THAT(again->warnings, IsEmpty());
    const auto same = insetCavity(*once, 0);
    ASSERT_OK(same);
    EXPECT_EQ(same->volume_mm3, once->volume_mm3);
}

TEST(Cavity, OfALongRevisionStemIsPlannedTooSlow) {
    StemShape shape;
    shape.length_mm = 250;
    const auto cavity = planCavity(makeStem(shape));
    ASSERT_OK(cavity);
    EXPECT_NEAR(cavity->bottom_mm, -250, 0.15);  // its tip is blunt but no ball
    EXPECT_NEAR(cavity->volume_mm3 / meshProperties(makeStem(shape)).volume_mm3, 1, 0.01);
    expectClosedAtTheTop(*cavity);
}

// Cutter and stem come through it.
TEST(Cavity, FieldRunsOnStraightAboveTheTop) {
    const auto cavity = planCavity(makeCylinder(9, 30, 360));
    ASSERT_OK(cavity);
    for (const double above : {0.1, 5.0, 12.0}) {
        for (const double x : {0.0, 5.0, 8.0, 9.5, 11.0}) {
            EXPECT_NEAR(sampleField(cavity->field, {x, 0.3, 15 + above}, 99), std::hypot(x, 0.3) - 9, 0.03) << x;
        }
    }
}

TEST(Cavity, InsetsFallEvenlyToZeroAndNoLayerIsTooThin) {
    EXPECT_THAT(stageInsets(1, 2), ElementsAre(0));
    EXPECT_THAT(stageInsets(3, 2), ElementsAre(2, 1, 0));
    EXPECT_THAT(stageInsets(3, 0.2, 0.5), ElementsAre(1, 0.5, 0));
    EXPECT_THROW(stageInsets(0, 1), std::logic_error);
    EXPECT_THROW(stageInsets(2, std::nan("")), std::logic_error);
}

TEST(Cavity, RefusesWhatCanNotBePlannedInOneSentence) {
    TriangleMesh open = makeStem();
    open.triangles.pop_back();
    EXPECT_THAT(planCavity(open).error().message(), HasSubstr("the implant: found a hole"));
    CavityOptions options;
    options.cutter_radius_mm = 10;
    const auto thick = planCavity(makeCylinder(9, 60, 90), options);
    ASSERT_FALSE(thick.ok());
    EXPECT_EQ(thick.error().code, ErrorCode::noSolution);
    EXPECT_THAT(thick.error().message(), HasSubstr("expected at most 8.9"));
    options = {};
    options.spacing_mm = 1.6;
    EXPECT_THAT(planCavity(makeStem(), options).error().message(), HasSubstr("at most half the cutter's radius"));
    options = {};
    options.top_mm = -200;
    EXPECT_THAT(planCavity(makeStem(), options).error().message(), HasSubstr("above the implant's tip at z = -118"));
    for (double CavityOptions::*field :
         {&CavityOptions::offset_mm, &CavityOptions::cutter_radius_mm, &CavityOptions::spacing_mm}) {
        options = {};
        options.*field = std::nan("");
        EXPECT_EQ(planCavity(makeStem(), options).error().code, ErrorCode::invalidOption);
    }
    const auto cavity = planCavity(makeCylinder(9, 30, 90));
    ASSERT_OK(cavity);
    const auto far = insetCavity(*cavity, 7);
    ASSERT_FALSE(far.ok());
    EXPECT_EQ(far.error().code, ErrorCode::noSolution);
    EXPECT_THAT(far.error().message(), HasSubstr("expected at most 5.9"));
    EXPECT_EQ(insetCavity(*cavity, 11).error().code, ErrorCode::invalidOption);
    EXPECT_EQ(insetCavity(*cavity, std::nan("")).error().code, ErrorCode::invalidOption);
    EXPECT_THROW((void)insetCavity({}, 1), std::logic_error);
}

}  // namespace
}  // namespace fluorocut
