// Plate, beads and what overlays them, in the virtual operating room.
#include "core/simulation/calibration_objects.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <gmock/gmock.h>

#include "core/geometry/mesh_properties.h"
#include "core/geometry/primitives.h"
#include "core/simulation/closed_form_projection.h"
#include "core/simulation/truth.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

OperatingRoomOptions roomWithUnknowns() {
    OperatingRoomOptions options;
    options.nominal_carm.columns = options.nominal_carm.rows = 256;
    options.nominal_carm.pixel_mm = {0.64, 0.64};
    options.nominal_carm.principal_point_px = {127.5, 127.5};
    options.xray = XrayOptions::ideal();
    options.seed = 3;
    return options;
}

VirtualOperatingRoom make(const OperatingRoomOptions& options) {
    auto room = VirtualOperatingRoom::create(nullptr, options);
    if (!room) throw std::runtime_error(room.error().message());
    return std::move(*room);
}

Image shoot(VirtualOperatingRoom& room, double orbital_rad = 0) {
    ImageRequest request;
    request.position = CArmPosition{orbital_rad, 0, Vector3::Zero()};
    auto acquired = room.acquire(request, Progress::none());
    if (!acquired) throw std::runtime_error(acquired.error().message());
    return std::move(acquired->image);
}

template <class T>
T held(Result<T> object) {
    if (!object) throw std::runtime_error(object.error().message());
    return std::move(*object);
}

double largestDifference(const Image& a, const Image& b) {
    double most = 0;
    for (std::size_t i = 0; i < a.size(); ++i)
        most = std::max(most, std::abs(double(a.pixels()[i]) - b.pixels()[i]));
    return most;
}

// The plate goes with the true detector: whatever focal length and pose the C-arm really has, one mm of the plate is
// one mm of the detector plane.
TEST(CalibrationObjects, ThePlateLiesOnTheTrueDetectorAtEveryPose) {
    auto room = make(roomWithUnknowns());
    PlatePlacement placement;
    placement.shift_mm = {1.5, -0.7};
    placement.rotation_rad = 0.3;
    ASSERT_OK(room.hold(held(heldPlate({}, placement))));
    for (const double orbital : {0.0, 1.2, -1.5}) {
        const Image image = shoot(room, orbital);
        const ViewTruth& view = truthOf(room).views.back();
        EXPECT_NE(view.carm.focal_length_mm, 1000);
        ASSERT_NE(view.carm.distortion, nullptr);
        const Rigid3 pose =
            Rigid3::fromTranslation({1.5, -0.7, view.carm.focal_length_mm}) * Rigid3::fromRotationVector({0, 0, 0.3});
        const Image path = platePathLengths({}, PlateFacing::source, view.carm, pose, {2});
        for (std::size_t i = 0; i < image.size(); ++i) {
            const double expected = std::exp(-attenuationPerMm(Material::aluminium) * path.pixels()[i]);
            ASSERT_NEAR(image.pixels()[i], expected, 1e-5);
        }
    }
}

// The grooves' contrast is the plate's: bright lines on the lands' grey.
TEST(CalibrationObjects, GroovesAreBrightByThePlatesContrast) {
    OperatingRoomOptions options = roomWithUnknowns().withoutErrors();
    options.nominal_carm.pixel_mm = {0.1, 0.1};
    auto room = make(options);
    const GroovedPlate plate;
    ASSERT_OK(room.hold(held(heldPlate(plate))));
    const Image image = shoot(room);
    const int middle = 127;
    const int land = middle + static_cast<int>(0.5 * plate.pitch_mm / 0.1);
    // Within 13 mm of the axis rays are 1e-4 longer.
    EXPECT_NEAR(std::log(image(middle, land) / image(land, land)), plate.grooveContrast(), 1e-3);
}

TEST(CalibrationObjects, APlateTurnedOverIsSeenMirrored) {
    PlatePlacement placement;
    placement.mirrored = true;
    placement.rotation_rad = 0.2;
    const Rigid3 detector_from_plate = placedPlate(placement);
    EXPECT_LT((detector_from_plate * Vector3(1, 0, 0) - Vector3(-std::cos(0.2), -std::sin(0.2), 0)).norm(), 1e-12);
    EXPECT_LT((detector_from_plate * Vector3(0, 1, 0) - Vector3(-std::sin(0.2), std::cos(0.2), 0)).norm(), 1e-12);
}

// The focal spot's penumbra is for the patient's depth; the plate on the detector is sharp, and transmissions multiply.
TEST(CalibrationObjects, ThePenumbraIsThePatientsNotThePlates) {
    OperatingRoomOptions options = roomWithUnknowns().withoutErrors();
    const auto pictureOf = [&](double focal_spot_mm, bool with_plate, bool with_ball) {
        options.xray.focal_spot_mm = focal_spot_mm;
        auto room = make(options);
        HeldObject ball;
        ball.name = "ball";
        ball.mesh = makeSphere(20, 4);
        ball.material = Material::steel;
        if (with_ball) {
            EXPECT_OK(room.hold(ball));
        }
        if (with_plate) {
            EXPECT_OK(room.hold(held(heldPlate({}))));
        }
        return shoot(room);
    };
    const Image plate = pictureOf(0, true, false), ball = pictureOf(2, false, true);
    EXPECT_LT(largestDifference(pictureOf(2, true, false), plate), 1e-6);
    EXPECT_GT(largestDifference(pictureOf(0, false, true), ball), 0.1);  // it does blur
    const Image both = pictureOf(2, true, true);
    for (std::size_t i = 0; i < both.size(); ++i)
        ASSERT_NEAR(both.pixels()[i], plate.pixels()[i] * ball.pixels()[i], 1e-6);
}

TEST(CalibrationObjects, BendsTheSameWayEverywhereWhenAsked) {
    OperatingRoomOptions options = roomWithUnknowns();
    options.constant_bending = IntensifierDistortionParameters{82, 1.5, 0.03};
    auto room = make(options);
    for (const double orbital : {0.0, 1.0}) {
        shoot(room, orbital);
        const auto& bending = dynamic_cast<const IntensifierDistortion&>(*truthOf(room).views.back().carm.distortion);
        EXPECT_EQ(bending.parameters().pincushion_mm, 1.5);
        EXPECT_EQ(bending.parameters().s_shape_rad, 0.03);
    }
    options.constant_bending->pincushion_mm = NAN;
    EXPECT_FALSE(VirtualOperatingRoom::create(nullptr, options).ok());
}

TEST(CalibrationObjects, BeadsOnThePlateTouchItsLands) {
    const GroovedPlate plate;
    const auto beads = beadsOnPlate(20, 3, 60, plate);
    ASSERT_OK(beads);
    EXPECT_EQ(beads->beads.size(), 49u);
    EXPECT_OK(beads->validate());
    for (const Bead& bead : beads->beads) {
        EXPECT_EQ(bead.center_mm.z() + 1.5, plateExtent(plate).z_land);
        EXPECT_EQ(std::remainder(bead.center_mm.x(), 20), 0);
    }
    EXPECT_THAT(beadsOnPlate(2, 3, 60, plate).error().message(), testing::HasSubstr("spacing_mm: found 2"));
    EXPECT_FALSE(beadsOnPlate(1, 0.5, 1e9, plate).ok());
}

// Held by the imager, their shadows lie where the true C-arm projects their centres.
TEST(CalibrationObjects, BeadsAppearWhereTheTrueCArmProjectsThem) {
    auto room = make(roomWithUnknowns());
    const auto beads = beadsOnPlate(40, 10, 0, {});
    ASSERT_OK(beads);
    const Rigid3 detector_from_plate = placedPlate({{9, -12}, 0.4});
    ASSERT_OK(room.hold(held(heldBeads("beads", *beads, HeldBy::imager, detector_from_plate, Material::aluminium))));
    const Image image = shoot(room, 0.7);
    const ViewTruth& view = truthOf(room).views.back();
    Vector2 sum = Vector2::Zero();
    double weight = 0;
    for (int y = 0; y < image.height(); ++y)
        for (int x = 0; x < image.width(); ++x) {
            const double t = -std::log(image(x, y));
            sum += t * Vector2(x, y);
            weight += t;
        }
    const Vector3 center = detector_from_plate * beads->beads[0].center_mm + Vector3(0, 0, view.carm.focal_length_mm);
    // A ball of 16 pixels under a distortion that bends by some pixels over 128.
    EXPECT_LT((sum / weight - view.carm.project(center)).norm(), 0.05);
}

// A limb with bone: along the axis through both, what lies there, summed by hand.
TEST(CalibrationObjects, TheLimbWeakensByWhatItIsMadeOf) {
    OperatingRoomOptions options = roomWithUnknowns().withoutErrors();
    LimbOptions limb;
    limb.bone_offset_mm = 0;
    limb.taper = 0;
    auto room = make(options);
    const auto parts = heldLimb(limb);
    ASSERT_OK(parts);
    for (const HeldObject& part : *parts) {
        EXPECT_OK(requireSolid(part.mesh, part.name));
        ASSERT_OK(room.hold(part));
    }
    const Image image = shoot(room);
    const double soft = 2 * (limb.half_width_mm.y() - limb.bone_radius_mm);
    const double bone = 2 * (limb.bone_radius_mm - limb.marrow_radius_mm), marrow = 2 * limb.marrow_radius_mm;
    const double expected = soft * attenuationPerMm(Material::softTissue) +
                            bone * attenuationPerMm(Material::corticalBone) + marrow * attenuationPerMm(Material::fat);
    // The beam at zero angles runs along y of the room, half a pixel off the axis; sides of 96 facets.
    EXPECT_NEAR(-std::log(image(127, 127)), expected, 2e-3 * expected);
    limb.bone_radius_mm = 0;
    EXPECT_EQ(heldLimb(limb)->size(), 1u);
    limb.axis_in_room.setZero();
    EXPECT_FALSE(heldLimb(limb).ok());
}

TEST(CalibrationObjects, ClampsAndScrewsAreSolids) {
    const std::vector<HeldObject> halves = clamp("clamp", HeldBy::imager, {});
    ASSERT_EQ(halves.size(), 2u);
    for (const HeldObject& half : halves) {
        const MeshProperties properties = meshProperties(half.mesh);
        EXPECT_OK(requireSolid(properties, half.name));
        EXPECT_GT(properties.volume_mm3, 0);
        EXPECT_LT(std::max(properties.max_corner.z(), -properties.min_corner.z()), 5);
        const double length = properties.max_corner.x() - properties.min_corner.x();
        EXPECT_GT(length, 140);
        EXPECT_LT(length, 165);
    }
    // The halves do not reach into each other.
    EXPECT_LT(meshProperties(halves[0].mesh).max_corner.z(), meshProperties(halves[1].mesh).min_corner.z() + 1e-9);
    const HeldObject one = screw("screw", 40, HeldBy::room, {});
    const MeshProperties properties = meshProperties(one.mesh);
    EXPECT_OK(requireSolid(properties, one.name));
    EXPECT_NEAR(properties.max_corner.z() - properties.min_corner.z(), 40, 1e-9);
}

}  // namespace
}  // namespace fluorocut
