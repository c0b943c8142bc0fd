#include "core/registration/hand_eye_file.h"

#include <fstream>

#include <gmock/gmock.h>

#include "core/io/pose_file.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using testing::HasSubstr;

constexpr const char* kIdentity = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
constexpr const char* kMoved = "[[1,0,0,5],[0,1,0,6],[0,0,1,700],[0,0,0,1]]";

class HandEyeFileTest : public testing::Test {
  protected:
    Result<HandEyeFile> read(const std::string& observations, const std::string& more = "") {
        std::ofstream(scratch_ / "file.json")
            << R"({"schema": "fluorocut/hand-eye/1", )" << more << R"("observations": [)" << observations << "]}";
        return readHandEyeFile(scratch_ / "file.json");
    }
    std::string message(const std::string& observations, const std::string& more = "") {
        const Result<HandEyeFile> file = read(observations, more);
        return file ? "no error" : file.error().message();
    }
    static std::string pair(const std::string& more = "") {
        return std::string(R"({"robot_from_flange": )") + kIdentity + R"(, "imager_from_corkscrew": )" + kMoved + more +
               "}";
    }
    test::ScratchFolder scratch_;
};

TEST_F(HandEyeFileTest, MatricesAndDefaults) {
    const Result<HandEyeFile> file = read(pair() + "," + pair(R"(, "name": "b", "imager": "lateral")"));
    ASSERT_OK(file);
    ASSERT_EQ(file->entries.size(), 2u);
    const HandEyeObservation& first = file->entries[0].observation;
    EXPECT_EQ(first.name, "observation 1");
    EXPECT_EQ(first.imager, "imager");
    EXPECT_FALSE(first.covariance);
    EXPECT_EQ(first.imager_from_corkscrew.translation(), Vector3(5, 6, 700));
    EXPECT_EQ(file->entries[1].observation.name, "b");
    EXPECT_EQ(file->entries[1].observation.imager, "lateral");
}

TEST_F(HandEyeFileTest, PoseFilesBringTheirCovariance) {
    Pose pose{Frame::imager, Frame::corkscrew, Rigid3::fromTranslation({1, 2, 3}), Matrix6(0.5 * Matrix6::Identity())};
    ASSERT_OK(writePose(scratch_ / "pose.json", pose));
    ASSERT_OK(writePose(scratch_ / "robot.json",
                        {Frame::robot, Frame::flange, Rigid3::fromTranslation({4, 5, 6}), std::nullopt}));
    const std::string one = R"({"robot_from_flange_file": "robot.json", "imager_from_corkscrew_file": "pose.json"})";
    const Result<HandEyeFile> file = read(one);
    ASSERT_OK(file);
    const HandEyeObservation& seen = file->entries[0].observation;
    EXPECT_EQ(seen.robot_from_flange.translation(), Vector3(4, 5, 6));
    ASSERT_TRUE(seen.covariance);
    EXPECT_EQ((*seen.covariance)(3, 3), 0.5);
    EXPECT_EQ(file->inputs.size(), 2u);
    // The two exchanged.
    EXPECT_THAT(message(R"({"robot_from_flange_file": "pose.json", "imager_from_corkscrew_file": "robot.json"})"),
                HasSubstr("robot_from_flange"));
}

TEST_F(HandEyeFileTest, ImagesNameTheirCArmAndCorkscrew) {
    const std::string image = std::string(R"({"robot_from_flange": )") + kIdentity + R"(, "image": "a.png"})";
    const Result<HandEyeFile> file = read(image, R"("carm": "c.json", "corkscrew": "k.json", )");
    ASSERT_OK(file);
    EXPECT_EQ(file->entries[0].image, scratch_ / "a.png");
    EXPECT_EQ(file->entries[0].carm, scratch_ / "c.json");
    EXPECT_EQ(file->corkscrew, scratch_ / "k.json");
    EXPECT_EQ(file->entries[0].observation.name, "a.png");
    EXPECT_THAT(message(image), HasSubstr("carm"));
    EXPECT_THAT(message(image, R"("carm": "c.json", )"), HasSubstr("corkscrew"));
}

TEST_F(HandEyeFileTest, WhatIsWrongIsNamed) {
    EXPECT_THAT(message(""), HasSubstr("0 observations"));
    EXPECT_THAT(message(pair(R"(, "image": "a.png")")), HasSubstr("2 ways"));
    EXPECT_THAT(message(R"({"imager_from_corkscrew": )" + std::string(kMoved) + "}"), HasSubstr("robot_from_flange"));
    EXPECT_THAT(message(pair(R"(, "nmae": "x")")), HasSubstr("nmae"));
    EXPECT_THAT(message(pair(R"(, "name": "x")") + "," + pair(R"(, "name": "x")")), HasSubstr("second time"));
    EXPECT_THAT(message(pair(R"(, "covariance": [[1]])")), HasSubstr("covariance"));
    EXPECT_THAT(
        message(R"({"robot_from_flange": [[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "imager_from_corkscrew": )" +
                std::string(kMoved) + "}"),
        HasSubstr("robot_from_flange"));
    EXPECT_THAT(
        message(R"({"robot_from_flange_file": "none.json", "imager_from_corkscrew": )" + std::string(kMoved) + "}"),
        HasSubstr("none.json"));
}

}  // namespace
}  // namespace fluorocut
