// register chain with the real program on images: the virtual operating room, a robot that holds the corkscrew beside
// beads, two views. Nothing but images, C-arm, robot poses, hand-eye pose and layouts goes in; the truth stays here.
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <numbers>
#include <stdexcept>

#include <gmock/gmock.h>

#include "core/base/units.h"
#include "core/fiducial/corkscrew_layout.h"
#include "core/imaging/carm_file.h"
#include "core/io/image_file.h"
#include "core/io/pose_file.h"
#include "core/io/resources.h"
#include "core/simulation/calibration_objects.h"
#include "core/simulation/corkscrew_objects.h"
#include "core/simulation/truth.h"
#include "tests/app/cli.h"
#include "tests/app/poses.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::cli;
using test::errorMessage;
using test::onlyJson;
using testing::HasSubstr;

template <class T>
T need(Result<T> result) {
    if (!result) throw std::runtime_error(result.error().message());
    return std::move(*result);
}
void need(const Result<void>& result) {
    if (!result) throw std::runtime_error(result.error().message());
}

class RegisterImagesTest : public testing::Test {
  protected:
    std::string path(const std::string& name) const { return (scratch_ / name).string(); }

    void SetUp() override {
        carm_.columns = carm_.rows = 640;
        carm_.principal_point_px = {319.5, 319.5};
        OperatingRoomOptions options;
        options.nominal_carm = carm_;
        options = options.withoutErrors();
        options.xray = XrayOptions::ideal(1000);
        options.xray.quantum_noise = true;
        options.xray.detector_blur_px = 0.7;
        room_ = std::make_unique<VirtualOperatingRoom>(need(VirtualOperatingRoom::create(nullptr, options)));
        // The femur's axis across the beam, down the picture.
        const Rigid3 seen = nominalImagerFromRoom({}, options.source_to_isocentre_mm);
        Matrix3 upright;
        upright << 1, 0, 0, 0, 0, -1, 0, 1, 0;
        const Rigid3 imager_from_femur(upright, {-25, 0, 680});
        room_from_femur_ = seen.inverse() * imager_from_femur;
        const Rigid3 imager_from_corkscrew =
            Rigid3::fromTranslation({22, 4, 690}) * Rigid3::fromTwistRollPitch(0.4, 0.2, std::numbers::pi / 2 + 0.1);
        const Rigid3 room_from_robot = truthOf(*room_).room_from_robot;
        robot_from_femur_ = room_from_robot.inverse() * room_from_femur_;
        mount_ = Rigid3(expRotation({0.3, 0.1, -0.2}), {5, 10, 120});
        robot_ = room_from_robot.inverse() * seen.inverse() * imager_from_corkscrew * mount_.inverse();

        const Vector3 places[] = {{9, -6, 38},  {-8, 7, 30},  {6, 11, 19},   {-9, -9, 8},   {10, -10, -3},
                                  {-9, 8, -12}, {10, 4, -22}, {-4, 11, -31}, {6, -11, -39}, {-9, 3, -46}};
        beads_.frame = Frame::femur;
        for (const Vector3& place : places) {
            Bead bead;
            bead.name = std::string("b").append(std::to_string(beads_.beads.size() + 1));
            bead.center_mm = place;
            beads_.beads.push_back(bead);
        }
        need(writeBeadLayout(path("beads.json"), beads_));
        need(writeCArm(path("carm.json"), carm_));
        Pose mount{Frame::flange, Frame::corkscrew, mount_, Matrix6(1e-8 * Matrix6::Identity())};
        need(writePose(path("mount.json"), mount));
        need(room_->hold(need(heldBeads("beads", beads_, HeldBy::room, room_from_femur_, Material::steel))));
        const CorkscrewLayout layout = need(readCorkscrew(need(findResource("fiducials", "corkscrew"))));
        for (HeldObject& part : need(heldCorkscrew("corkscrew", layout, HeldBy::robot, robot_ * mount_))) {
            parts_.push_back(part.name);
            need(room_->hold(part));
        }
    }

    // One exposure; the robot stands a little differently for each.
    std::string shoot(const std::string& name, double orbital_deg, double robot_turn_rad) {
        const Rigid3 robot = robot_ * Rigid3::fromRotationVector({0.3 * robot_turn_rad, 0, robot_turn_rad});
        for (const std::string& part : parts_)
            need(room_->move(part, robot * mount_));
        ImageRequest request;
        request.position = CArmPosition{radiansFromDegrees(orbital_deg), 0, Vector3::Zero()};
        const AcquiredImage image = need(room_->acquire(request, Progress::none()));
        ImageWriteOptions writing;
        writing.type = PixelType::float32;
        need(writeImage(scratch_ / (name + ".tiff"), image.image, writing));
        need(writePose(path(name + "_robot.json"), {Frame::robot, Frame::flange, robot, std::nullopt}));
        return viewOf(name, name);
    }
    std::string viewOf(const std::string& image, const std::string& robot) const {
        return path(image + ".tiff") + "," + path("carm.json") + "," + path(robot + "_robot.json");
    }

    test::Finished chain(const std::vector<std::string>& views, const std::string& command = "chain") const {
        std::vector<std::string> arguments{
            "register",         command, "--beads", path("beads.json"), "--flange-from-corkscrew",
            path("mount.json"), "--json"};
        for (const std::string& view : views) {
            arguments.emplace_back("--view");
            arguments.push_back(view);
        }
        return cli(arguments);
    }

    CArm carm_;
    BeadLayout beads_;
    std::unique_ptr<VirtualOperatingRoom> room_;
    std::vector<std::string> parts_;
    Rigid3 room_from_femur_, robot_from_femur_, mount_, robot_;
    test::ScratchFolder scratch_;
};

TEST_F(RegisterImagesTest, SlowChainFromImagesIsWhereTheFemurIs) {
    const std::string a = shoot("a", -25, 0), b = shoot("b", 30, 0.06);
    const test::Finished finished = chain({a, b});
    ASSERT_TRUE(finished.exit_code == 0 || finished.exit_code == 1) << finished.err;
    const nlohmann::json json = onlyJson(finished);
    const nlohmann::json& point = json["points"][0];
    EXPECT_EQ(point["name"], "beads' middle");
    const Vector3 middle(point["in_femur_mm"][0], point["in_femur_mm"][1], point["in_femur_mm"][2]);
    const Vector3 off = test::rigidOf(json["robot_from_femur"]) * middle - robot_from_femur_ * middle;
    const double radius95 = point["radius95_mm"];
    std::printf("error %.3f mm, stated 95 %% radius %.3f mm; %s\n", off.norm(), radius95,
                point["sentence"].get<std::string>().c_str());
    // Calibration and layouts are exact here, which the program does not know: well within what it states.
    EXPECT_LT(off.norm(), radius95);
    EXPECT_LT(off.norm(), 0.2);
    EXPECT_GT(json["probability"], 1e-3);
    // From the first image alone: where to look from next, and what the second view, 55 degrees on, would give. The
    // forecast knows nothing of how the corkscrew and the beads will look from there.
    const nlohmann::json advice = onlyJson(chain({a}, "advise"));
    EXPECT_LT(advice["next"]["worst_sd_mm"], advice["worst_sd_mm"]);
    EXPECT_GE(advice["next"]["turn_deg"], 14.9);
    double forecast = NAN;
    for (const auto& view : advice["grid"]) {
        if (std::abs(view["orbital_deg"].get<double>() - 55) < 1e-6 &&
            std::abs(view["angulation_deg"].get<double>()) < 1e-6)
            forecast = view["worst_sd_mm"];
    }
    std::printf("worst direction: %.3f mm with one view, %.3f forecast for both, %.3f with both\n",
                advice["worst_sd_mm"].get<double>(), forecast, point["worst_sd_mm"].get<double>());
    EXPECT_NEAR(forecast / point["worst_sd_mm"].get<double>(), 1, 0.2);

    // The same files with the robot's poses exchanged.
    const test::Finished swapped = chain({viewOf("a", "b"), viewOf("b", "a")});
    EXPECT_EQ(swapped.exit_code, 4);
    EXPECT_THAT(errorMessage(swapped, "noSolution"), HasSubstr("exchange the robot poses"));
    // Twice from one side.
    const std::string c = shoot("c", -22, 0.06);
    const test::Finished alike = chain({a, c});
    EXPECT_EQ(alike.exit_code, 4);
    EXPECT_THAT(errorMessage(alike, "noSolution"), HasSubstr("same direction"));
}

TEST_F(RegisterImagesTest, WrongUsageOfImages) {
    EXPECT_EQ(cli({"register", "chain", "--view", "a,b,c"}).exit_code, 2);
    EXPECT_EQ(chain({"image,carm"}).exit_code, 2);
    EXPECT_EQ(chain({"x.png," + path("carm.json") + ",y.json", "x.png," + path("carm.json") + ",z.json"}).exit_code, 2);
    EXPECT_EQ(chain({path("absent.png") + "," + path("carm.json") + "," + path("mount.json")}).exit_code, 3);
}

}  // namespace
}  // namespace fluorocut
