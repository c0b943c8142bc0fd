#include "core/io/json_file.h"

#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

#include "core/io/pose_file.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using ::testing::HasSubstr;

JsonObject parsed(std::string_view text) {
    Result<JsonObject> object = parseJson(text, "layout.json", "test/1");
    if (!object) throw std::runtime_error(object.error().message());
    return *object;
}

TEST(Json, GivesWhatTheFileHolds) {
    JsonObject file = parsed(R"({"schema": "test/1", "name": "plate", "n": 12, "size": [1.5, -2], "on": true,
        "rings": [{"x_mm": -3}, {"x_mm": 4e1}], "material": {"rod": "steel"}, "map": null, "grid": [[1, 2, 3], [4, 5, 6]],
        "kind": "two", "names": ["a", "b"]})");
    EXPECT_EQ(file.text("name"), "plate");
    EXPECT_EQ(file.integer("n", 0, 12), 12);
    EXPECT_EQ(file.vector<2>("size"), Vector2(1.5, -2));
    EXPECT_TRUE(file.boolean("on"));
    std::vector<double> x;
    for (JsonObject ring : file.objects("rings"))
        x.push_back(ring.number("x_mm"));
    EXPECT_EQ(x, (std::vector<double>{-3, 40}));
    EXPECT_EQ(file.object("material").text("rod"), "steel");
    EXPECT_EQ(file.optionalText("map"), std::nullopt);
    EXPECT_EQ(file.matrix("grid", 2, 3)(1, 0), 4);
    EXPECT_EQ(file.choice("kind", {"one", "two"}), 1u);
    EXPECT_EQ(file.texts("names"), (std::vector<std::string>{"a", "b"}));
    EXPECT_EQ(file.numberOr("absent", 7), 7);
    EXPECT_OK(file.finish());
}

TEST(Json, NamesTheFirstThingThatIsWrong) {
    const auto message = [](std::string_view text, auto read) {
        JsonObject file = parsed(text);
        read(file);
        const Result<void> result = file.finish();
        EXPECT_FALSE(result.ok()) << text;
        if (result.ok()) return std::string();
        EXPECT_EQ(result.error().code, ErrorCode::invalidInput);
        return result.error().message();
    };
    EXPECT_THAT(message(R"({"schema": "test/1"})", [](JsonObject& f) { f.number("radius_mm"); }),
                HasSubstr("layout.json, field radius_mm: found nothing"));
    EXPECT_THAT(message(R"({"schema": "test/1", "r": "x"})", [](JsonObject& f) { f.number("r"); }),
                HasSubstr("field r: found \"x\", expected a number"));
    EXPECT_THAT(message(R"({"schema": "test/1", "r": -1})", [](JsonObject& f) { f.number("r", 0, 5); }),
                HasSubstr("found -1, expected a number from 0 to 5"));
    EXPECT_THAT(message(R"({"schema": "test/1", "n": 1.5})", [](JsonObject& f) { f.integer("n"); }),
                HasSubstr("whole number"));
    EXPECT_THAT(message(R"({"schema": "test/1", "n": 1e300})", [](JsonObject& f) { f.integer("n"); }),
                HasSubstr("whole number"));
    EXPECT_THAT(message(R"({"schema": "test/1", "v": [1, true]})", [](JsonObject& f) { f.vector<2>("v"); }),
                HasSubstr("field v[1]: found true"));
    EXPECT_THAT(message(R"({"schema": "test/1", "v": [1, 2, 3]})", [](JsonObject& f) { f.vector<2>("v"); }),
                HasSubstr("array of 2 numbers"));
    EXPECT_THAT(message(R"({"schema": "test/1", "rings": [{"x": 1}, {"x": null}]})",
                        [](JsonObject& f) {
                            for (JsonObject ring : f.objects("rings"))
                                ring.number("x");
                        }),
                HasSubstr("field rings[1].x: found null"));
    EXPECT_THAT(message(R"({"schema": "test/1", "radius": 1, "raduis": 2})", [](JsonObject& f) { f.number("radius"); }),
                HasSubstr("field raduis: found a field that is not known, expected only radius, schema"));
    EXPECT_THAT(
        message(R"({"schema": "test/1", "a": {"b": 1, "c": 2}})", [](JsonObject& f) { f.object("a").number("b"); }),
        HasSubstr("field a.c"));
    EXPECT_THAT(message(R"({"schema": "test/1", "a": 1})", [](JsonObject& f) { f.object("a").number("b"); }),
                HasSubstr("field a: found 1, expected an object"));
    EXPECT_THAT(message(R"({"schema": "test/1", "a": 1})",
                        [](JsonObject& f) {
                            f.fail("a", "first", "x");
                            f.number("b");
                        }),
                HasSubstr("found first"));
}

TEST(Json, RefusesTextThatIsNotStrictJson) {
    const std::string deep = std::string(100000, '[') + std::string(100000, ']');
    for (const std::string& text :
         {std::string(""), std::string("{"), std::string("[1]"), std::string("{\"schema\": 1}"),
          std::string(R"({"schema": "test/2"})"), std::string(R"({"a": 1})"),
          std::string(R"({"schema": "test/1", "r": NaN})"), std::string(R"({"schema": "test/1", "r": 1e999})"),
          std::string(R"({"schema": "test/1", "r": 1, "r": 2})"),
          std::string("{\"schema\": \"test/1\", \"r\": \"\xff\"}"), R"({"schema": "test/1", "r": )" + deep + "}"}) {
        const Result<JsonObject> object = parseJson(text, "layout.json", "test/1");
        ASSERT_FALSE(object.ok()) << text.substr(0, 60);
        EXPECT_EQ(object.error().code, ErrorCode::invalidInput);
        EXPECT_THAT(object.error().message(), HasSubstr("layout.json"));
        EXPECT_LT(object.error().message().size(), 500u);
    }
}

std::string poseText(std::string_view matrix, std::string_view more = "") {
    return R"({"schema": "fluorocut/pose/1", "target": "imager", "source": "femur", "matrix": )" + std::string(matrix) +
           std::string(more) + "}";
}

Result<Pose> poseOf(const std::string& text) {
    const test::ScratchFolder scratch;
    std::ofstream(scratch / "pose.json") << text;
    return readPose(scratch / "pose.json");
}

TEST(PoseFile, ReturnsWhatWasWritten) {
    const test::ScratchFolder scratch;
    Pose pose{Frame::robot, Frame::corkscrew,
              Rigid3::fromTwistRollPitch(0.3, -0.2, 2.5).perturbed((Vector6() << 10, -20, 700, 0, 0, 0).finished()),
              std::nullopt};
    ASSERT_OK(writePose(scratch / "a.json", pose));
    Result<Pose> read = readPose(scratch / "a.json", Frame::robot, Frame::corkscrew);
    ASSERT_OK(read);
    // numbers are written so that they are read back exactly; the rotation passes through a matrix
    EXPECT_LT(read->target_from_source.deltaFrom(pose.target_from_source).norm(), 1e-12);
    EXPECT_FALSE(read->covariance.has_value());

    Matrix6 root;
    for (int i = 0; i < 36; ++i)
        root(i) = 0.01 * ((i * 7) % 11) - 0.03;
    pose.covariance = root * root.transpose();
    ASSERT_OK(writePose(scratch / "b.json", pose));
    read = readPose(scratch / "b.json");
    ASSERT_OK(read);
    EXPECT_LT((*read->covariance - *pose.covariance).norm(), 1e-15);

    const Result<Pose> other = readPose(scratch / "b.json", Frame::imager, Frame::femur);
    ASSERT_FALSE(other.ok());
    EXPECT_THAT(other.error().message(), HasSubstr("found the pose robot_from_corkscrew, expected imager_from_femur"));
}

TEST(PoseFile, ReadsRowsOfAMatrixThatActsOnColumnVectors) {
    const Result<Pose> pose = poseOf(poseText("[[0,-1,0,5],[1,0,0,6],[0,0,1,7],[0,0,0,1]]"));
    ASSERT_OK(pose);
    EXPECT_LT((pose->target_from_source * Vector3(1, 0, 0) - Vector3(5, 7, 7)).norm(), 1e-12);
}

TEST(PoseFile, RefusesWhatIsNotARigidMotion) {
    const auto message = [](const std::string& text) {
        const Result<Pose> pose = poseOf(text);
        EXPECT_FALSE(pose.ok()) << text;
        return pose.ok() ? std::string() : pose.error().message();
    };
    EXPECT_THAT(message(poseText("[[1,0,0,5],[0,1.001,0,6],[0,0,1,7],[0,0,0,1]]")), HasSubstr("orthonormal"));
    EXPECT_THAT(message(poseText("[[1,0,0,5],[0,1,0,6],[0,0,-1,7],[0,0,0,1]]")), HasSubstr("mirrors"));
    EXPECT_THAT(message(poseText("[[1,0,0,0],[0,1,0,0],[0,0,1,0],[5,6,7,1]]")), HasSubstr("last row 5 6 7 1"));
    EXPECT_THAT(message(poseText("[[1,0,0],[0,1,0],[0,0,1]]")), HasSubstr("4 rows of 4"));
    EXPECT_THAT(message(poseText("[[1,0,0,0],[0,1,0,0],[0,0,1,\"a\"],[0,0,0,1]]")), HasSubstr("matrix[2][3]"));
    const std::string identity = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
    EXPECT_OK(poseOf(poseText(identity)));
    EXPECT_OK(poseOf(poseText("[[0.707107,-0.707107,0,0],[0.707107,0.707107,0,0],[0,0,1,0],[0,0,0,1]]")));
    EXPECT_THAT(message(poseText(identity, R"(, "unit": "mm")")), HasSubstr("field unit"));
    EXPECT_THAT(
        message(R"({"schema": "fluorocut/pose/1", "target": "moon", "source": "femur", "matrix": )" + identity + "}"),
        HasSubstr("field target: found \"moon\""));
    std::ostringstream negative;
    for (int r = 0; r < 6; ++r) {
        negative << (r ? ",[" : ", \"covariance\": [[");
        for (int c = 0; c < 6; ++c)
            negative << (c ? "," : "") << (r == c ? -1 : 0);
        negative << "]";
    }
    negative << "]";
    EXPECT_THAT(message(poseText(identity, negative.str())), HasSubstr("negative variance"));
}

}  // namespace
}  // namespace fluorocut
