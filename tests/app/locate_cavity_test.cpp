// locate-cavity, from the command line: cut, image, locate.
#include <fstream>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "core/base/units.h"
#include "core/geometry/primitives.h"
#include "core/imaging/standard_views.h"
#include "core/io/mesh_file.h"
#include "core/io/pose_file.h"
#include "tests/app/cli.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::cli;
using test::errorMessage;
using test::onlyJson;
using testing::HasSubstr;

TEST(LocateCavityTest, SlowFindsTheCutThatTheCommandsMade) {
    const test::ScratchFolder scratch;
    const auto path = [&](const std::string& name) { return (scratch / name).string(); };
    StemShape shape;
    shape.segments = 48;
    shape.sections = 40;
    ASSERT_OK(writeMesh(path("stem.stl"), makeStem(shape)));
    // The built-in femur's shaft runs along z below the origin.
    const Rigid3 planned = Rigid3::fromTranslation({3, 0, 25});
    Vector6 off;
    off << 1.2, -0.8, 1.0, radiansFromDegrees(1), 0, radiansFromDegrees(2);
    const Rigid3 truth = planned.perturbed(off);
    const auto write = [&](const std::string& name, Frame target, Frame source, const Rigid3& pose) {
        ASSERT_OK(writePose(path(name), {target, source, pose, std::nullopt}));
    };
    write("plan.json", Frame::femur, Frame::cavity, planned);
    write("true.json", Frame::femur, Frame::cavity, truth);
    std::ofstream(path("carm.json"))
        << R"({"schema": "fluorocut/carm/1", "name": "c", "columns": 512, "rows": 512, "pixel_mm": [0.45, 0.45],
               "focal_length_mm": 1000, "principal_point_px": [255.5, 255.5], "distortion": null})";
    ASSERT_EQ(cli({"phantom", "femur", "-o", path("ct.nrrd")}).exit_code, 0);
    ASSERT_EQ(cli({"cut-volume", "--ct", path("ct.nrrd"), "--mesh", path("stem.stl"), "--femur-from-cavity",
                   path("true.json"), "-o", path("cut.nrrd")})
                  .exit_code,
              0);
    const Vector3 middle = planned * Vector3(0, 0, -50);
    std::vector<std::string> command{"locate-cavity",    "--cavity", path("stem.stl"), "--femur-from-cavity",
                                     path("plan.json"),  "--ct",     path("ct.nrrd"),  "-o",
                                     path("found.json"), "--json"};
    for (const int v : {1, 2}) {
        const std::string pose = fmt::format("pose{}.json", v), before = path(fmt::format("before{}.tif", v)),
                          after = path(fmt::format("after{}.tif", v));
        const Rigid3 turn = Rigid3::fromTranslation(middle) *
                            Rigid3::fromRotationVector({0, 0, radiansFromDegrees(v == 1 ? -30 : 30)}) *
                            Rigid3::fromTranslation(-middle);
        write(pose, Frame::imager, Frame::femur, standardView(StandardView::ap, middle, 700) * turn);
        for (const auto& [ct, image] : {std::pair{path("ct.nrrd"), before}, {path("cut.nrrd"), after}}) {
            ASSERT_EQ(cli({"drr", "--ct", ct, "--carm", path("carm.json"), "--pose", path(pose), "-o", image,
                           "--output", "intensity", "--photons", "20000", "--blur-px", "0.7", "--seed", "7"})
                          .exit_code,
                      0);
        }
        command.insert(command.end(), {"--view", before + "," + after + "," + path("carm.json") + "," + path(pose) +
                                                     "," + path(pose)});
    }
    const test::Finished finished = cli(command);
    ASSERT_EQ(finished.exit_code, 0) << finished.err << finished.out;
    const nlohmann::json json = onlyJson(finished);
    EXPECT_EQ(json["covariance"].size(), 6U);
    EXPECT_EQ(json["views"].size(), 2U);
    const Result<Pose> found = readPose(path("found.json"), Frame::femur, Frame::cavity);
    ASSERT_OK(found);
    const Vector6 error = found->target_from_source.deltaFrom(truth);
    // The mean error of many such cuts is 0.024 mm and 0.135 degrees.
    EXPECT_LT(error.head<3>().norm(), 0.15);
    EXPECT_LT(degreesFromRadians(error.tail<3>().norm()), 0.6);
    ASSERT_TRUE(found->covariance.has_value());

    for (const nlohmann::json& view : json["views"])
        EXPECT_LT(view["contour_residual_px"].get<double>(), 4);

    // The paper's method, from the images alone: it tells what it does not see, and is not accepted for that.
    std::vector<std::string> paper = command;
    paper[5] = "--method";
    paper[6] = "paper";
    paper[8] = path("paper.json");
    const test::Finished by_paper = cli(paper);
    EXPECT_NE(by_paper.exit_code, 0);
    const nlohmann::json seen = onlyJson(by_paper);
    EXPECT_EQ(seen["method"], "paper");
    EXPECT_EQ(seen["rank"], 5);
    EXPECT_THAT(seen["unobservable"].dump(), HasSubstr("the rotation about the cavity's axis"));
    EXPECT_LT(seen["views"][0]["contour_residual_px"].get<double>(), 4);
    EXPECT_LT(seen["offset_mm"].get<double>(), 3);

    // Nothing was cut: the answer is not accepted.
    for (std::string& argument : command) {
        for (std::size_t at = argument.find("after"); at != std::string::npos; at = argument.find("after", at))
            argument.replace(at, 5, "before");
    }
    command[8] = path("none.json");
    EXPECT_NE(cli(command).exit_code, 0);
}

TEST(LocateCavityTest, KnowsItsMethods) {
    const test::Finished finished = cli({"locate-cavity", "--view", "a,b,c,d,e", "--cavity", "c.stl",
                                         "--femur-from-cavity", "p.json", "--method", "guess", "--json"});
    EXPECT_EQ(finished.exit_code, 2);
    EXPECT_THAT(finished.out + finished.err, HasSubstr("paper"));
}

TEST(LocateCavityTest, NamesWhatIsWrongWithAView) {
    const test::Finished finished = cli({"locate-cavity", "--view", "a.png,b.png", "--cavity", "c.stl",
                                         "--femur-from-cavity", "p.json", "--ct", "femur", "--json"});
    EXPECT_EQ(finished.exit_code, 2);
    EXPECT_THAT(errorMessage(finished, "invalidOption"), HasSubstr("BEFORE,AFTER,CARM,POSE_BEFORE,POSE_AFTER"));
}

}  // namespace
}  // namespace fluorocut
