// case info, verify and export with the real program.
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>

#include "core/casestore/case_store.h"
#include "core/geometry/primitives.h"
#include "core/io/image_file.h"
#include "core/io/mesh_file.h"
#include "tests/app/cli.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using test::cli;
using test::errorMessage;
using test::onlyJson;
using testing::HasSubstr;

class CaseCommandTest : public testing::Test {
  protected:
    // An image, a mesh and a pose; a step from the image to the pose, accepted.
    void SetUp() override {
        Image image(7, 5, 12.0F);
        image(3, 2) = 4000;
        ASSERT_OK(writeImage(scratch_ / "ap.png", image));
        ASSERT_OK(writeMesh(scratch_ / "femur.stl", makeBox(Vector3(2, 3, 4))));
        Result<CaseStore> store = CaseStore::create(path_, "hip 7");
        ASSERT_OK(store);
        const auto picture = store->addItem({.kind = ItemKind::image, .schema = "image/png", .file_name = "ap.png"},
                                            textOf(scratch_ / "ap.png"));
        ASSERT_OK(picture);
        const auto mesh = store->addItem({.kind = ItemKind::mesh, .schema = "model/stl", .file_name = "femur.stl"},
                                         textOf(scratch_ / "femur.stl"));
        ASSERT_OK(mesh);
        const auto pose =
            store->addItem({.kind = ItemKind::pose, .schema = "fluorocut/pose/1", .file_name = "pose.json"}, kPose);
        ASSERT_OK(pose);
        Step step;
        step.name = "register";
        step.inputs = {{"ap", picture->hash}};
        step.options_json = R"({"limit_mm": 0.2})";
        step.result = pose->hash;
        step.started_utc = step.finished_utc = utcNow();
        const auto added = store->addStep(step);
        ASSERT_OK(added);
        ASSERT_OK(store->addDecision({.step = added->record, .accepted = true, .who = "A. Person", .why = "it fits"}));
    }
    static std::string textOf(const fs::path& path) {
        std::ifstream file(path, std::ios::binary);
        return {std::istreambuf_iterator<char>(file), {}};
    }
    // One byte of the stored file, behind the program's back.
    void alter(const std::string& from, char to) const {
        std::string file = textOf(path_);
        const std::size_t at = file.find(from);
        ASSERT_NE(at, std::string::npos);
        file[at] = to;
        std::ofstream(path_, std::ios::binary) << file;
    }

    static constexpr const char* kPose = "{\"schema\": \"fluorocut/pose/1\",   \"kept\": \"to the letter\"}\n";
    test::ScratchFolder scratch_;
    fs::path path_ = scratch_ / "hip.fluorocut";
};

TEST_F(CaseCommandTest, InfoTellsWhatItHolds) {
    const test::Finished finished = cli({"case", "info", path_.string(), "--json"});
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const nlohmann::json info = onlyJson(finished);
    EXPECT_EQ(info["label"], "hip 7");
    EXPECT_EQ(info["records"], 6);
    EXPECT_EQ(info["contents"], 3);
    ASSERT_EQ(info["items"].size(), 3U);
    EXPECT_EQ(info["items"][1]["kind"], "mesh");
    EXPECT_EQ(info["items"][1]["file_name"], "femur.stl");
    EXPECT_EQ(info["items"][1]["bytes"], fs::file_size(scratch_ / "femur.stl"));
    ASSERT_EQ(info["steps"].size(), 1U);
    EXPECT_EQ(info["steps"][0]["inputs"][0]["hash"], info["items"][0]["hash"]);
    EXPECT_EQ(info["steps"][0]["options"]["limit_mm"], 0.2);
    EXPECT_EQ(info["steps"][0]["result"], info["items"][2]["hash"]);
    ASSERT_EQ(info["decisions"].size(), 1U);
    EXPECT_EQ(info["decisions"][0]["step"], info["steps"][0]["record"]);
    EXPECT_EQ(info["decisions"][0]["accepted"], true);
    const test::Finished people = cli({"case", "info", path_.string()});
    EXPECT_EQ(people.exit_code, 0);
    EXPECT_THAT(people.out, HasSubstr("accepted by A. Person: it fits"));
}

TEST_F(CaseCommandTest, VerifyPassesAWholeCaseAndNamesTheFirstBrokenRecord) {
    const test::Finished good = cli({"case", "verify", path_.string(), "--json"});
    ASSERT_EQ(good.exit_code, 0) << good.err;
    EXPECT_EQ(onlyJson(good)["whole"], true);
    EXPECT_EQ(onlyJson(good)["records"], 6);
    const std::string newest = onlyJson(good)["newest_hash"];
    EXPECT_EQ(cli({"case", "verify", path_.string(), "--known-hash", newest}).exit_code, 0);
    EXPECT_EQ(cli({"case", "verify", path_.string(), "--known-hash", std::string(64, '0')}).exit_code, 1);
    EXPECT_EQ(cli({"case", "verify", path_.string(), "--known-hash", "short"}).exit_code, 2);

    alter("it fits", 'I');
    const test::Finished bad = cli({"case", "verify", path_.string(), "--json"});
    EXPECT_EQ(bad.exit_code, 1);
    EXPECT_EQ(onlyJson(bad)["whole"], false);
    EXPECT_EQ(onlyJson(bad)["first_broken_record"], 6);
    EXPECT_THAT(cli({"case", "verify", path_.string()}).out, HasSubstr("record 6 was changed"));
    alter("to the letter", 'T');  // comes before it
    EXPECT_EQ(onlyJson(cli({"case", "verify", path_.string(), "--json"}))["first_broken_record"], 4);
}

TEST_F(CaseCommandTest, RecomputingAsksOfEveryResultThatItComesOutAgain) {
    // Its `register` names no setup that it could be calculated from.
    const test::Finished bad = cli({"case", "verify", path_.string(), "--recompute", "--json"});
    EXPECT_EQ(bad.exit_code, 1);
    EXPECT_EQ(onlyJson(bad)["whole"], true);
    ASSERT_EQ(onlyJson(bad)["recomputed"].size(), 1u);
    EXPECT_EQ(onlyJson(bad)["recomputed"][0]["same"], false);
    EXPECT_THAT(cli({"case", "verify", path_.string(), "--recompute"}).out,
                HasSubstr("register (record 5) can not be computed again"));
    // A case with nothing that is calculated has nothing that differs.
    {
        const Result<CaseStore> empty = CaseStore::create(scratch_ / "empty.fluorocut", "hip 8");
        ASSERT_OK(empty);
    }
    const test::Finished good = cli({"case", "verify", (scratch_ / "empty.fluorocut").string(), "--recompute"});
    EXPECT_EQ(good.exit_code, 0) << good.err;
    EXPECT_THAT(good.out, HasSubstr("0 steps"));
}

TEST_F(CaseCommandTest, ExportGivesTheFilesBackAsTheyWere) {
    const fs::path folder = scratch_ / "out";
    const test::Finished finished = cli({"case", "export", path_.string(), folder.string(), "--json"});
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    EXPECT_EQ(onlyJson(finished)["files"], nlohmann::json({"0002_ap.png", "0003_femur.stl", "0004_pose.json"}));
    EXPECT_EQ(textOf(folder / "0002_ap.png"), textOf(scratch_ / "ap.png"));
    EXPECT_EQ(textOf(folder / "0003_femur.stl"), textOf(scratch_ / "femur.stl"));
    EXPECT_EQ(textOf(folder / "0004_pose.json"), kPose);
    EXPECT_EQ(nlohmann::json::parse(textOf(folder / "records.json"))["records"].size(), 6U);
    EXPECT_EQ(cli({"info", (folder / "0003_femur.stl").string()}).exit_code, 0);
    // Not into a folder that holds anything.
    const test::Finished again = cli({"case", "export", path_.string(), folder.string(), "--json"});
    EXPECT_EQ(again.exit_code, 2);
    EXPECT_THAT(errorMessage(again, "invalidOption"), HasSubstr("nothing is overwritten"));
    // Nor content that was altered, nor half a folder.
    alter("to the letter", 'T');
    const test::Finished altered = cli({"case", "export", path_.string(), (scratch_ / "new").string(), "--json"});
    EXPECT_NE(altered.exit_code, 0);
    EXPECT_THAT(errorMessage(altered, "invalidInput"), HasSubstr("another hash"));
    EXPECT_FALSE(fs::exists(scratch_ / "new"));
}

TEST_F(CaseCommandTest, OtherFilesAreRefusedInOneSentence) {
    for (const std::string part : {"info", "verify"}) {
        const test::Finished finished = cli({"case", part, (scratch_ / "ap.png").string(), "--json"});
        EXPECT_NE(finished.exit_code, 0);
        EXPECT_THAT(errorMessage(finished, "invalidInput"), HasSubstr("a case of FluoroCut")) << part;
        EXPECT_THAT(errorMessage(cli({"case", part, (scratch_ / "absent").string(), "--json"}), "invalidInput"),
                    HasSubstr("no such file"));
    }
    EXPECT_NE(cli({"case"}).exit_code, 0);
}

}  // namespace
}  // namespace fluorocut
