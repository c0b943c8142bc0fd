#include "core/planning/measures.h"

#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <gmock/gmock.h>

#include "core/base/random.h"
#include "core/base/units.h"
#include "core/imaging/standard_views.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using ::testing::HasSubstr;

// Standard deviation of what `draw` gives; of n values it is true to 1 / sqrt(2 n).
template <class Draw>
double spread(int n, const Draw& draw) {
    double sum = 0, squares = 0;
    for (int i = 0; i < n; ++i) {
        const double value = draw();
        sum += value;
        squares += value * value;
    }
    return std::sqrt(squares / n - sum / n * sum / n);
}
constexpr int kDraws = 4000;
constexpr double kDrawsError = 0.045;  // four times 1 / sqrt(8000)

Vector3 normal3(Random& random) {
    return {random.normal(), random.normal(), random.normal()};
}

TEST(Measures, ALengthInOneImageBelongsToAPlane) {
    CArm carm;                               // 0.32 mm pixels, 1000 mm
    const Vector2 a(100, 120), b(160, 200);  // 100 px = 32 mm
    const Measure detector = distanceInDetector(carm, a, b, 0.5);
    EXPECT_NEAR(detector.value, 32, 1e-9);
    EXPECT_NEAR(detector.sigma, std::sqrt(2.0) * 0.5 * 0.32, 1e-6);
    EXPECT_EQ(detector.plane, "in the detector plane");
    const Measure deep = distanceAtDepth(carm, a, b, 0.5, 700, 20);
    EXPECT_NEAR(deep.value, 22.4, 1e-9);
    EXPECT_NEAR(deep.sigma, std::hypot(0.7 * detector.sigma, 32.0 / 1000 * 20), 1e-6);
    EXPECT_THAT(deep.plane, HasSubstr("700 mm"));
    EXPECT_THAT(deep.plane, HasSubstr("magnification 1.429"));
    EXPECT_TRUE(deep.warnings.empty());
    EXPECT_THAT(distanceAtDepth(carm, a, b, 0.5, 700, 70).warnings, ::testing::ElementsAre(HasSubstr("10 %")));
    EXPECT_TRUE(std::isnan(distanceAtDepth(carm, a, b, 0.5, 1200, 20).value));

    carm.pixel_mm = {0.3, 0.2};
    const Measure along_u = distanceInDetector(carm, {0, 5}, {100, 5}, 0.5);
    EXPECT_NEAR(along_u.value, 30, 1e-9);
    EXPECT_NEAR(along_u.sigma, std::sqrt(2.0) * 0.5 * 0.3, 1e-6);  // errors along v count in the second order only
}

TEST(Measures, AnAngleBetweenTwoLines) {
    const CArm carm;
    // Lines of 100 px and 50 px, 30 degrees apart, wherever they lie: each end's error across its line turns it by
    // sigma / length, two ends by sqrt(2) times that.
    const double angle = radiansFromDegrees(30);
    const Vector2 a0(50, 60), b0(300, 90), along(std::cos(angle), std::sin(angle));
    const Measure measure = angleBetweenLines(carm, a0, a0 + Vector2(100, 0), b0, b0 + 50 * along, 0.5);
    EXPECT_NEAR(measure.value, angle, 1e-12);
    EXPECT_NEAR(measure.sigma, std::sqrt(2.0) * 0.5 * std::hypot(1.0 / 100, 1.0 / 50), 1e-6);
    EXPECT_EQ(measure.unit, "rad");
    // The lines have directions: the other way round it is the supplement.
    EXPECT_NEAR(angleBetweenLines(carm, a0 + Vector2(100, 0), a0, b0, b0 + 50 * along, 0.5).value,
                std::numbers::pi - angle, 1e-12);
}

TEST(Measures, AnAngleInOneImage) {
    CArm carm;
    const Vector2 vertex(200, 200), a(300, 200), b(200, 150);
    const Measure angle = angleInDetector(carm, vertex, a, b, 0.5);
    EXPECT_NEAR(angle.value, 0.5 * std::numbers::pi, 1e-9);
    // Each end turns its side by sigma / length; the vertex turns both: by sigma (1/50) along u and sigma (1/100) along
    // v.
    EXPECT_NEAR(angle.sigma, 0.5 * std::sqrt(2.0) * std::hypot(1.0 / 100, 1.0 / 50), 1e-6);
    Random random(1);
    const auto noisy = [&](const Vector2& p) { return Vector2(p + 0.5 * Vector2(random.normal(), random.normal())); };
    const double seen =
        spread(kDraws, [&] { return angleInDetector(carm, noisy(vertex), noisy(a), noisy(b), 0.5).value; });
    EXPECT_NEAR(angle.sigma / seen, 1, kDrawsError);
}

TEST(Measures, InSpaceErrorsAreWhatRepeatedMeasurementsShow) {
    const CArm carm = standardCArm();
    const Vector3 target(5, -10, 20);
    std::vector<View> views;
    Matrix6 pose_covariance = Matrix6::Zero();
    pose_covariance.diagonal() << 0.04, 0.04, 1, 1e-5, 1e-5, 1e-5;  // 0.2, 0.2, 1 mm; 0.2 degrees
    for (const StandardView kind : {StandardView::ap, StandardView::lateral})
        views.push_back({carm, standardView(kind, target, kStandardObjectDepthMm), pose_covariance});
    const std::vector<Vector3> places{target + Vector3(0, 0, 40), target + Vector3(10, 5, -50),
                                      target + Vector3(-40, 0, 30)};
    constexpr double kClick = 0.4;
    Random random(5);
    const Matrix6 root = pose_covariance.llt().matrixL();
    const auto measured = [&](bool noise) {
        std::vector<std::vector<Vector2>> pixels(places.size());
        for (const View& view : views) {
            Vector6 draw;
            for (int i = 0; i < 6; ++i)
                draw[i] = noise ? random.normal() : 0;
            const Rigid3 truth = view.imager_from_world.perturbed(root * draw);
            for (std::size_t n = 0; n < places.size(); ++n)
                pixels[n].push_back(carm.project(truth * places[n]) +
                                    (noise ? kClick : 0) * Vector2(random.normal(), random.normal()));
        }
        const auto points = pointsInSpace(views, pixels, kClick);
        EXPECT_OK(points);
        return *points;
    };
    const PointsInSpace exact = measured(false);
    const Measure distance = distanceInSpace(exact, 0, 1), angle = angleInSpace(exact, 0, 1, 2);
    EXPECT_NEAR(distance.value, (places[0] - places[1]).norm(), 1e-6);
    const Vector3 p = places[1] - places[0], q = places[2] - places[0];
    EXPECT_NEAR(angle.value, std::acos(p.normalized().dot(q.normalized())), 1e-8);
    EXPECT_EQ(distance.plane, "in space");
    constexpr int kFewer = 1500;  // 1 / sqrt(3000) = 1.8 %; four times that, and the second order of 1 mm in 700
    EXPECT_NEAR(distance.sigma / spread(kFewer, [&] { return distanceInSpace(measured(true), 0, 1).value; }), 1, 0.08);
    EXPECT_NEAR(angle.sigma / spread(kFewer, [&] { return angleInSpace(measured(true), 0, 1, 2).value; }), 1, 0.08);
    EXPECT_NEAR(exact.covariance(0, 0) / std::pow(spread(kFewer, [&] { return measured(true).points[0].x(); }), 2), 1,
                0.16);
    // The views' errors move both ends together: places are uncertain by more than the distance between them.
    EXPECT_LT(distance.sigma, 0.6 * std::sqrt(exact.covariance.topLeftCorner<3, 3>().trace()));
}

TEST(Measures, LegLengthAndOffset) {
    HipCenters hip;
    hip.axis.point = {0, 0, -60};
    hip.axis.direction = Vector3::UnitZ();
    hip.axis.direction_sigma_rad = 0.01;
    hip.axis.point_sigma_mm = 0.3;
    hip.head_reference.point = {-43, 0, 50};
    hip.head_planned.point = {-48, 0, 57};
    hip.head_reference.covariance = 0.25 * Matrix3::Identity();
    hip.head_planned.covariance = 0.04 * Matrix3::Identity();
    const Measure leg = legLengthChange(hip), offset = offsetChange(hip);
    EXPECT_NEAR(leg.value, 7, 1e-9);
    EXPECT_NEAR(leg.sigma, std::sqrt(0.25 + 0.04 + 25 * 1e-4), 1e-9);
    EXPECT_NEAR(offset.value, 5, 1e-9);
    // Heads at the same angle about the axis: the line's place cancels, its direction acts over the 7 mm of height.
    EXPECT_NEAR(offset.sigma, std::sqrt(0.25 + 0.04 + 49 * 1e-4), 1e-5);
    HipCenters moved = hip;
    moved.socket_reference = {{-43, 0, 50}, Matrix3::Zero()};
    moved.socket_planned = {{-43, 0, 53}, 0.01 * Matrix3::Identity()};
    EXPECT_NEAR(legLengthChange(moved).value, 4, 1e-9);  // a socket 3 mm higher takes 3 mm away

    Random random(8);
    const auto drawn = [&] {
        HipCenters one = hip;
        one.head_reference.point += 0.5 * normal3(random);
        one.head_planned.point += 0.2 * normal3(random);
        one.axis.direction = (one.axis.direction + 0.01 * Vector3(random.normal(), random.normal(), 0)).normalized();
        one.axis.point += 0.3 * Vector3(random.normal(), random.normal(), 0);
        return one;
    };
    EXPECT_NEAR(leg.sigma / spread(kDraws, [&] { return legLengthChange(drawn()).value; }), 1, kDrawsError);
    EXPECT_NEAR(offset.sigma / spread(kDraws, [&] { return offsetChange(drawn()).value; }), 1, kDrawsError);
}

TEST(Measures, Version) {
    const double wanted = radiansFromDegrees(14);
    VersionInput input;
    input.axis = Vector3::UnitZ();
    input.reference = -Vector3::UnitX();  // medial of a left femur in LPS; anterior is -y
    input.neck = 50 * Vector3(-std::cos(wanted), -std::sin(wanted), 0.8);
    input.neck_covariance = 0.36 * Matrix3::Identity();
    input.reference_covariance = 1e-4 * Matrix3::Identity();
    input.axis_covariance = 1e-4 * Matrix3::Identity();
    const Measure left = version(input);
    EXPECT_NEAR(left.value, wanted, 1e-9);
    // Neck: 0.6 mm over 50 mm across the axis; reference: 0.01; the axis tilts the neck's own rise of 0.8 sideways.
    EXPECT_NEAR(left.sigma, std::sqrt(std::pow(0.6 / 50, 2) + 1e-4 + 0.64 * 1e-4), 2e-4);
    VersionInput right = input;
    right.side = Side::right;
    right.reference = Vector3::UnitX();
    right.neck.x() = -right.neck.x();
    EXPECT_NEAR(version(right).value, wanted, 1e-9);
    Random random(9);
    EXPECT_NEAR(left.sigma / spread(kDraws,
                                    [&] {
                                        VersionInput one = input;
                                        one.neck += 0.6 * normal3(random);
                                        one.reference += 0.01 * normal3(random);
                                        one.axis += 0.01 * normal3(random);
                                        return version(one).value;
                                    }),
                1, kDrawsError);
    input.neck = Vector3(0.1, 0, 1);
    EXPECT_THAT(version(input).warnings, ::testing::ElementsAre(HasSubstr("not observable")));
}

TEST(Measures, AThinWallIsWarnedOf) {
    const Measure thick{3, 0.2, "mm", "", {}}, thin{2.2, 0.2, "mm", "", {}}, gone{-0.4, 0.2, "mm", "", {}};
    EXPECT_FALSE(perforationWarning(thick, "laterally", 2));
    EXPECT_THAT(perforationWarning(thin, "laterally", 2).value_or(""), HasSubstr("2.2 mm (+- 0.3)"));
    EXPECT_THAT(perforationWarning(gone, "laterally", 2).value_or(""), HasSubstr("breaks through the wall by 0.4 mm"));
    EXPECT_THAT(perforationWarning({}, "laterally", 2).value_or(""), HasSubstr("not known"));
}

}  // namespace
}  // namespace fluorocut
