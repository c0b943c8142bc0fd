#include "core/simulation/femur_phantom.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Dense>

#include "core/base/parallel.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

FemurOptions dryBone(double voxel_mm) {
    FemurOptions options;
    options.soft_tissue = false;
    options.pelvis = false;
    options.voxel_mm = voxel_mm;
    return options;
}

FemurOptions coarseHip() {
    FemurOptions options;
    options.voxel_mm = 3;
    return options;
}

// Half way between air and the thin cortex of the metaphysis, whose HU is 1170: a voxel half full of bone.
constexpr double kSurfaceHu = 85;

double sample(const Volume& ct, const Vector3& point) {
    return sampleLinear(ct, ct.grid().indexFromPoint(point), -1000);
}

double totalMass(const Volume& ct) {
    double sum = 0;
    for (const float voxel : ct.voxels())
        sum += voxel + 1000.0;
    return sum * ct.grid().spacing_mm.prod();
}

// Least-squares sphere through the outermost crossings of the surface's HU on rays away from the neck.
struct Sphere {
    Vector3 center;
    double radius;
    double rms;
};
Sphere fitHead(const FemurPhantom& femur) {
    const FemurLandmarks& marks = femur.landmarks;
    std::vector<Vector3> points;
    const int count = 600;
    for (int n = 0; n < count; ++n) {
        // Fibonacci directions.
        const double z = 1 - (2 * n + 1.0) / count, turn = 2 * std::numbers::pi * std::fmod(n * 0.6180339887, 1.0);
        const Vector3 direction(std::sqrt(1 - z * z) * std::cos(turn), std::sqrt(1 - z * z) * std::sin(turn), z);
        const double toward = direction.dot(marks.neck_direction);
        if (toward < -0.2 || toward > 0.85) continue;  // neck; fovea
        double before = -1000;
        for (double r = marks.head_radius_mm + 6; r > 10; r -= 0.1) {
            const double value = sample(femur.ct, marks.head_center_mm + r * direction);
            if (value > kSurfaceHu) {
                points.push_back(marks.head_center_mm +
                                 (r + 0.1 * (value - kSurfaceHu) / (value - before)) * direction);
                break;
            }
            before = value;
        }
    }
    Eigen::MatrixXd a(points.size(), 4);
    Eigen::VectorXd b(points.size());
    for (std::size_t n = 0; n < points.size(); ++n) {
        a.row(static_cast<Eigen::Index>(n)) << 2 * points[n].transpose(), 1;
        b[static_cast<Eigen::Index>(n)] = points[n].squaredNorm();
    }
    const Eigen::Vector4d x = a.colPivHouseholderQr().solve(b);
    Sphere sphere{x.head<3>(), std::sqrt(x[3] + x.head<3>().squaredNorm()), 0};
    for (const Vector3& point : points)
        sphere.rms += std::pow((point - sphere.center).norm() - sphere.radius, 2) / double(points.size());
    sphere.rms = std::sqrt(sphere.rms);
    return sphere;
}

// Medio-lateral extent of the canal at a level: the widest run below `level_hu` that cortex encloses on both sides.
double measuredCanalWidth(const Volume& ct, double z, double level_hu) {
    double low = 1e9, high = -1e9;
    for (double y = -35; y <= 35; y += 0.5) {
        double first = NAN, last = NAN, before = -1000;
        bool in_cortex = false;
        double pending = NAN;
        for (double x = -45; x <= 35; x += 0.1) {
            const double value = sample(ct, {x, y, z});
            if (!in_cortex && value > level_hu) {
                in_cortex = true;
                if (!std::isnan(pending)) {  // a run that began inside cortex ends in cortex
                    if (x - pending > 2) {
                        if (std::isnan(first)) first = pending;
                        last = x;
                    }
                }
            } else if (in_cortex && value < level_hu) {
                in_cortex = false;
                pending = x;
            }
            before = value;
        }
        (void)before;
        if (!std::isnan(first)) {
            low = std::min(low, first);
            high = std::max(high, last);
        }
    }
    return high - low;
}

TEST(FemurPhantom, RightIsTheExactMirrorImageOfLeft) {
    FemurOptions options = coarseHip();
    options.removed_implant = ImplantRemoval{};
    const auto left = generateFemur(options);
    options.side = BodySide::right;
    const auto right = generateFemur(options);
    ASSERT_OK(left);
    ASSERT_OK(right);
    const Volume &l = left->ct, &r = right->ct;
    ASSERT_EQ(l.grid().size, r.grid().size);
    const int last = l.size(0) - 1;
    for (int k = 0; k < l.size(2); ++k)
        for (int j = 0; j < l.size(1); ++j)
            for (int i = 0; i <= last; ++i)
                ASSERT_EQ(l(i, j, k), r(last - i, j, k));
    Vector3 corner = l.grid().pointFromIndex(Vector3(last, 0, 0));
    corner.x() = -corner.x();
    EXPECT_LT((corner - r.grid().origin_mm).norm(), 1e-12);
    // Landmarks: the head of a left femur is toward the patient's right (-x), of a right femur toward +x.
    EXPECT_LT(left->landmarks.head_center_mm.x(), -30);
    EXPECT_EQ(left->landmarks.head_center_mm.x(), -right->landmarks.head_center_mm.x());
    EXPECT_EQ(left->landmarks.lesser_trochanter_mm.y(), right->landmarks.lesser_trochanter_mm.y());
    EXPECT_EQ(left->removed_implant->cavity_axis.back().x(), -right->removed_implant->cavity_axis.back().x());
}

TEST(FemurPhantom, DependsOnTheSeedAndNotOnTheNumberOfThreads) {
    FemurOptions options = coarseHip();
    options.removed_implant = ImplantRemoval{};
    const auto many = generateFemur(options);
    ASSERT_OK(many);
    {
        const ThreadLimit limit(1);
        const auto one = generateFemur(options);
        ASSERT_OK(one);
        EXPECT_EQ(many->ct.voxels(), one->ct.voxels());
    }
    options.seed = 2;
    const auto other = generateFemur(options);
    ASSERT_OK(other);
    EXPECT_NE(many->ct.voxels(), other->ct.voxels());
    EXPECT_EQ(many->landmarks.greater_trochanter_mm, other->landmarks.greater_trochanter_mm);
}

TEST(FemurPhantom, VolumeAndMassConvergeWithTheVoxelSize) {
    double volume_before = 0, mass_before = 0;
    for (const double voxel_mm : {0.9, 1.3}) {
        FemurOptions options = dryBone(voxel_mm);
        const auto femur = generateFemur(options);
        // The same bone filled with one density, near enough: a threshold half way to air then counts its volume.
        options.densities = {.cortical_hu = 300, .trabecular_hu = 150, .marrow_hu = 150};
        const auto solid = generateFemur(options);
        ASSERT_OK(femur);
        ASSERT_OK(solid);
        RecordProperty("elapsed_ms", std::to_string(femur->elapsed_ms));
        const auto& voxels = solid->ct.voxels();
        const double volume = double(std::count_if(voxels.begin(), voxels.end(), [](float hu) { return hu > -380; })) *
                              std::pow(voxel_mm, 3);
        const double mass = totalMass(femur->ct);
        EXPECT_GT(volume, 200e3);  // 160 mm of shaft of 28 mm, the head of 51 cm3, the trochanters
        EXPECT_LT(volume, 300e3);
        if (volume_before > 0) {
            // Partial volumes are taken from the distance to the surface; thin shells cost the coarse grid most.
            EXPECT_NEAR(volume / volume_before, 1, 0.01);
            EXPECT_NEAR(mass / mass_before, 1, 0.01);
        }
        volume_before = volume;
        mass_before = mass;
    }
}

TEST(FemurPhantom, FillsTheWholeBoneAndNothingElse) {
    // Blocks far from the bone are skipped: no voxel of bone may be lost with them.
    FemurOptions options = dryBone(1.2);
    options.head_diameter_mm = 52;
    options.femoral_offset_mm = 52;
    const auto femur = generateFemur(options);
    const auto shape = femurShape(options);
    ASSERT_OK(femur);
    ASSERT_OK(shape);
    const Volume& ct = femur->ct;
    int inside = 0;
    for (int k = 0; k < ct.size(2); ++k)
        for (int j = 0; j < ct.size(1); ++j)
            for (int i = 0; i < ct.size(0); ++i) {
                const Vector3 p = ct.grid().pointFromIndex(Vector3(i, j, k));
                const double outer = shape->outer(p);
                if (outer < -0.5 * options.voxel_mm) {
                    ++inside;
                    ASSERT_GT(ct(i, j, k), -200) << p.transpose();
                } else if (outer > 0.5 * options.voxel_mm) {
                    ASSERT_EQ(ct(i, j, k), -1000) << p.transpose();
                }
            }
    // The volume holds all of it: no bone at its sides and its top, bone at its lower end.
    EXPECT_GT(inside, 80000);
    for (int k = 0; k < ct.size(2); ++k) {
        for (int j = 0; j < ct.size(1); ++j)
            ASSERT_EQ(std::max(ct(0, j, k), ct(ct.size(0) - 1, j, k)), -1000);
        for (int i = 0; i < ct.size(0); ++i)
            ASSERT_EQ(std::max(ct(i, 0, k), ct(i, ct.size(1) - 1, k)), -1000);
    }
    float lowest = -1000, highest = -1000;
    for (int j = 0; j < ct.size(1); ++j)
        for (int i = 0; i < ct.size(0); ++i) {
            lowest = std::max(lowest, ct(i, j, 0));
            highest = std::max(highest, ct(i, j, ct.size(2) - 1));
        }
    EXPECT_GT(lowest, 1000);
    EXPECT_EQ(highest, -1000);
}

TEST(FemurPhantom, HeadIsASphereOfTheAskedSizeAndPlace) {
    for (const double diameter : {42.0, 50.0}) {
        FemurOptions options = dryBone(1.0);
        options.head_diameter_mm = diameter;
        options.shaft_length_mm = 60;
        const auto femur = generateFemur(options);
        ASSERT_OK(femur);
        const Sphere head = fitHead(*femur);
        // Partial volumes put the surface within a tenth of a voxel where the shell is as thick as a voxel.
        EXPECT_NEAR(head.radius, 0.5 * diameter, 0.3);
        EXPECT_LT((head.center - femur->landmarks.head_center_mm).norm(), 0.3);
        EXPECT_LT(head.rms, 0.2);
        // Offset, height and anteversion from the measured centre.
        const Vector3 lever = head.center - femur->landmarks.neck_base_mm;
        EXPECT_NEAR(std::hypot(lever.x(), lever.y()), options.femoral_offset_mm, 0.3);
        EXPECT_NEAR(degreesFromRadians(std::atan2(-lever.y(), -lever.x())), 12, 0.4);
        // At 127 degrees, head above neck base: offset * tan(37 degrees).
        EXPECT_NEAR(head.center.z(), options.neck_base_mm + options.femoral_offset_mm * 0.753554, 0.3);
    }
}

TEST(FemurPhantom, NeckShaftAngleIsTheAskedOne) {
    for (const double asked_deg : {120.0, 127.0, 135.0}) {
        FemurOptions options = dryBone(1.2);
        options.neck_shaft_angle_rad = radiansFromDegrees(asked_deg);
        options.shaft_length_mm = 100;
        const auto femur = generateFemur(options);
        ASSERT_OK(femur);
        // As on a radiograph: from the head's centre through the middle of the neck where it is thinnest, the sections
        // taken across the axis found so far, from a first guess that knows nothing of the asked angle.
        const Volume& ct = femur->ct;
        const Vector3 head = femur->landmarks.head_center_mm;
        Vector3 neck(-0.69, -0.15, 0.71);
        for (int round = 0; round < 5; ++round) {
            double least = 1e9;
            Vector3 middle = head;
            for (double along = 20; along < 40; along += 1) {
                const Vector3 at = head - along * neck;
                double area = 0;
                Vector3 moment = Vector3::Zero();
                const Vector3 u = neck.unitOrthogonal(), v = neck.cross(u);
                for (double a = -22; a <= 22; a += 0.5)
                    for (double b = -22; b <= 22; b += 0.5) {
                        const Vector3 p = at + a * u + b * v;
                        if (a * a + b * b > 22 * 22 || sample(ct, p) < -400) continue;
                        area += 1;
                        moment += p;
                    }
                if (area < least) {
                    least = area;
                    middle = moment / area;
                }
            }
            neck = (head - middle).normalized();
        }
        const double measured = degreesFromRadians(std::acos(-neck.z()));
        // The neck flares into the head and the trochanters unevenly, which pulls its middle by up to a mm;
        // over a lever of 30 mm that is 2 degrees. Readers of radiographs agree within 3.
        EXPECT_NEAR(measured, asked_deg, 3);
    }
}

TEST(FemurPhantom, CanalHasTheAskedWidthsAndDorrTypesDiffer) {
    double flare_before = 1e9, cortex_before = 1e9;
    for (const DorrType type : {DorrType::A, DorrType::B, DorrType::C}) {
        FemurOptions options = dryBone(0.8);
        options.dorr = type;
        options.shaft_length_mm = 115;
        const auto femur = generateFemur(options);
        ASSERT_OK(femur);
        const CanalShape asked = typicalCanal(type);
        // Half way between cortex (1500) and marrow (-40) in the shaft, between thin cortex and spongy bone above.
        const double isthmus = measuredCanalWidth(femur->ct, femur->landmarks.isthmus_mm.z(), 730);
        const double flare = measuredCanalWidth(femur->ct, 20, 850);
        EXPECT_NEAR(isthmus, asked.isthmus_mm, 0.4);
        EXPECT_NEAR(flare / isthmus, asked.flare_index, 0.06 * asked.flare_index);
        EXPECT_NEAR(femur->landmarks.isthmus_canal_mm, asked.isthmus_mm, 0.05);
        EXPECT_NEAR(femur->landmarks.canal_flare_index, asked.flare_index, 0.02);
        EXPECT_LT(flare / isthmus, flare_before);
        flare_before = flare / isthmus;
        const double cortex = (femur->landmarks.isthmus_outer_mm - isthmus) / 2;
        EXPECT_LT(cortex, cortex_before);
        cortex_before = cortex;
    }
}

TEST(FemurPhantom, CortexAtTheIsthmusIsAsThickAsReported) {
    FemurOptions options = dryBone(0.7);
    options.shaft_length_mm = 115;
    const auto femur = generateFemur(options);
    ASSERT_OK(femur);
    const Vector3 center = femur->landmarks.isthmus_mm;
    const auto crossing = [&](double from, double to, double level, double side) {
        const double step = to > from ? 0.02 : -0.02;
        for (double r = from; (to - r) * step > 0; r += step)
            if (sample(femur->ct, center + Vector3(side * r, 0, 0)) > level) return r;
        return double(NAN);
    };
    for (const double side : {-1.0, 1.0}) {
        const double outer = crossing(25, 0, 250, side), inner = crossing(0, 25, 730, side);
        const double expected = 0.5 * (femur->landmarks.isthmus_outer_mm - femur->landmarks.isthmus_canal_mm);
        // The centre's row need not be the widest: a few tenths.
        EXPECT_NEAR(outer - inner, expected, 0.4);
        EXPECT_GT(outer - inner, 6);  // 6 to 9 mm in middle-aged adults
        EXPECT_LT(outer - inner, 9);
    }
}

TEST(FemurPhantom, TissuesHaveTheirHounsfieldUnits) {
    FemurOptions options;
    options.voxel_mm = 2;
    const auto femur = generateFemur(options);
    const auto shape = femurShape(options);
    ASSERT_OK(femur);
    ASSERT_OK(shape);
    struct Mean {
        double sum = 0;
        int count = 0;
        void add(double value) {
            sum += value;
            ++count;
        }
        double value() const { return sum / count; }
    } cortex, marrow, head, muscle, air;
    std::vector<double> fat;
    const Volume& ct = femur->ct;
    for (int k = 0; k < ct.size(2); ++k)
        for (int j = 0; j < ct.size(1); ++j)
            for (int i = 0; i < ct.size(0); ++i) {
                const Vector3 p = ct.grid().pointFromIndex(Vector3(i, j, k));
                const double value = ct(i, j, k);
                EXPECT_GE(value, -1000);
                EXPECT_LE(value, 1900);
                if ((p - femur->landmarks.head_center_mm).norm() < 18) head.add(value);
                if (value > -900 && value < -70 && p.z() < -100) fat.push_back(value);
                if (value <= -999) air.add(value);
                if (p.z() > -90 || p.z() < -140) continue;
                const auto walls = shape->walls(p);
                if (walls.outer < -2 && walls.inner > 2) cortex.add(value);
                if (walls.inner < -2.5) marrow.add(value);
                if (walls.outer > 5 && walls.outer < 20 && value > -20) muscle.add(value);
            }
    for (const Mean& mean : {cortex, marrow, head, muscle, air})
        ASSERT_GT(mean.count, 100);
    EXPECT_NEAR(cortex.value(), 1500, 60);
    EXPECT_NEAR(marrow.value(), -40, 20);
    EXPECT_GT(head.value(), 150);
    EXPECT_LT(head.value(), 550);
    EXPECT_NEAR(muscle.value(), 52, 8);
    // The median: voxels at the skin and at muscles are mixed.
    ASSERT_GT(fat.size(), 1000u);
    std::nth_element(fat.begin(), fat.begin() + std::ptrdiff_t(fat.size() / 2), fat.end());
    EXPECT_NEAR(fat[fat.size() / 2], -98, 8);
    EXPECT_NEAR(air.value(), -1000, 0.01);
}

TEST(FemurPhantom, LandmarksLieOnTheBoneWhereAnatomyHasThem) {
    const FemurOptions options = coarseHip();
    const auto femur = generateFemur(options);
    const auto shape = femurShape(options);
    ASSERT_OK(femur);
    ASSERT_OK(shape);
    const FemurLandmarks& marks = femur->landmarks;
    for (const Vector3& tip : {marks.greater_trochanter_mm, marks.lesser_trochanter_mm})
        EXPECT_NEAR(shape->outer(tip), 0, 0.1);
    // The lesser trochanter is posteromedial, at level 0; the greater one rises laterally to above the head's centre.
    EXPECT_LT(marks.lesser_trochanter_mm.x(), -15);
    EXPECT_GT(marks.lesser_trochanter_mm.y(), 12);
    EXPECT_NEAR(marks.lesser_trochanter_mm.z(), 0, 2);
    EXPECT_GT(marks.greater_trochanter_mm.x(), 0);
    EXPECT_NEAR(marks.greater_trochanter_mm.z(), marks.head_center_mm.z(), 20);
    for (const Vector3& point : marks.shaft_axis_mm)
        EXPECT_LT(shape->outer(point), -8);
    // The shaft bows forward: seen from its upper end it falls back by z^2 / 2R.
    EXPECT_NEAR(marks.shaft_axis_mm[15].y() - marks.shaft_axis_mm[0].y(), 150.0 * 150 / 2400, 2);
}

TEST(FemurPhantom, RemovalLeavesACavityCementAndNoHead) {
    FemurOptions options = dryBone(1.4);
    const auto whole = generateFemur(options);
    options.removed_implant = ImplantRemoval{};
    const auto revised = generateFemur(options);
    options.removed_implant->cement_coverage = 0;
    const auto clean = generateFemur(options);
    ASSERT_OK(whole);
    ASSERT_OK(revised);
    ASSERT_OK(clean);
    const Vector3 head = whole->landmarks.head_center_mm;
    EXPECT_GT(sample(whole->ct, head), 100);
    EXPECT_EQ(sample(revised->ct, head), -1000);
    // Fluid in the middle of the cavity, all the way.
    ASSERT_TRUE(revised->removed_implant.has_value());
    const auto& axis = revised->removed_implant->cavity_axis;
    EXPECT_NEAR((axis.front() - axis.back()).norm(), options.removed_implant->stem_length_mm, 12);
    for (std::size_t n = 2; n + 2 < axis.size(); ++n)
        EXPECT_NEAR(sample(clean->ct, axis[n]), options.removed_implant->filling_hu, 15) << n;
    // The greater trochanter and the shaft below the plug are untouched.
    const Vector3 trochanter(16, -2, 35);
    EXPECT_EQ(sample(whole->ct, trochanter), sample(revised->ct, trochanter));
    EXPECT_EQ(sample(whole->ct, {0, 6, -150}), sample(revised->ct, {0, 6, -150}));
    // Cement adds mass to the cleaned cavity, in patches as asked.
    double before = totalMass(clean->ct);
    for (const double coverage : {0.3, 0.6, 1.0}) {
        options.removed_implant->cement_coverage = coverage;
        const auto cemented = generateFemur(options);
        ASSERT_OK(cemented);
        const double mass = totalMass(cemented->ct);
        EXPECT_GT(mass, before + 500 * 1e3) << coverage;  // half a cubic centimetre of cement at 1000 above fluid
        before = mass;
    }
    // The cavity does not break through: no opening to the outside below the neck cut.
    const auto shape = femurShape(options);
    ASSERT_OK(shape);
    const Volume& ct = clean->ct;
    for (int k = 0; k < ct.size(2); ++k)
        for (int j = 0; j < ct.size(1); ++j)
            for (int i = 0; i < ct.size(0); ++i) {
                const Vector3 p = ct.grid().pointFromIndex(Vector3(i, j, k));
                if (p.z() > 5) continue;
                const double outer = shape->outer(p);
                if (outer < -0.45 && outer > -0.75) {
                    ASSERT_GT(ct(i, j, k), 500) << p.transpose();
                }
            }
}

TEST(FemurPhantom, RefusesOptionsInWords) {
    const auto message = [](auto change) {
        FemurOptions options = dryBone(2);
        change(options);
        const auto result = generateFemur(options);
        return result.ok() ? std::string("accepted") : result.error().message();
    };
    using testing::HasSubstr;
    EXPECT_THAT(message([](auto& o) { o.voxel_mm = 0; }), HasSubstr("voxel_mm: found 0, expected 0.2 to 4 mm"));
    EXPECT_THAT(message([](auto& o) { o.head_diameter_mm = NAN; }), HasSubstr("head_diameter_mm: found nan"));
    EXPECT_THAT(message([](auto& o) { o.neck_shaft_angle_rad = 127; }), HasSubstr("neck_shaft_angle_rad: found 127"));
    EXPECT_THAT(message([](auto& o) { o.isthmus_canal_mm = 29; }), HasSubstr("for this bone"));
    EXPECT_THAT(message([](auto& o) { o.canal_flare_index = 7.5; }), HasSubstr("canal_flare_index: found 7.50"));
    EXPECT_THAT(message([](auto& o) { o.removed_implant = ImplantRemoval{.cement_coverage = 1.5}; }),
                HasSubstr("cement_coverage"));
    EXPECT_THAT(message([](auto& o) {
                    o.soft_tissue = true;
                    o.voxel_mm = 0.2;
                }),
                HasSubstr("larger voxels"));
}

TEST(FemurPhantom, CanBeCancelled) {
    struct Impatient final : Progress {
        double last = 0;
        void report(double fraction, std::string_view) override { last = fraction; }
        bool isCancelled() const override { return last > 0.3; }
    } progress;
    const auto result = generateFemur(coarseHip(), progress);
    ASSERT_FALSE(result.ok());
    EXPECT_TRUE(result.error().isCancelled());
    EXPECT_LT(progress.last, 0.9);
}

}  // namespace
}  // namespace fluorocut
