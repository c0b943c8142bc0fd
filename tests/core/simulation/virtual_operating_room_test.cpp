#include "core/simulation/virtual_operating_room.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>

#include <gtest/gtest.h>

#include "core/geometry/primitives.h"
#include "core/imaging/mesh_projector.h"
#include "core/simulation/truth.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

// A ball of bone in a box of soft tissue, 120 mm wide.
std::shared_ptr<const Volume> patient() {
    VolumeGrid grid;
    grid.size = {60, 60, 60};
    grid.spacing_mm = {2, 2, 2};
    grid.origin_mm = {40, -20, 100};
    auto volume = std::make_shared<Volume>(grid);
    for (int k = 0; k < 60; ++k)
        for (int j = 0; j < 60; ++j)
            for (int i = 0; i < 60; ++i)
                (*volume)(i, j, k) = (Vector3(i, j, k) - Vector3(25, 30, 35)).norm() < 12 ? 900.0f : 40.0f;
    return volume;
}

OperatingRoomOptions smallRoom(std::uint64_t seed = 1) {
    OperatingRoomOptions options;
    options.nominal_carm.columns = options.nominal_carm.rows = 128;
    options.nominal_carm.pixel_mm = {1.28, 1.28};
    options.nominal_carm.principal_point_px = {63.5, 63.5};
    options.seed = seed;
    return options;
}

ImageRequest at(double orbital_deg, double angulation_deg = 0) {
    ImageRequest request;
    request.position =
        CArmPosition{radiansFromDegrees(orbital_deg), radiansFromDegrees(angulation_deg), Vector3::Zero()};
    return request;
}

VirtualOperatingRoom make(std::shared_ptr<const Volume> volume, const OperatingRoomOptions& options) {
    auto room = VirtualOperatingRoom::create(std::move(volume), options);
    if (!room) throw std::runtime_error(room.error().message());
    return std::move(*room);
}

Image shoot(VirtualOperatingRoom& room, const ImageRequest& request = {}) {
    auto acquired = room.acquire(request, Progress::none());
    if (!acquired) throw std::runtime_error(acquired.error().message());
    return std::move(acquired->image);
}

// Of -log(image), in pixels; the picture was taken without noise.
Vector2 shadowCentroid(const Image& image) {
    Vector2 sum = Vector2::Zero();
    double weight = 0;
    for (int y = 0; y < image.height(); ++y) {
        for (int x = 0; x < image.width(); ++x) {
            const double path = -std::log(image(x, y));
            sum += path * Vector2(x, y);
            weight += path;
        }
    }
    return sum / weight;
}

double angleDeg(const Rigid3& motion) {
    return degreesFromRadians(motion.rotationAngle());
}

// With everything unknown at work but the noise, the picture is the projector's of the known truth, to float rounding.
TEST(VirtualOperatingRoom, WithoutNoiseShowsTheProjectionOfTheTruth) {
    OperatingRoomOptions options = smallRoom();
    options.xray = XrayOptions::ideal();
    auto room = make(patient(), options);
    const TriangleMesh rod = makeCylinder(4, 60, 32);
    HeldObject held;
    held.name = "rod";
    held.mesh = rod;
    held.material = Material::steel;
    held.displaces = Material::softTissue;
    held.holder = HeldBy::patient;
    held.holder_from_object = Rigid3::fromTranslation({110, 60, 150});
    ASSERT_OK(room.hold(held));

    const auto projector = VolumeProjector::prepare(patient(), {attenuationPerMm(Material::water)});
    const auto rod_projector = MeshProjector::prepare(rod);
    ASSERT_OK(projector);
    ASSERT_OK(rod_projector);
    for (const double orbital : {0.0, 50.0, -90.0}) {
        const Image image = shoot(room, at(orbital, 10));
        const ViewTruth& view = truthOf(room).views.back();
        EXPECT_NE(view.carm.distortion, nullptr);
        EXPECT_NE(view.carm.focal_length_mm, options.nominal_carm.focal_length_mm);
        const Image bone = projector->project(view.carm, view.imager_from_femur);
        const Image path = rod_projector->project(view.carm, view.imager_from_femur * held.holder_from_object,
                                                  {options.samples_per_axis});
        const double mu = attenuationPerMm(Material::steel) - attenuationPerMm(Material::softTissue);
        double shadow = 0;
        for (std::size_t i = 0; i < image.size(); ++i) {
            const double expected = std::exp(-(bone.pixels()[i] + mu * path.pixels()[i]));
            ASSERT_NEAR(image.pixels()[i], expected, 1e-5 * expected + 1e-7);
            shadow = std::max(shadow, mu * path.pixels()[i]);
        }
        EXPECT_GT(shadow, 3);  // the rod is in the picture
    }
}

// Closed form: a slab across the axis, -log of the picture at the image centre is mu times its thickness.
TEST(VirtualOperatingRoom, AnObjectWeakensByItsMaterial) {
    for (const Material material : {Material::acrylic, Material::aluminium, Material::titanium}) {
        auto room = make(nullptr, smallRoom().withoutErrors());
        HeldObject slab;
        slab.name = "slab";
        slab.mesh = makeBox({200, 12, 200});
        slab.material = material;
        ASSERT_OK(room.hold(slab));
        const Image image = shoot(room, at(0));
        EXPECT_NEAR(-std::log(image(63, 63)), 12 * attenuationPerMm(material), 1e-4) << name(material);
    }
}

// Water put in the place of water changes nothing; without saying so it would add.
TEST(VirtualOperatingRoom, ADisplacedMaterialIsTakenAway) {
    VolumeGrid grid;
    grid.size = {40, 40, 40};
    grid.spacing_mm = {3, 3, 3};
    auto room = make(std::make_shared<Volume>(grid, 0.0f), smallRoom().withoutErrors());
    const Image before = shoot(room, at(0));
    HeldObject ball;
    ball.name = "ball";
    ball.mesh = makeSphere(15, 3);
    ball.material = Material::water;
    ball.displaces = Material::water;
    ASSERT_OK(room.hold(ball));
    EXPECT_EQ(shoot(room), before);
    ASSERT_OK(room.release("ball"));
    ball.displaces.reset();
    ASSERT_OK(room.hold(ball));
    const Image added = shoot(room);
    EXPECT_NEAR(std::log(before(63, 63) / added(63, 63)), 30 * attenuationPerMm(Material::water), 0.01);
}

// Small balls held in the room appear where the true C-arm, its bent picture included, projects their middles. The
// shadow's centroid lies within a tenth of a pixel: pixels of 1.28 mm, a ball of 9 pixels.
TEST(VirtualOperatingRoom, ObjectsAppearWhereTheTrueCArmProjectsThem) {
    OperatingRoomOptions options = smallRoom(5);
    options.xray = XrayOptions::ideal();
    options.samples_per_axis = 4;
    options.return_offset_mm = 20;
    options.robot_offset_mm = 5;
    options.robot_rotation_rad = 0.01;  // over 850 mm
    for (const Vector3& place : {Vector3(0, 0, 0), Vector3(15, 10, -15), Vector3(-15, 0, 18)}) {
        for (const HeldBy holder : {HeldBy::room, HeldBy::robot}) {
            auto room = make(nullptr, options);
            HeldObject ball;
            ball.name = "ball";
            ball.mesh = makeSphere(4, 3);
            ball.material = Material::aluminium;
            ball.holder = holder;
            // The robot was planned 800 mm away: reach from there into the beam.
            ball.holder_from_object = Rigid3::fromTranslation(
                holder == HeldBy::room ? place : options.planned_room_from_robot.inverse() * place);
            ASSERT_OK(room.hold(ball));
            const Image image = shoot(room, at(40));
            const ViewTruth& view = truthOf(room).views.back();
            const Rigid3 imager_from_holder = holder == HeldBy::room ? view.imager_from_room : view.imager_from_robot;
            const Vector2 expected = view.carm.project(imager_from_holder * ball.holder_from_object.translation());
            ASSERT_GT(expected.minCoeff(), 8);  // the ball is wholly in the picture
            ASSERT_LT(expected.maxCoeff(), 119);
            EXPECT_LT((shadowCentroid(image) - expected).norm(), 0.1);
        }
    }
}

// The same for the CT: a soft ball in the patient (Gaussian, 5 mm) lies where the true C-arm projects its middle.
TEST(VirtualOperatingRoom, ThePatientAppearsWhereTheTrueCArmProjectsIt) {
    VolumeGrid grid;
    grid.size = {48, 48, 48};
    grid.origin_mm = {-120, 30, 700};
    auto volume = std::make_shared<Volume>(grid, -1000.0f);
    const Vector3 middle(22.3, 24.6, 23.1);
    for (int k = 0; k < 48; ++k)
        for (int j = 0; j < 48; ++j)
            for (int i = 0; i < 48; ++i)
                (*volume)(i, j, k) +=
                    static_cast<float>(2000 * std::exp(-0.5 * (Vector3(i, j, k) - middle).squaredNorm() / 25));
    for (const ProjectionMethod method : {ProjectionMethod::fast, ProjectionMethod::exact}) {
        OperatingRoomOptions options = smallRoom(9);
        options.xray = XrayOptions::ideal();
        options.projection = method;
        auto room = make(volume, options);
        for (const double orbital : {0.0, 60.0}) {
            const Image image = shoot(room, at(orbital, -15));
            const ViewTruth& view = truthOf(room).views.back();
            ASSERT_NE(view.carm.distortion, nullptr);
            const Vector2 expected = view.carm.project(view.imager_from_femur * grid.pointFromIndex(middle));
            EXPECT_LT((shadowCentroid(image) - expected).norm(), 0.1) << "orbital angle " << orbital;
        }
    }
}

// 200 visits: any two within 4 cm and 5 degrees, and far from all alike. Two uniform points in a ball of 2 cm lie 36/35
// * 2 cm apart on average.
TEST(VirtualOperatingRoom, ReturnsWithinItsRepeatabilityAndNotBetter) {
    OperatingRoomOptions options = smallRoom();
    options.nominal_carm.columns = options.nominal_carm.rows = 8;
    auto room = make(nullptr, options);
    for (int visit = 0; visit < 200; ++visit)
        (void)shoot(room, at(30, 10));
    const auto& views = truthOf(room).views;
    ASSERT_EQ(views.size(), 200u);
    const Vector3 isocentre(0, 0, options.source_to_isocentre_mm);
    double mean_offset = 0, largest_offset = 0, mean_angle = 0, largest_angle = 0;
    for (std::size_t a = 0; a < 200; ++a) {
        for (std::size_t b = 0; b < a; ++b) {
            const Rigid3 motion = views[a].imager_from_room.inverse() * views[b].imager_from_room;
            const double offset =
                (views[a].imager_from_room.inverse() * isocentre - views[b].imager_from_room.inverse() * isocentre)
                    .norm();
            const double angle = angleDeg(motion);
            mean_offset += offset / 19900;
            mean_angle += angle / 19900;
            largest_offset = std::max(largest_offset, offset);
            largest_angle = std::max(largest_angle, angle);
        }
    }
    EXPECT_LE(largest_offset, 40);
    EXPECT_LE(largest_angle, 5);
    EXPECT_GT(largest_offset, 32);
    EXPECT_GT(largest_angle, 4);
    EXPECT_NEAR(mean_offset, 36.0 / 35 * 20, 1.5);
    EXPECT_NEAR(mean_angle, 36.0 / 35 * 2.5, 0.2);
}

TEST(VirtualOperatingRoom, StaysWhereItStandsUnlessAskedToMove) {
    auto room = make(patient(), smallRoom());
    (void)shoot(room, at(20));
    const Image first = shoot(room);
    const Image second = shoot(room);
    const auto& views = truthOf(room).views;
    ASSERT_EQ(views.size(), 3u);
    EXPECT_EQ(views[1].imager_from_room.matrix(), views[0].imager_from_room.matrix());
    EXPECT_EQ(views[2].carm.distortion, views[0].carm.distortion);
    EXPECT_NE(first, second);  // another exposure: other noise
    (void)shoot(room, at(20));
    EXPECT_GT((views[3].imager_from_room.matrix() - views[0].imager_from_room.matrix()).norm(), 0.1);
}

TEST(VirtualOperatingRoom, SameSeedSameImagesOtherSeedOthers) {
    auto a = make(patient(), smallRoom(7)), b = make(patient(), smallRoom(7)), c = make(patient(), smallRoom(8));
    for (const auto& request : {at(0), at(50), ImageRequest{}}) {
        const Image image = shoot(a, request);
        EXPECT_EQ(shoot(b, request), image);
        EXPECT_NE(shoot(c, request), image);
    }
    EXPECT_GT((truthOf(a).room_from_femur.translation() - truthOf(c).room_from_femur.translation()).norm(), 0.1);
}

// Every unknown lies within its limit and is not always nothing.
TEST(VirtualOperatingRoom, DrawsItsUnknownsWithinTheirLimits) {
    const OperatingRoomOptions limits = smallRoom();
    double offset = 0, turn = 0, focal = 0, center = 0, robot = 0;
    for (std::uint64_t seed = 0; seed < 60; ++seed) {
        OperatingRoomOptions options = smallRoom(seed);
        options.nominal_carm.columns = options.nominal_carm.rows = 8;
        auto room = make(patient(), options);
        (void)shoot(room, at(0));
        const Truth& truth = truthOf(room);
        const Vector3 middle = patient()->grid().center();
        offset = std::max(offset, (truth.room_from_femur * middle).norm());
        turn = std::max(turn, truth.room_from_femur.rotationAngle());
        robot = std::max(robot,
                         (truth.room_from_robot.translation() - options.planned_room_from_robot.translation()).norm());
        const CArm& carm = truth.views[0].carm;
        focal = std::max(focal, std::abs(carm.focal_length_mm - options.nominal_carm.focal_length_mm));
        center =
            std::max(center, (carm.principal_point_px - options.nominal_carm.principal_point_px).cwiseAbs().maxCoeff());
    }
    const auto expectWithin = [](double largest, double limit) {  // the largest of 60 comes near it and stays below
        EXPECT_LE(largest, limit);
        EXPECT_GT(largest, 0.7 * limit);
    };
    expectWithin(offset, limits.patient_offset_mm);
    expectWithin(turn, limits.patient_rotation_rad);
    expectWithin(robot, limits.robot_offset_mm);
    expectWithin(center, limits.principal_point_error_px);
    expectWithin(focal, limits.focal_length_error_mm + limits.focal_length_sag_mm);
}

TEST(VirtualOperatingRoom, FocalLengthAndDistortionChangeWithThePose) {
    auto room = make(nullptr, smallRoom());
    (void)shoot(room, at(0));
    (void)shoot(room, at(180));
    const auto& views = truthOf(room).views;
    // The beam rises at 0 and falls at 180 degrees: twice the sag between them, but for the 2.5 degrees of positioning.
    EXPECT_NEAR(views[1].carm.focal_length_mm - views[0].carm.focal_length_mm, 4, 0.02);
    const Vector2 corner(20, 20);
    EXPECT_GT((views[0].carm.distortedPixel(corner) - views[1].carm.distortedPixel(corner)).norm(), 0.5);
}

TEST(VirtualOperatingRoom, TellsOnlyWhatARealCArmKnows) {
    const OperatingRoomOptions options = smallRoom();
    auto room = make(patient(), options);
    const auto acquired = room.acquire(at(30, -15), Progress::none());
    ASSERT_OK(acquired);
    EXPECT_EQ(acquired->nominal_carm->focal_length_mm, options.nominal_carm.focal_length_mm);
    EXPECT_EQ(acquired->nominal_carm->principal_point_px, options.nominal_carm.principal_point_px);
    EXPECT_EQ(acquired->source_detector_mm, options.nominal_carm.focal_length_mm);
    EXPECT_EQ(acquired->nominal_position, at(30, -15).position);
}

TEST(VirtualOperatingRoom, MovesObjects) {
    auto room = make(nullptr, smallRoom().withoutErrors());
    HeldObject ball;
    ball.name = "ball";
    ball.mesh = makeSphere(5, 2);
    ASSERT_OK(room.hold(ball));
    const Image middle = shoot(room, at(0));
    EXPECT_LT(middle(63, 63), 0.1);
    ASSERT_OK(room.move("ball", Rigid3::fromTranslation({30, 0, 0})));
    EXPECT_FLOAT_EQ(shoot(room)(63, 63), 1);
    ASSERT_OK(room.move("ball", Rigid3()));
    EXPECT_EQ(shoot(room), middle);
    ASSERT_OK(room.release("ball"));
    EXPECT_FLOAT_EQ(shoot(room)(63, 63), 1);
}

TEST(VirtualOperatingRoom, SaysWhatIsWrong) {
    OperatingRoomOptions options = smallRoom();
    options.patient_offset_mm = NAN;
    EXPECT_EQ(options.validate().error().where, "patient_offset_mm");
    options = smallRoom();
    options.source_to_isocentre_mm = 1200;
    EXPECT_EQ(options.validate().error().where, "source_to_isocentre_mm");
    options = smallRoom();
    options.xray.bits = 3;
    EXPECT_EQ(VirtualOperatingRoom::create(nullptr, options).error().where, "bits");

    auto room = make(nullptr, smallRoom());
    HeldObject ball;
    ball.name = "ball";
    ball.mesh = makeSphere(5, 2);
    ASSERT_OK(room.hold(ball));
    EXPECT_EQ(room.hold(ball).error().code, ErrorCode::invalidOption);  // the name is taken
    ball.name = "open ball";
    ball.mesh.triangles.pop_back();
    EXPECT_EQ(room.hold(ball).error().code, ErrorCode::invalidInput);
    EXPECT_EQ(room.move("cube", Rigid3()).error().message(),
              "object: found \"cube\", expected the name of an object that is held in the room.");
    EXPECT_FALSE(room.release("cube").ok());
}

// After a cut: what is in the pictures is the new volume, where the old one was.
TEST(VirtualOperatingRoom, AnotherVolumeTakesThePatientsPlace) {
    OperatingRoomOptions options = smallRoom();
    options.xray = XrayOptions::ideal();
    auto room = make(patient(), options);
    const Rigid3 place = truthOf(room).room_from_femur;
    shoot(room, at(20));
    auto cut = std::make_shared<Volume>(*patient());
    for (float& hu : cut->voxels())
        hu = hu > 500 ? -1000.0f : hu;
    ASSERT_OK(room.setPatient(cut));
    const Image image = shoot(room);
    EXPECT_EQ(truthOf(room).room_from_femur.deltaFrom(place).norm(), 0);
    EXPECT_EQ(truthOf(room).patient, cut);
    const auto projector = VolumeProjector::prepare(cut, {attenuationPerMm(Material::water)});
    ASSERT_OK(projector);
    const ViewTruth& view = truthOf(room).views.back();
    const Image expected = projector->project(view.carm, view.imager_from_femur);
    for (std::size_t i = 0; i < image.size(); ++i)
        ASSERT_NEAR(image.pixels()[i], std::exp(-expected.pixels()[i]), 1e-6);  // float rounding
    EXPECT_THROW((void)room.setPatient(nullptr), std::logic_error);
    auto empty = make(nullptr, options);
    EXPECT_THROW((void)empty.setPatient(cut), std::logic_error);
}

TEST(VirtualOperatingRoom, PicturesOfAnOccasionDoNotDependOnThoseOfAnother) {
    auto room = make(patient(), smallRoom());
    const Image first = shoot(room, at(0));
    room.beginOccasion(3);
    const Image third = shoot(room, at(0));
    EXPECT_NE(first, third);  // other returns, other noise
    auto other = make(patient(), smallRoom());
    shoot(other, at(0));
    shoot(other, at(40));
    other.beginOccasion(3);
    EXPECT_EQ(shoot(other, at(0)), third);
    EXPECT_EQ(truthOf(other).room_from_femur.deltaFrom(truthOf(room).room_from_femur).norm(), 0);
    other.beginOccasion(0);
    EXPECT_EQ(shoot(other, at(0)), first);
}

}  // namespace
}  // namespace fluorocut
