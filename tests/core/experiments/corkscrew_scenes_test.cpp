// The scenes that detection and fits are tested with: what they promise.
#include "core/experiments/corkscrew_scenes.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include <gmock/gmock.h>

#include "core/image/blur.h"
#include "core/io/resources.h"
#include "core/simulation/corkscrew_objects.h"
#include "core/simulation/virtual_operating_room.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

CorkscrewSceneOptions optionsOf(const char* name) {
    CorkscrewSceneOptions options;
    options.layout = readCorkscrew(findResource("fiducials", name).value()).value();
    return options;
}

CorkscrewScenes prepared(const CorkscrewSceneOptions& options) {
    auto scenes = CorkscrewScenes::prepare(options);
    if (!scenes) throw std::runtime_error(scenes.error().message());
    return std::move(*scenes);
}

CorkscrewScene sceneOf(const CorkscrewScenes& scenes, std::uint64_t index) {
    auto scene = scenes.scene(index);
    if (!scene) throw std::runtime_error(scene.error().message());
    return std::move(*scene);
}

TEST(CorkscrewScenes, AreTheSameEveryTimeAndDifferFromEachOther) {
    CorkscrewSceneOptions options = optionsOf("corkscrew");
    options.clutter = {0, 1, 1, 1, 1};
    const CorkscrewScenes scenes = prepared(options), again = prepared(options);
    const CorkscrewScene third = sceneOf(again, 3), first = sceneOf(again, 1);
    EXPECT_EQ(sceneOf(scenes, 1).image, first.image);
    EXPECT_EQ(sceneOf(scenes, 3).image, third.image);
    EXPECT_NE(first.image, third.image);
    EXPECT_THAT(first.objects, testing::HasSubstr("screw"));
    EXPECT_THAT(first.objects, testing::HasSubstr("clamp, spindle"));
    EXPECT_THAT(first.objects, testing::HasSubstr("retractor"));
    EXPECT_GT(std::max(first.covered, third.covered), 0);
}

TEST(CorkscrewScenes, PosesFillTheRangesAndStayInThePicture) {
    CorkscrewSceneOptions options = optionsOf("corkscrew-paper");
    options.imager.size_px = 128;
    options.imager.pixel_mm = 1.28;
    const CorkscrewScenes scenes = prepared(options);
    Vector3 least = Vector3::Constant(9), most = -least;
    for (std::uint64_t i = 0; i < 60; ++i) {
        const CorkscrewScene scene = sceneOf(scenes, i);
        EXPECT_EQ(scene.visible, 1);
        EXPECT_LT(scene.covered, 1e-9);
        const Rigid3& pose = scene.imager_from_corkscrew;
        EXPECT_GE(pose.translation().z(), options.least_depth_mm);
        EXPECT_LE(pose.translation().z(), options.most_depth_mm);
        least = least.cwiseMin(pose.twistRollPitch());
        most = most.cwiseMax(pose.twistRollPitch());
        for (const CorkscrewRing& ring : options.layout.rings) {
            for (int k = 0; k < 8; ++k) {
                const Vector2 pixel = scene.carm.project(pose * ring.point(k));
                EXPECT_GE(pixel.minCoeff(), 0);
                EXPECT_LE(pixel.maxCoeff(), 127);
            }
        }
    }
    // Of 60 uniform draws the outermost lie within a tenth of the ends with a likelihood of 1 - 2e-3.
    EXPECT_LT(least.x(), -2.5);
    EXPECT_GT(most.x(), 2.5);
    for (const int i : {1, 2}) {
        EXPECT_LT(least[i], -0.8 * options.most_roll_rad);
        EXPECT_GT(most[i], 0.8 * options.most_roll_rad);
        EXPECT_LE(std::max(-least[i], most[i]), options.most_roll_rad);
    }
}

// The same corkscrew, pose and physics through the virtual operating room: the pictures differ by their noise, by what
// the room's mean of line integrals within a pixel neglects (wires' edges), and not in place.
TEST(CorkscrewScenes, ShowWhatTheVirtualOperatingRoomShows) {
    CorkscrewSceneOptions options = optionsOf("corkscrew");
    options.imager.size_px = 400;
    options.imager.pixel_mm = 0.16;
    options.least_visible = 0.3;
    options.photons = 1e7;
    const CorkscrewScenes scenes = prepared(options);
    const CorkscrewScene scene = sceneOf(scenes, 5);

    OperatingRoomOptions setup;
    setup.nominal_carm = scene.carm;
    setup = setup.withoutErrors();
    setup.samples_per_axis = 3;
    setup.xray = XrayOptions();
    setup.xray.photons_per_pixel = 1e7;
    setup.xray.bits = 16;
    auto room = VirtualOperatingRoom::create(nullptr, setup);
    ASSERT_OK(room);
    // Without errors the imager stands where it is told to.
    const Rigid3 imager_from_room = nominalImagerFromRoom(CArmPosition{}, setup.source_to_isocentre_mm);
    const auto parts = heldCorkscrew("corkscrew", options.layout, HeldBy::room,
                                     imager_from_room.inverse() * scene.imager_from_corkscrew);
    ASSERT_OK(parts);
    for (const HeldObject& part : *parts)
        ASSERT_OK(room->hold(part));
    ImageRequest request;
    request.position = CArmPosition{};
    const auto acquired = room->acquire(request, Progress::none());
    ASSERT_OK(acquired);
    // Levels differ by a gain. Pixels are small and blurred, since at edges the room's mean of line integrals is darker
    // than the mean of what comes through.
    const Image ours = gaussianBlurred(scene.image, 3), theirs = gaussianBlurred(acquired->image, 3);
    const double gain = std::accumulate(ours.pixels().begin(), ours.pixels().end(), 0.0) /
                        std::accumulate(theirs.pixels().begin(), theirs.pixels().end(), 0.0);
    const auto difference = [&](int shift) {
        double most = 0;
        for (int y = 0; y < ours.height(); ++y)
            for (int x = 0; x + shift < ours.width(); ++x)
                most = std::max(most, std::abs(std::log(ours(x, y) / theirs(x + shift, y) / gain)));
        return most;
    };
    EXPECT_LT(difference(0), 0.05);
    EXPECT_GT(difference(1), 0.15);  // this sees displacements
}

TEST(CorkscrewScenes, MoreLightMakesLessNoiseAndInvertedIsTheNegative) {
    CorkscrewSceneOptions options = optionsOf("corkscrew");
    const CorkscrewScene plain = sceneOf(prepared(options), 0);
    // Far from the corkscrew: relative noise of 1000 photons spread over a blur of 0.7 px (sum of the squared kernel:
    // 1 / (4 pi 0.7^2) = 0.16, a little more for a sampled one), electronic noise of 5 photons besides.
    const Image smooth = gaussianBlurred(plain.image, 6);
    double squares = 0;
    int count = 0;
    for (int y = 4; y < 508; ++y) {
        for (int x = 4; x < 508; ++x) {
            const double off_px =
                (plain.carm.project(plain.imager_from_corkscrew.translation()) - Vector2(x, y)).norm();
            if (off_px < 350) continue;
            squares += std::pow(plain.image(x, y) / smooth(x, y) - 1, 2);
            ++count;
        }
    }
    if (count > 1000) {
        EXPECT_NEAR(std::sqrt(squares / count), std::sqrt(0.17 / 1000 + 25e-6), 0.002);
    }
    options.inverted = 1;
    const CorkscrewScene negative = sceneOf(prepared(options), 0);
    EXPECT_TRUE(negative.inverted);
    for (std::size_t i = 0; i < plain.image.size(); i += 101)
        ASSERT_EQ(negative.image.pixels()[i], 65535 - plain.image.pixels()[i]);
}

// Bent imagers: the map leaves about a hundredth of a millimetre, and projecting the true pose through the known C-arm
// meets the true picture to that.
TEST(CorkscrewScenes, ABentImagerIsKnownToItsMapsError) {
    Random random(7);
    SimulatedImagerOptions options;
    options.bent = true;
    const auto imager = simulateImager(options, random);
    ASSERT_OK(imager);
    EXPECT_GT(imager->map_error_mm, 1e-4);
    EXPECT_LT(imager->map_error_mm, 0.03);
    EXPECT_LT(imager->known_from_true.rotationAngle(), 0.05);
    double most_mm = 0, bent_mm = 0;
    for (double x = -40; x <= 40; x += 10) {
        for (double y = -30; y <= 30; y += 10) {
            const Vector3 point(x, y, 700);
            const Vector2 truth = imager->truth.project(point);
            const Vector2 known = imager->known.project(imager->known_from_true * point);
            most_mm = std::max(most_mm, 0.32 * (known - truth).norm());
            bent_mm = std::max(bent_mm, 0.32 * (imager->truth.projectIdeal(point) - truth).norm());
        }
    }
    EXPECT_LT(most_mm, 5 * imager->map_error_mm);
    EXPECT_GT(bent_mm, 1);  // there was something to correct
}

TEST(CorkscrewScenes, TheMovedCorkscrewKeepsImagerAndClutter) {
    CorkscrewSceneOptions options = optionsOf("corkscrew");
    options.clutter.screws = 1;
    const CorkscrewScenes scenes = prepared(options);
    const CorkscrewScene before = sceneOf(scenes, 2);
    const Rigid3 pose = Rigid3::fromTranslation({5, 0, 0}) * before.imager_from_corkscrew;
    const auto after = scenes.sceneWith(2, pose), other_noise = scenes.sceneWith(2, pose, 2);
    ASSERT_OK(after);
    ASSERT_OK(other_noise);
    EXPECT_LT((after->imager_from_corkscrew.inverse() * pose).translation().norm(), 1e-9);
    EXPECT_EQ(after->objects, before.objects);
    EXPECT_NE(after->image, other_noise->image);
    EXPECT_NE(after->image, before.image);
}

TEST(CorkscrewScenes, TakesAGivenCArmAndPose) {
    CorkscrewSceneOptions options = optionsOf("corkscrew");
    options.carm = CArm();
    options.carm->columns = 300;
    options.carm->principal_point_px = {149.5, 255.5};
    const Rigid3 pose = Rigid3::fromTranslation({0, 0, 700}) * Rigid3::fromTwistRollPitch(0.5, 0.2, 0.3);
    const CorkscrewScenes scenes = prepared(options);
    const auto scene = scenes.sceneAt(0, pose);
    ASSERT_OK(scene);
    EXPECT_EQ(scene->image.width(), 300);
    EXPECT_LT((scene->imager_from_corkscrew.inverse() * pose).translation().norm(), 1e-9);
    EXPECT_GT(scene->visible, 0.1);  // the middle; the rings lie outside
    EXPECT_LT(scene->visible, 1);
    EXPECT_THAT(scenes.sceneAt(0, Rigid3::fromTranslation({0, 0, -700})).error().message(),
                testing::HasSubstr("between source and detector"));
    EXPECT_FALSE(scenes.sceneWith(0, Rigid3::fromTranslation({0, 0, 990})).ok());
}

TEST(CorkscrewScenes, RefusesWhatDoesNotFit) {
    CorkscrewSceneOptions options = optionsOf("corkscrew");
    options.photons = -1;
    EXPECT_THAT(CorkscrewScenes::prepare(options).error().message(), testing::HasSubstr("photons: found -1"));
    options = optionsOf("corkscrew");
    options.imager.size_px = 128;  // 41 mm: no place for 100 mm
    options.most_roll_rad = 0.1;
    const auto none = prepared(options).scene(0);
    ASSERT_FALSE(none.ok());
    EXPECT_EQ(none.error().code, ErrorCode::noSolution);
    EXPECT_THAT(none.error().message(), testing::HasSubstr("least_visible"));
}

}  // namespace
}  // namespace fluorocut
