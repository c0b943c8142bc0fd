#include "core/fiducial/femur_beads.h"

#include <atomic>
#include <cmath>
#include <cstdio>

#include <gmock/gmock.h>

#include "core/base/chi_square.h"
#include "core/base/parallel.h"
#include "tests/core/fiducial/bead_views.h"

namespace fluorocut {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

// Ten beads of 2 mm in a proximal femur: in both trochanters, the neck's base and along the shaft.
BeadLayout femurBeads() {
    BeadLayout layout;
    layout.frame = Frame::femur;
    const Vector3 places[] = {{14, -6, 42},   {22, 9, 33},  {8, 14, 20},   {-9, 12, 6},   {12, -13, 0},
                              {-11, -9, -13}, {13, 4, -24}, {-4, 15, -36}, {6, -14, -48}, {-12, 3, -56}};
    for (const Vector3& place : places) {
        Bead bead;
        bead.name = std::string("b").append(std::to_string(layout.beads.size() + 1));
        bead.center_mm = place;
        layout.beads.push_back(bead);
    }
    return layout;
}

Rigid3 view(double orbital_deg, double tilt_deg) {
    // AP: the beam along +y of the patient, the head up.
    Matrix3 ap;
    ap << 1, 0, 0, 0, 0, -1, 0, 1, 0;
    return Rigid3::fromTranslation({1, -7, 690}) * Rigid3::fromRotationVector({0, radiansFromDegrees(orbital_deg), 0}) *
           Rigid3::fromRotationVector({radiansFromDegrees(tilt_deg), 0, 0}) * Rigid3(ap, {0, 0, 0});
}

struct Shown {
    FemurView view;
    std::vector<int> bead;  // of each detection; -1: none
};

Shown show(const std::string& name, const BeadLayout& layout, const CArm& truth, const CArm& carm, const Rigid3& pose,
           double sigma_px, double missing, int extra, Random& random) {
    Shown shown;
    const test::SyntheticDetections made =
        test::syntheticDetections(layout, truth, pose, sigma_px, missing, extra, random);
    shown.view.name = name;
    shown.view.detections = made.detections;
    shown.view.carm = carm;
    shown.bead = made.bead;
    return shown;
}

FemurBeadOptions wellKnown(double sigma_px) {
    FemurBeadOptions options;
    options.uncertainty = {1e-9, 1e-9, 1e-9, sigma_px};
    options.uncertainty.unexplained_px = 1e-3;
    return options;
}

TEST(FemurBeads, WithoutErrorsThePosesAreExact) {
    const BeadLayout layout = femurBeads();
    const CArm carm = test::trueCArm();
    Random random(1);
    const auto a = show("ap", layout, carm, carm, view(0, 0), 0, 0, 0, random);
    const auto b = show("lateral", layout, carm, carm, view(85, 5), 0, 0, 0, random);
    const auto result = registerBeads({a.view, b.view}, layout);
    ASSERT_OK(result);
    ASSERT_THAT(result->views, SizeIs(2));
    for (int k = 0; k < 2; ++k) {
        const FemurViewPose& pose = result->views[static_cast<std::size_t>(k)];
        const Vector6 off = pose.imager_from_femur.target_from_source.deltaFrom(k == 0 ? view(0, 0) : view(85, 5));
        // Rounding of the iterations: 1e-9 px are 1e-7 mm in depth.
        EXPECT_LT(off.head<3>().norm(), 1e-5);
        EXPECT_LT(off.tail<3>().norm(), 1e-7);
        EXPECT_THAT(pose.beads, SizeIs(10));
        EXPECT_LT(pose.fre_mm, 1e-6);
        EXPECT_LT(std::abs(pose.size_error), 0.1);
    }
    EXPECT_TRUE(accepted(result->acceptance));
}

// The contract's 95 % regions: shadows' noise, calibration and bead places drawn from what is stated.
TEST(FemurBeads, SlowRegionsOf95PercentHoldTheTruth) {
    const BeadLayout layout = femurBeads();
    const CArm carm = test::trueCArm();
    constexpr int kTrials = 1000;
    constexpr double kSigmaPx = 0.08;
    FemurBeadOptions options;
    options.uncertainty = {0.001, 1, 0.05, 1e-3};
    const double limit = chiSquareQuantile(0.05, 6);
    std::vector<int> all(kTrials), noise(kTrials);
    std::atomic<int> refused{0};
    parallelFor(kTrials, 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            Random random = Random(77).fork(i);
            const Rigid3 pose = view(random.uniform(-90, 90), random.uniform(-25, 25));
            const auto held = [&](const BeadLayout& stated, const CArm& nominal, bool own) {
                const auto shown = show("v", layout, carm, nominal, pose, kSigmaPx, 0.1, 2, random);
                const auto result = registerBeads({shown.view}, stated, options);
                if (!result) {
                    ++refused;
                    return 0;
                }
                const FemurViewPose& found = result->views[0];
                const Vector6 e = pose.deltaFrom(found.imager_from_femur.target_from_source);
                const Matrix6& covariance = own ? found.noise_covariance : *found.imager_from_femur.covariance;
                return e.dot(covariance.ldlt().solve(e)) < limit ? 1 : 0;
            };
            noise[i] = held(layout, carm, true);
            CArm nominal = carm;
            nominal.focal_length_mm *= 1 + 0.001 * random.normal();
            nominal.principal_point_px += Vector2(random.normal(), random.normal());
            BeadLayout stated = layout;
            for (Bead& bead : stated.beads)
                bead.center_mm += 0.05 * Vector3(random.normal(), random.normal(), random.normal());
            all[i] = held(stated, nominal, false);
        }
    });
    int held_noise = 0, held_all = 0;
    for (int i = 0; i < kTrials; ++i) {
        held_noise += noise[static_cast<std::size_t>(i)];
        held_all += all[static_cast<std::size_t>(i)];
    }
    std::printf("of %d: noise held %d, all held %d; refused %d of %d\n", kTrials, held_noise, held_all, refused.load(),
                2 * kTrials);
    EXPECT_LE(refused, 10);
    // 1,000 trials: standard error 0.7 %. Bead errors show in the residuals as well and are counted twice there: the
    // second share may be larger.
    EXPECT_NEAR(held_noise, 950, 22);
    EXPECT_GE(held_all, 930);
}

struct Labels {
    int right = 0, wrong = 0, refused = 0, rejected = 0;
};

Labels labelling(double missing, int extra, int trials, std::uint64_t seed) {
    const BeadLayout layout = femurBeads();
    const CArm carm = test::trueCArm();
    std::vector<Labels> each(static_cast<std::size_t>(trials));
    parallelFor(each.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            Random random = Random(seed).fork(i);
            const auto shown = show("v", layout, carm, carm, view(random.uniform(-90, 90), random.uniform(-25, 25)),
                                    0.1, missing, extra, random);
            const auto result = registerBeads({shown.view}, layout, wellKnown(0.1));
            if (!result) {
                each[i].refused = 1;

                continue;
            }
            bool right = true;
            for (const FemurBead& bead : result->views[0].beads)
                right = right && (!bead.used || shown.bead[bead.detection] == static_cast<int>(bead.bead));
            (right ? each[i].right : each[i].wrong) = 1;
            if (!right && !accepted(result->acceptance)) each[i].rejected = 1;
        }
    });
    Labels sum;
    for (const Labels& one : each) {
        sum.right += one.right;
        sum.wrong += one.wrong;
        sum.refused += one.refused;
        sum.rejected += one.rejected;
    }
    return sum;
}

TEST(FemurBeads, SlowLabelsAreRightWithMissingAndFalseBeads) {
    for (const auto& [missing, extra] : {std::pair{0.0, 0}, std::pair{0.2, 3}, std::pair{0.35, 6}}) {
        const Labels labels = labelling(missing, extra, 200, 5);
        RecordProperty("right_" + std::to_string(extra), labels.right);
        RecordProperty("wrong_" + std::to_string(extra), labels.wrong);
        RecordProperty("refused_" + std::to_string(extra), labels.refused);
        std::printf("missing %.0f %%, %d false: right %d, wrong %d (of them not accepted %d), refused %d of 200\n",
                    100 * missing, extra, labels.right, labels.wrong, labels.rejected, labels.refused);
        EXPECT_EQ(labels.wrong, 0);
        EXPECT_GE(labels.right, missing < 0.3 ? 198 : 170);
    }
}

// The lateral view shows three beads: not enough for itself, enough once it is known how it lies to the first.
TEST(FemurBeads, AViewWithThreeBeadsIsGuidedByTheOthers) {
    const BeadLayout layout = femurBeads();
    const CArm carm = test::trueCArm();
    Random random(4);
    const auto ap = show("ap", layout, carm, carm, view(0, 0), 0.05, 0, 2, random);
    Shown lateral = show("lateral", layout, carm, carm, view(80, 0), 0.05, 0, 0, random);
    lateral.view.detections.resize(3);
    const auto apart = registerBeads({ap.view, lateral.view}, layout);
    ASSERT_OK(apart);
    EXPECT_THAT(apart->views, SizeIs(1));
    EXPECT_THAT(apart->rejected, ElementsAre(HasSubstr("View lateral was left out")));

    const Matrix6 known = (Vector6() << 0.05, 0.05, 0.05, 5e-4, 5e-4, 5e-4).finished().cwiseAbs2().asDiagonal();
    lateral.view.imager_from_first =
        (view(80, 0) * view(0, 0).inverse()).perturbed((Vector6() << 0.04, -0.03, 0.05, 3e-4, -4e-4, 2e-4).finished());
    lateral.view.covariance_from_first = known;
    const auto together = registerBeads({ap.view, lateral.view}, layout);
    ASSERT_OK(together);
    ASSERT_THAT(together->views, SizeIs(2));
    EXPECT_TRUE(together->views[1].guided);
    for (const FemurBead& bead : together->views[1].beads)
        EXPECT_EQ(static_cast<int>(bead.bead), lateral.bead[bead.detection]);
    // Depth of the first view, which its own beads hardly tell, comes from the second.
    const double alone_depth = std::sqrt(apart->views[0].noise_covariance(2, 2));
    const double joint_depth = std::sqrt(together->views[0].noise_covariance(2, 2));
    EXPECT_LT(joint_depth, 0.8 * alone_depth);
    const Vector6 off = together->views[0].imager_from_femur.target_from_source.deltaFrom(view(0, 0));
    EXPECT_LT(std::abs(off[2]), 4 * joint_depth);
}

// Three views whose geometry is known to 0.3 mm and 0.05 degrees, as a co-registration has it, with errors of that
// size.
std::vector<FemurView> coregistered(std::uint64_t seed) {
    const BeadLayout layout = femurBeads();
    const CArm carm = test::trueCArm();
    Random random(seed);
    const std::vector<Rigid3> poses{view(-25, 0), view(5, 10), view(40, 0)};
    Vector6 sigma;
    sigma << 0.3, 0.3, 0.3, 9e-4, 9e-4, 9e-4;
    std::vector<FemurView> views;
    for (std::size_t k = 0; k < poses.size(); ++k) {
        views.push_back(
            show(std::string(1, static_cast<char>('a' + k)), layout, carm, carm, poses[k], 0.05, 0.1, 2, random).view);
        if (k == 0) continue;
        Vector6 error;
        for (int i = 0; i < 6; ++i)
            error[i] = sigma[i] * random.normal();
        views[k].imager_from_first = (poses[k] * poses[0].inverse()).perturbed(error);
        views[k].covariance_from_first = sigma.cwiseAbs2().asDiagonal();
    }
    return views;
}

// The images in place of each other, the geometry as it was.
void exchangeImages(FemurView& a, FemurView& b) {
    std::swap(a.name, b.name);
    std::swap(a.detections, b.detections);
}

// Refused falsely one time in a million: never in 40.
TEST(FemurBeads, ViewsThatAreAsCoregisteredPassHoweverTheErrorsFall) {
    for (std::uint64_t seed = 1; seed <= 40; ++seed) {
        const auto result = registerBeads(coregistered(seed), femurBeads());
        ASSERT_OK(result) << "seed " << seed;
        EXPECT_TRUE(accepted(result->acceptance)) << "seed " << seed;
    }
}

TEST(FemurBeads, SwappedImagesAreNamedByTheKnownGeometry) {
    std::vector<FemurView> views = coregistered(2);
    exchangeImages(views[0], views[2]);
    const auto swapped = registerBeads(views, femurBeads());
    ASSERT_FALSE(swapped);
    EXPECT_EQ(swapped.error().code, ErrorCode::invalidInput);
    EXPECT_EQ(swapped.error().where, "views 1 (c) and 3 (a)");
    EXPECT_THAT(swapped.error().found, HasSubstr("seem to be swapped"));
    // Two views alone, exchanged: each is told from the other by the way from the first to the second.
    views = coregistered(3);
    views.pop_back();
    exchangeImages(views[0], views[1]);
    const auto two = registerBeads(views, femurBeads());
    ASSERT_FALSE(two);
    EXPECT_THAT(two.error().found, HasSubstr("seem to be swapped"));
}

TEST(FemurBeads, AViewThatIsNotAsCoregisteredIsNamed) {
    std::vector<FemurView> views = coregistered(4);
    // The corkscrew was moved by 4 degrees before the second shot, which nobody said.
    views[1].imager_from_first = *views[1].imager_from_first * Rigid3::fromRotationVector({0, 0, 0.07});
    const auto one = registerBeads(views, femurBeads());
    ASSERT_FALSE(one);
    EXPECT_EQ(one.error().code, ErrorCode::invalidInput);
    EXPECT_EQ(one.error().where, "view 2 (b)");
    EXPECT_THAT(one.error().found, HasSubstr("the other views agree"));
    views[2].imager_from_first = *views[2].imager_from_first * Rigid3::fromRotationVector({0, 0.1, 0});
    const auto all = registerBeads(views, femurBeads());
    ASSERT_FALSE(all);
    EXPECT_EQ(all.error().where, "the femur's beads");
}

TEST(FemurBeads, ABeadThatMovedIsNamedAndLeftOut) {
    BeadLayout layout = femurBeads();
    const CArm carm = test::trueCArm();
    Random random(6);
    const auto shown = show("ap", layout, carm, carm, view(20, 0), 0.03, 0, 0, random);
    layout.beads[4].center_mm += Vector3(0.15, 0, 0.15);
    const auto result = registerBeads({shown.view}, layout, wellKnown(0.03));
    ASSERT_OK(result);
    EXPECT_THAT(result->warnings, ElementsAre(HasSubstr("bead b5")));
    const Vector6 off = result->views[0].imager_from_femur.target_from_source.deltaFrom(view(20, 0));
    EXPECT_LT(off.head<2>().norm(), 0.03);
}

TEST(FemurBeads, TheWrongFileIsRefused) {
    const CArm carm = test::trueCArm();
    Random random(3);
    const auto ap = show("ap", femurBeads(), carm, carm, view(0, 0), 0.05, 0, 0, random);
    const auto lateral = show("lateral", femurBeads(), carm, carm, view(80, 0), 0.05, 0, 0, random);
    BeadLayout other = femurBeads();
    for (Bead& bead : other.beads)
        bead.center_mm = Vector3(random.uniform(-20, 20), random.uniform(-20, 20), random.uniform(-70, 50));
    auto result = registerBeads({ap.view, lateral.view}, other);
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, ErrorCode::noSolution);
    EXPECT_THAT(result.error().message(), HasSubstr("none of the 2 views shows the layout"));
    other = femurBeads();
    other.frame = Frame::phantom;
    result = registerBeads({ap.view}, other);
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, ErrorCode::invalidInput);
    // The right places of beads twice the size.
    other = femurBeads();
    for (Bead& bead : other.beads)
        bead.diameter_mm = 4;
    result = registerBeads({ap.view}, other);
    ASSERT_OK(result);
    EXPECT_FALSE(accepted(result->acceptance));
    // No beads at all.
    FemurView empty = ap.view;
    empty.detections.clear();
    result = registerBeads({empty}, femurBeads());
    ASSERT_FALSE(result);
    EXPECT_THAT(result.error().message(), HasSubstr("view ap"));
}

// Evidence against the fit itself: the pose it gives for another focal length is the pose found with that one.
TEST(FemurBeads, EvidenceTellsHowThePoseFollowsTheCalibration) {
    const BeadLayout layout = femurBeads();
    const CArm carm = test::trueCArm();
    Random random(2);
    const auto shown = show("ap", layout, carm, carm, view(10, 0), 0.02, 0, 0, random);
    const auto result = registerBeads({shown.view}, layout, wellKnown(0.02));
    ASSERT_OK(result);
    const PoseEvidence& evidence = result->views[0].evidence;
    EXPECT_EQ(beadParameters(layout).size(), static_cast<std::size_t>(evidence.shared.size()));
    EXPECT_LT((evidence.covariance() - result->views[0].noise_covariance).norm(),
              1e-6 * result->views[0].noise_covariance.norm());
    Eigen::VectorXd values = evidence.shared;
    values[0] += 0.001;
    values[2] += 0.5;
    values[3] += 0.005;
    FemurView other = shown.view;
    other.carm.focal_length_mm *= 1.001;
    other.carm.principal_point_px.y() += 0.5;
    BeadLayout moved = layout;
    moved.beads[0].center_mm.x() += 0.005;
    const auto again = registerBeads({other}, moved, wellKnown(0.02));
    ASSERT_OK(again);
    const Vector6 off = evidence.poseGiven(values).deltaFrom(again->views[0].imager_from_femur.target_from_source);
    // The pose moves by 0.7 mm; second order, and a little other weights, leave 2 % of it.
    EXPECT_LT(off.head<3>().norm(), 0.015);
    EXPECT_LT(off.tail<3>().norm(), 2e-5);
}

}  // namespace
}  // namespace fluorocut
