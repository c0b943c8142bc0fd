#include "core/planning/femur_shaft.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gmock/gmock.h>

#include "core/base/random.h"
#include "core/io/volume_file.h"
#include "core/planning/line_fit.h"
#include "core/simulation/femur_phantom.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using ::testing::HasSubstr;

double degreesBetween(const Vector3& a, const Vector3& b) {
    return degreesFromRadians(std::atan2(a.cross(b).norm(), a.dot(b)));
}

FemurOptions coarse(DorrType type, BodySide side) {
    FemurOptions options;
    options.side = side;
    options.dorr = type;
    options.voxel_mm = 1.5;
    options.anteversion_rad = radiansFromDegrees(type == DorrType::A ? 5 : 20);
    options.head_diameter_mm = type == DorrType::A ? 44 : 50;
    return options;
}

TEST(FemurShaft, IsFoundInGeneratedHips) {
    for (const auto& [type, side] : {std::pair(DorrType::A, BodySide::left), std::pair(DorrType::C, BodySide::right)}) {
        const FemurOptions options = coarse(type, side);
        const auto femur = generateFemur(options);
        ASSERT_OK(femur);
        const auto shaft = findFemurShaft(femur->ct);
        ASSERT_OK(shaft);
        EXPECT_EQ(shaft->side, side == BodySide::left ? Side::left : Side::right);
        const FemurLandmarks& truth = femur->landmarks;
        // The chord of the bow over the levels used; its middle lies up to 2.3 mm (160^2 / 8 / 1200) from the axis.
        const Vector3 chord = truth.shaft_axis_mm[1] - truth.shaft_axis_mm[14];
        EXPECT_LT(degreesBetween(shaft->axis.direction(), chord), 1);
        EXPECT_LT(shaft->rms_mm, 1.2);
        for (const Vector3& center : shaft->centers) {
            const auto nearest = std::min_element(
                truth.shaft_axis_mm.begin(), truth.shaft_axis_mm.end(), [&](const Vector3& a, const Vector3& b) {
                    return std::abs(a.z() - center.z()) < std::abs(b.z() - center.z());
                });
            EXPECT_LT((center - *nearest).head<2>().norm(), 2);  // the front's cortex is thinner: 0.5 to 1 mm
        }
        // Usual levels of resection; and the head's direction, which the trochanters pull backward.
        const double above = shaft->axis.proximal.z() - truth.lesser_trochanter_mm.z();
        EXPECT_GT(above, 5);
        EXPECT_LT(above, 20);
        const Vector3 head = truth.head_center_mm - shaft->axis.proximal;
        const Vector3 axis = shaft->axis.direction();
        EXPECT_LT(degreesBetween(shaft->medial, head - head.dot(axis) * axis), 8);

        FemurShaftOptions wrong;
        wrong.side = side == BodySide::left ? Side::right : Side::left;
        const auto refused = findFemurShaft(femur->ct, wrong);
        ASSERT_FALSE(refused.ok());
        EXPECT_THAT(refused.error().message(), HasSubstr("--side"));
    }
}

TEST(FemurShaft, OfAirIsRefused) {
    VolumeGrid grid;
    grid.size = {80, 80, 80};
    const auto none = findFemurShaft(Volume(grid, -1000));
    ASSERT_FALSE(none.ok());
    EXPECT_EQ(none.error().code, ErrorCode::noSolution);
    EXPECT_THAT(none.error().message(), HasSubstr("ring of cortex"));
}

// Without a truth: the same femur with voxels of twice the size must have the same walls.
TEST(FemurShaftSlow, AndWallsOfARealFemurDoNotDependOnTheVoxels) {
    SKIP_WITHOUT_SHARED_DATA();
    const auto ct = readVolume(test::sharedData() / "ct/femur_m3_left_0.8mm.nii.gz");
    ASSERT_OK(ct);
    const auto shaft = findFemurShaft(ct->volume);
    ASSERT_OK(shaft);
    EXPECT_EQ(shaft->side, Side::left);
    EXPECT_LT(shaft->rms_mm, 1);

    VolumeGrid grid = ct->volume.grid();
    for (int axis = 0; axis < 3; ++axis)
        grid.size[static_cast<std::size_t>(axis)] /= 2;
    grid.origin_mm = grid.pointFromIndex(Vector3::Constant(0.5));
    grid.spacing_mm *= 2;
    Volume half(grid);
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) {
                float sum = 0;
                for (int corner = 0; corner < 8; ++corner)
                    sum += ct->volume(2 * i + (corner & 1), 2 * j + (corner >> 1 & 1), 2 * k + (corner >> 2));
                half(i, j, k) = sum / 8;
            }
    const auto fine = findBoneWalls(ct->volume, shaft->axis);
    ASSERT_OK(fine);
    const auto coarser = findBoneWalls(half, shaft->axis);
    ASSERT_OK(coarser);
    std::vector<double> difference;
    for (std::size_t l = 0; l < fine->levels.size(); ++l)
        for (std::size_t ray = 0; ray < fine->levels[l].outer_mm.size(); ++ray) {
            // Rays of the two start at slightly different places: compared along the rays of the one.
            const auto at = [&](const BoneWalls& walls, bool outer) {
                const WallLevel& own = fine->levels[l];
                const Vector3 p =
                    (outer ? fine->outerPoint(own, ray) : fine->canalPoint(own, ray)) - walls.levels[l].center;
                // Which ray of the other passes nearest, and how far it goes there.
                const double angle = std::atan2(p.dot(walls.v), p.dot(walls.u)) / (2 * std::numbers::pi);
                const auto n = static_cast<double>(own.outer_mm.size());
                const double place = (angle < 0 ? angle + 1 : angle) * n;
                const auto a = static_cast<std::size_t>(place) % own.outer_mm.size();
                const std::size_t b = (a + 1) % own.outer_mm.size();
                const double t = place - std::floor(place);
                const auto& radius = outer ? walls.levels[l].outer_mm : walls.levels[l].canal_mm;
                return (1 - t) * radius[a] + t * radius[b] - p.norm();
            };
            difference.push_back(std::abs(at(*coarser, true) - at(*coarser, false)));
        }
    std::sort(difference.begin(), difference.end());
    const auto part = [&](double p) {
        return difference[static_cast<std::size_t>(p * static_cast<double>(difference.size() - 1))];
    };
    printf("thickness, 1.6 against 0.8 mm voxels: median %.3f, 95%% %.3f mm\n", part(0.5), part(0.95));
    EXPECT_LT(part(0.5), 0.15);
    EXPECT_LT(part(0.95), 0.6);
}

TEST(LineFit, StatesItsErrorsAsRepeatedNoiseShowsThem) {
    const Vector3 direction = Vector3(0.1, -0.2, 1).normalized(), origin(3, 4, 5);
    Random random(3);
    const double sigma = 0.4;
    double angle_squares = 0, stated = 0, place_squares = 0, stated_place = 0;
    constexpr int kTrials = 4000;
    for (int trial = 0; trial < kTrials; ++trial) {
        std::vector<Vector3> points;
        for (int i = 0; i < 25; ++i)
            points.push_back(origin + (4.0 * i) * direction +
                             sigma * Vector3(random.normal(), random.normal(), random.normal()));
        const LineFit line = fitLine(points);
        const Vector3 found = line.direction.dot(direction) > 0 ? line.direction : Vector3(-line.direction);
        angle_squares += (found - direction).squaredNorm() / 2;  // one of two directions across
        stated += line.direction_sigma_rad * line.direction_sigma_rad;
        const Vector3 end = origin + 120 * direction;
        const Vector3 away = end - line.point;
        place_squares += (away - away.dot(found) * found).squaredNorm() / 2;
        stated_place += line.sigmaAt(end) * line.sigmaAt(end);
    }
    // A mean of 4000 squares is true to 1 / sqrt(4000) = 1.6 %; three times that.
    EXPECT_NEAR(stated / angle_squares, 1, 0.05);
    EXPECT_NEAR(stated_place / place_squares, 1, 0.05);
    EXPECT_TRUE(std::isnan(fitLine({origin, direction}).rms_mm));
}

}  // namespace
}  // namespace fluorocut
