#include "core/fiducial/bead_layout.h"

#include <fstream>

#include <gmock/gmock.h>

#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::ScratchFolder;
using testing::HasSubstr;

TEST(BeadLayout, GoesThereAndBack) {
    const ScratchFolder folder;
    const BeadLayout layout{Frame::phantom, {{"a", {1, 2, 1 / 3.0}, 2}, {"b", {10, -2, 3}, 3.5}}};
    ASSERT_OK(writeBeadLayout(folder / "beads.json", layout));
    const auto copy = readBeadLayout(folder / "beads.json");
    ASSERT_OK(copy);
    ASSERT_EQ(copy->beads.size(), 2U);
    EXPECT_EQ(copy->frame, Frame::phantom);
    for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_EQ(copy->beads[i].name, layout.beads[i].name);
        EXPECT_EQ(copy->beads[i].center_mm, layout.beads[i].center_mm);
        EXPECT_EQ(copy->beads[i].diameter_mm, layout.beads[i].diameter_mm);
    }
}

TEST(BeadLayout, RefusesInWords) {
    const auto message = [](const std::vector<Bead>& beads) {
        const auto good = BeadLayout{Frame::phantom, beads}.validate();
        return good ? std::string("no error") : good.error().message();
    };
    EXPECT_THAT(message({}), HasSubstr("found none"));
    EXPECT_THAT(message({{"a", {0, 0, 0}, 2}, {"a", {9, 0, 0}, 2}}), HasSubstr("beads[1].name: found \"a\" a second"));
    EXPECT_THAT(message({{"a", {0, 0, 0}, 2}, {"b", {1, 0, 0}, 2}}), HasSubstr("a bead 1 mm from that of \"a\""));
    EXPECT_THAT(message({{"a", {0, 0, 0}, -2}}), HasSubstr("beads[0].diameter_mm: found -2"));

    const ScratchFolder folder;
    std::ofstream(folder / "b.json") << R"({"schema": "fluorocut/beads/1", "frame": "moon", "beads": []})";
    const auto read = readBeadLayout(folder / "b.json");
    ASSERT_FALSE(read.ok());
    EXPECT_THAT(read.error().message(), HasSubstr("field frame: found \"moon\""));
}

}  // namespace
}  // namespace fluorocut
