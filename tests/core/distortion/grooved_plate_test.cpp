#include "core/distortion/grooved_plate.h"

#include <fstream>

#include <gmock/gmock.h>

#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::ScratchFolder;
using testing::HasSubstr;

const std::string kExample = R"({"schema": "fluorocut/plate/1", "pitch_mm": 6.35, "groove_width_mm": 1.5875,
 "groove_depth_mm": 4.7625, "thickness_mm": 6.35, "material": "aluminium", "grooves": [35, 33]})";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    return text.replace(text.find(from), from.size(), to);
}

std::filesystem::path write(const ScratchFolder& folder, const std::string& text) {
    const auto path = folder / "plate.json";
    std::ofstream(path) << text;
    return path;
}

TEST(GroovedPlate, TheDocumentedExampleGoesThereAndBack) {
    const ScratchFolder folder;
    const auto plate = readGroovedPlate(write(folder, kExample));
    ASSERT_OK(plate);
    ASSERT_OK(writeGroovedPlate(folder / "copy.json", *plate));
    const auto copy = readGroovedPlate(folder / "copy.json");
    ASSERT_OK(copy);
    EXPECT_EQ(copy->pitch_mm, 6.35);
    EXPECT_EQ(copy->groove_width_mm, 1.5875);
    EXPECT_EQ(copy->groove_depth_mm, 4.7625);
    EXPECT_EQ(copy->thickness_mm, 6.35);
    EXPECT_EQ(copy->material, Material::aluminium);
    EXPECT_EQ(copy->grooves, (std::array{35, 33}));
}

TEST(GroovedPlate, GroovesMayBeLeftOpen) {
    const ScratchFolder folder;
    const auto plate = readGroovedPlate(write(folder, replaced(kExample, "[35, 33]", "null")));
    ASSERT_OK(plate);
    EXPECT_FALSE(plate->grooves.has_value());
}

TEST(GroovedPlate, RefusesInWords) {
    const ScratchFolder folder;
    const auto message = [&](const std::string& from, const std::string& to) {
        const auto plate = readGroovedPlate(write(folder, replaced(kExample, from, to)));
        return plate ? std::string("no error") : plate.error().message();
    };
    EXPECT_THAT(message("\"pitch_mm\": 6.35", "\"pitch_mm\": -6.35"), HasSubstr("field pitch_mm: found -6.35"));
    EXPECT_THAT(message("4.7625", "7"), HasSubstr("field groove_depth_mm: found 7"));
    EXPECT_THAT(message("aluminium", "cheese"), HasSubstr("found \"cheese\", expected one of air, water"));
    EXPECT_THAT(message("[35, 33]", "[35, 2.5]"), HasSubstr("field grooves: found [35, 2.5]"));
    EXPECT_THAT(message(", \"grooves\": [35, 33]", ""), HasSubstr("grooves"));
    EXPECT_THAT(message("\"thickness_mm\"", "\"thick_mm\""), HasSubstr("thick"));
}

}  // namespace
}  // namespace fluorocut
