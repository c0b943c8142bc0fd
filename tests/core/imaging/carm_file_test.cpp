#include "core/imaging/carm_file.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/io/atomic_file.h"
#include "tests/core/imaging/pincushion.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::ScratchFolder;
using ::testing::AllOf;
using ::testing::HasSubstr;

// The example of CLI.md.
constexpr const char* kExample = R"({"schema": "fluorocut/carm/1", "name": "GE Polarix 2", "columns": 512, "rows": 500,
 "pixel_mm": [0.32, 0.33], "focal_length_mm": 1000.0, "principal_point_px": [255.5, 249.5], "distortion": null})";

std::filesystem::path write(const ScratchFolder& folder, const std::string& name, const std::string& text) {
    EXPECT_OK(writeWhole(folder / name, text));
    return folder / name;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const auto at = text.find(from);
    EXPECT_NE(at, std::string::npos);
    return text.replace(at, from.size(), to);
}

// A model for the tests: {"schema": "test/pincushion/1"}.
const DistortionReaders kReaders = {{"test/pincushion/1", [](const std::filesystem::path& path, const CArm& carm) {
                                         EXPECT_TRUE(std::filesystem::exists(path));
                                         EXPECT_EQ(carm.rows, 500);
                                         return Result<std::shared_ptr<const Distortion>>(
                                             std::make_shared<test::Pincushion>(1e-5));
                                     }}};

TEST(CArmFile, ReadsTheDocumentedExample) {
    const ScratchFolder folder;
    const auto carm = readCArm(write(folder, "c.json", kExample));
    ASSERT_OK(carm);
    EXPECT_EQ(carm->name, "GE Polarix 2");
    EXPECT_EQ(carm->columns, 512);
    EXPECT_EQ(carm->rows, 500);
    EXPECT_EQ(carm->pixel_mm, Vector2(0.32, 0.33));
    EXPECT_EQ(carm->focal_length_mm, 1000);
    EXPECT_EQ(carm->principal_point_px, Vector2(255.5, 249.5));
    EXPECT_EQ(carm->distortion, nullptr);
}

TEST(CArmFile, GoesThereAndBackToTheLastBit) {
    const ScratchFolder folder;
    CArm carm;
    carm.name = "Mobile \"B\" \xc3\xa9\xff";  // a quote, an e with an accent, a byte that is no UTF-8
    carm.columns = 1023;
    carm.pixel_mm = {1 / 3.0, 0.1 + 0.2};
    carm.focal_length_mm = 997.0 / 3;
    carm.principal_point_px = {-1e-7 / 3, 511.123456789012345};
    ASSERT_OK(writeCArm(folder / "c.json", carm));
    const auto back = readCArm(folder / "c.json");
    ASSERT_OK(back);
    EXPECT_THAT(back->name, HasSubstr("Mobile \"B\" \xc3\xa9"));
    EXPECT_EQ(back->columns, carm.columns);
    EXPECT_EQ(back->pixel_mm, carm.pixel_mm);
    EXPECT_EQ(back->focal_length_mm, carm.focal_length_mm);
    EXPECT_EQ(back->principal_point_px, carm.principal_point_px);
}

TEST(CArmFile, DistortionIsFoundRelativeToTheFile) {
    const ScratchFolder folder;
    std::filesystem::create_directory(folder / "maps");
    write(folder, "maps/d.json", R"({"schema": "test/pincushion/1"})");
    const auto read = readCArm(write(folder, "c.json", replaced(kExample, "null", "\"maps/d.json\"")), kReaders);
    ASSERT_OK(read);
    ASSERT_NE(read->distortion, nullptr);
    EXPECT_EQ(read->distortion->distorted({100, 0}), Vector2(100 * 1.1, 0));

    ASSERT_OK(writeCArm(folder / "copy.json", *read, folder / "maps" / "d.json"));
    const auto back = readCArm(folder / "copy.json", kReaders);
    ASSERT_OK(back);
    EXPECT_NE(back->distortion, nullptr);
    EXPECT_THROW((void)writeCArm(folder / "copy.json", *read), std::logic_error);
    EXPECT_THROW((void)writeCArm(folder / "copy.json", CArm(), "d.json"), std::logic_error);
}

TEST(CArmFile, RefusesInWords) {
    const ScratchFolder folder;
    const auto messageOf = [&](const std::string& text, const DistortionReaders& readers = {}) {
        const auto carm = readCArm(write(folder, "c.json", text), readers);
        if (carm.ok()) return std::string("no error");
        EXPECT_EQ(carm.error().code, ErrorCode::invalidInput);
        return carm.error().message();
    };
    const std::string example = kExample;
    EXPECT_THAT(messageOf(replaced(example, "\"columns\": 512", "\"columns\": 0")),
                AllOf(HasSubstr("c.json, field columns: found 0, expected 1 to 16384")));
    EXPECT_THAT(messageOf(replaced(example, "1000.0", "-1000")), HasSubstr("field focal_length_mm: found -1000"));
    EXPECT_THAT(messageOf(replaced(example, "0.32,", "\"0.32\",")), HasSubstr("pixel_mm"));
    EXPECT_THAT(messageOf(replaced(example, "\"rows\": 500,", "")), HasSubstr("field rows: found nothing"));
    EXPECT_THAT(messageOf(replaced(example, "\"rows\"", "\"row\": 1, \"rows\"")), HasSubstr("row"));
    EXPECT_THAT(messageOf(replaced(example, "carm/1", "carm/2")), HasSubstr("fluorocut/carm/1"));
    EXPECT_THAT(messageOf(replaced(example, "null", "\"\"")), HasSubstr("field distortion: found an empty text"));
    EXPECT_THAT(messageOf(replaced(example, "null", "7")), HasSubstr("field distortion"));
    EXPECT_THAT(messageOf(replaced(example, "null", "\"absent.json\"")), HasSubstr("absent.json"));
    write(folder, "d.json", R"({"schema": "fluorocut/distortion/9"})");
    const std::string with_map = replaced(example, "null", "\"d.json\"");
    EXPECT_THAT(messageOf(with_map), AllOf(HasSubstr("d.json: found a model of the kind \"fluorocut/distortion/9\""),
                                           HasSubstr("knows no model of distortion")));
    EXPECT_THAT(messageOf(with_map, kReaders), HasSubstr("expected one of the models test/pincushion/1"));
    for (std::size_t length = 0; length + 1 < example.size(); length += 7)
        EXPECT_NE(messageOf(example.substr(0, length)), "no error") << length;
    CArm bad;
    bad.rows = 0;
    EXPECT_FALSE(writeCArm(folder / "bad.json", bad).ok());
    EXPECT_FALSE(std::filesystem::exists(folder / "bad.json"));
}

}  // namespace
}  // namespace fluorocut
