#include "core/fiducial/corkscrew_detection.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/units.h"
#include "tests/core/fiducial/corkscrew_view.h"

namespace fluorocut {
namespace {

using test::CorkscrewView;
using test::RoundBar;

CorkscrewLayout layoutNamed(const std::string& name) {
    return *readCorkscrew(std::string(FLUOROCUT_SOURCE_DIR) + "/resources/fiducials/" + name + ".json");
}

Rigid3 poseOf(double twist_deg, double roll_deg, double pitch_deg, const Vector3& place_mm) {
    const double degree = std::numbers::pi / 180;
    return {Rigid3::fromTwistRollPitch(twist_deg * degree, roll_deg * degree, pitch_deg * degree).rotation(), place_mm};
}

CorkscrewView viewOf(const std::string& layout, const Rigid3& pose) {
    CorkscrewView view;
    view.layout = layoutNamed(layout);
    view.imager_from_corkscrew = pose;
    return view;
}

// Bone, screw, clamp and a spindle in line with the shaft.
void addClutter(CorkscrewView& view) {
    const Rigid3& pose = view.imager_from_corkscrew;
    view.bars.push_back({{-15, 20, 720}, {0.3, 1, 0.1}, 14, 300, Material::corticalBone, Material::softTissue});
    view.bars.push_back({{-15, 20, 720}, {0.3, 1, 0.1}, 9, 320, Material::softTissue, Material::corticalBone});
    view.bars.push_back({{25, -25, 700}, {1, -0.7, 0.4}, 2.25, 40});
    view.bars.push_back({{20, 25, 650}, {1, 0.2, 0}, 3, 150});
    view.bars.push_back({pose * Vector3(view.layout.shaft_x_mm[1] + 70, 0, 0), pose.rotate(Vector3::UnitX()), 7, 145});
}

// What a shape fit converges from (corkscrew_refinement.h: 5 degrees, 10 mm of depth), with a margin.
bool near(const Rigid3& a, const Rigid3& b) {
    const Vector3 off = a.translation() - b.translation();
    return a.rotation().angularDistance(b.rotation()) < 4 * std::numbers::pi / 180 && off.head<2>().norm() < 2 &&
           std::abs(off.z()) < 0.03 * b.translation().z();
}

bool holds(const CorkscrewDetection& detection, const Rigid3& truth) {
    return std::any_of(detection.candidates.begin(), detection.candidates.end(),
                       [&](const CorkscrewCandidate& one) { return near(one.imager_from_corkscrew, truth); });
}

TEST(CorkscrewDetection, FindsThePoseWithoutAStartingGuess) {
    CorkscrewView view = viewOf("corkscrew", poseOf(40, 20, 30, {3, -4, 700}));
    const auto detection = detectCorkscrew(pictureOf(view), view.carm, view.layout);
    ASSERT_TRUE(detection) << detection.error().message();
    EXPECT_TRUE(near(detection->candidates.front().imager_from_corkscrew, view.imager_from_corkscrew));
    EXPECT_GT(detection->candidates.front().score, 0.8);
    EXPECT_DOUBLE_EQ(detection->candidates.front().visible, 1);
    EXPECT_FALSE(detection->metal_is_bright);
}

TEST(CorkscrewDetection, FindsItAmongBoneScrewClampAndSpindleInEitherPolarity) {
    for (const bool bright : {false, true}) {
        CorkscrewView view = viewOf("corkscrew", poseOf(130, -35, 200, {-5, 6, 690}));
        addClutter(view);
        view.metal_is_bright = bright;
        const auto detection = detectCorkscrew(pictureOf(view), view.carm, view.layout);
        ASSERT_TRUE(detection) << detection.error().message();
        EXPECT_TRUE(holds(*detection, view.imager_from_corkscrew)) << (bright ? "bright" : "dark");
        EXPECT_EQ(detection->metal_is_bright, bright);
    }
}

TEST(CorkscrewDetection, OffersBothPosesOfASymmetricCorkscrew) {
    CorkscrewView view = viewOf("corkscrew-paper", poseOf(75, 25, -60, {2, 3, 690}));
    // Half a turn about the perpendicular through its middle that meets the helix there: it looks the same.
    const double middle = std::numbers::pi * view.layout.helix.turns;
    const Rigid3 twin = view.imager_from_corkscrew *
                        Rigid3::fromRotationVector(std::numbers::pi * Vector3(0, std::cos(middle), std::sin(middle)));
    const auto detection = detectCorkscrew(pictureOf(view), view.carm, view.layout);
    ASSERT_TRUE(detection) << detection.error().message();
    EXPECT_TRUE(holds(*detection, view.imager_from_corkscrew));
    EXPECT_TRUE(holds(*detection, twin));
}

TEST(CorkscrewDetection, TakesFinerPixelsAndOtherDistances) {
    CorkscrewView view = viewOf("corkscrew", poseOf(-100, 45, 100, {10, 5, 850}));
    view.carm.columns = view.carm.rows = 1024;
    view.carm.pixel_mm = {0.16, 0.16};
    view.carm.principal_point_px = {511.5, 511.5};
    const auto detection = detectCorkscrew(pictureOf(view), view.carm, view.layout);
    ASSERT_TRUE(detection) << detection.error().message();
    EXPECT_TRUE(holds(*detection, view.imager_from_corkscrew));
}

TEST(CorkscrewDetection, IsTheSameOnAnyNumberOfThreads) {
    CorkscrewView view = viewOf("corkscrew", poseOf(10, -10, 300, {3, 4, 670}));
    addClutter(view);
    const Image image = pictureOf(view);
    const auto many = detectCorkscrew(image, view.carm, view.layout);
    const ThreadLimit limit(1);
    const auto one = detectCorkscrew(image, view.carm, view.layout);
    ASSERT_TRUE(many && one);
    ASSERT_EQ(many->candidates.size(), one->candidates.size());
    for (std::size_t i = 0; i < one->candidates.size(); ++i) {
        EXPECT_EQ(many->candidates[i].score, one->candidates[i].score);
        EXPECT_EQ(many->candidates[i].imager_from_corkscrew.matrix(),
                  one->candidates[i].imager_from_corkscrew.matrix());
    }
}

TEST(CorkscrewDetection, RefusesAnImageWithoutACorkscrew) {
    CorkscrewView view = viewOf("corkscrew", poseOf(0, 0, 0, {0, 0, 700}));
    view.corkscrew = false;
    const auto plain = detectCorkscrew(pictureOf(view), view.carm, view.layout);
    ASSERT_FALSE(plain);
    EXPECT_EQ(plain.error().code, ErrorCode::noSolution);
    EXPECT_NE(plain.error().message().find("shaft of 3 mm with 4 rings"), std::string::npos) << plain.error().message();

    addClutter(view);
    const auto cluttered = detectCorkscrew(pictureOf(view), view.carm, view.layout);
    ASSERT_FALSE(cluttered);
    EXPECT_EQ(cluttered.error().code, ErrorCode::noSolution);

    const auto constant = detectCorkscrew(Image(512, 512, 7.0F), view.carm, view.layout);
    ASSERT_FALSE(constant);
    EXPECT_NE(constant.error().message().find("one grey value"), std::string::npos) << constant.error().message();
}

TEST(CorkscrewDetection, SaysSoWhenHalfOfItIsOutside) {
    // Its middle 12 mm beyond the image's border: some 40 % of its wires are inside.
    CorkscrewView view = viewOf("corkscrew", poseOf(40, 20, 5, {67, -4, 700}));
    const auto detection = detectCorkscrew(pictureOf(view), view.carm, view.layout);
    ASSERT_FALSE(detection);
    EXPECT_EQ(detection.error().code, ErrorCode::noSolution);
    EXPECT_NE(detection.error().message().find("of the corkscrew's wires inside"), std::string::npos)
        << detection.error().message();
}

TEST(CorkscrewDetection, FindsItThoughAThirdIsOutside) {
    CorkscrewView view = viewOf("corkscrew", poseOf(40, 20, 5, {42, -4, 700}));
    const auto detection = detectCorkscrew(pictureOf(view), view.carm, view.layout);
    ASSERT_TRUE(detection) << detection.error().message();
    EXPECT_TRUE(holds(*detection, view.imager_from_corkscrew));
    EXPECT_LT(detection->candidates.front().visible, 0.8);
}

// Pictures that are nothing: whatever is said, it is said soon.
TEST(CorkscrewDetection, RefusesNoiseAndLatticesOfAnySize) {
    const CorkscrewLayout layout = layoutNamed("corkscrew");
    for (const int size : {48, 200, 512, 3000}) {
        CArm carm;
        carm.columns = carm.rows = size;
        carm.pixel_mm = {164.0 / size, 164.0 / size};
        carm.principal_point_px = {0.5 * (size - 1), 0.5 * (size - 1)};
        Image noise(size, size), lattice(size, size);
        Random random(5);
        const double period = 9.0 / carm.pixel_mm.x();  // grooves of a plate, magnified
        for (int y = 0; y < size; ++y) {
            for (int x = 0; x < size; ++x) {
                noise(x, y) = static_cast<float>(random.uniform(0, 4000));
                const bool groove = std::fmod(x, period) < 0.25 * period || std::fmod(y, period) < 0.25 * period;
                lattice(x, y) = (groove ? 1070.0F : 1000.0F) + static_cast<float>(random.uniform(-30, 30));
            }
        }
        for (const Image* image : {&noise, &lattice}) {
            const auto detection = detectCorkscrew(*image, carm, layout);
            ASSERT_FALSE(detection) << size;
            EXPECT_EQ(detection.error().code, ErrorCode::noSolution) << size;
        }
    }
}

TEST(CorkscrewDetection, RefusesWhatIsNoImageOfThisCArm) {
    const CorkscrewLayout layout = layoutNamed("corkscrew");
    const CArm carm;
    Image image(512, 512, 1.0F);
    image(100, 100) = std::numeric_limits<float>::quiet_NaN();
    const auto not_finite = detectCorkscrew(image, carm, layout);
    ASSERT_FALSE(not_finite);
    EXPECT_EQ(not_finite.error().code, ErrorCode::invalidInput);
    const auto other_size = detectCorkscrew(Image(1024, 1024, 1.0F), carm, layout);
    ASSERT_FALSE(other_size);
    EXPECT_NE(other_size.error().message().find("1024 x 1024"), std::string::npos) << other_size.error().message();
    EXPECT_FALSE(detectCorkscrew(Image(), carm, layout));
    CArm tiny;
    tiny.columns = tiny.rows = 16;
    EXPECT_FALSE(detectCorkscrew(Image(16, 16, 1.0F), tiny, layout));
    CorkscrewDetectionOptions options;
    options.least_depth = 0.98;
    const auto depths = detectCorkscrew(Image(512, 512, 1.0F), carm, layout, options);
    ASSERT_FALSE(depths);
    EXPECT_EQ(depths.error().code, ErrorCode::invalidOption);
}

}  // namespace
}  // namespace fluorocut
