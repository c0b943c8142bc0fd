#include "core/io/atomic_file.h"

#include <fstream>
#include <iterator>

#include <gtest/gtest.h>

#include "tests/core/io/test_files.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using test::content;

std::size_t entries(const fs::path& folder) {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(WriteWhole, ReplacesTheTargetOnlyWhenAllIsWritten) {
    const test::ScratchFolder scratch;
    const fs::path target = scratch / "pose.json";
    ASSERT_OK(writeWhole(target, "old"));
    const Result<void> failed = writeWhole(target, [](const fs::path& temporary) -> Result<void> {
        EXPECT_EQ(temporary.extension(), ".json");
        std::ofstream(temporary) << "half of the n";
        return outputFailed("pose.json", "disk full");
    });
    EXPECT_FALSE(failed.ok());
    EXPECT_EQ(content(target), "old");
    EXPECT_EQ(entries(scratch.path()), 1u);
    ASSERT_OK(writeWhole(target, "new"));
    EXPECT_EQ(content(target), "new");
    EXPECT_EQ(entries(scratch.path()), 1u);
}

TEST(WriteWhole, SaysWhichFolderIsMissing) {
    const test::ScratchFolder scratch;
    const Result<void> failed = writeWhole(scratch / "nowhere/x.json", "x");
    ASSERT_FALSE(failed.ok());
    EXPECT_EQ(failed.error().code, ErrorCode::outputFailed);
    EXPECT_NE(failed.error().message().find("nowhere"), std::string::npos);
}

TEST(WriteWholeFolder, AppearsWithAllOfItOrNotAtAll) {
    const test::ScratchFolder scratch;
    const fs::path target = scratch / "workshop";
    const auto half = [](const fs::path& folder) -> Result<void> {
        std::ofstream(folder / "one.stl") << "half";
        return outputFailed("one.stl", "disk full");
    };
    EXPECT_FALSE(writeWholeFolder(target, half).ok());
    EXPECT_EQ(entries(scratch.path()), 0u);
    const auto whole = [](const fs::path& folder) { return writeWhole(folder / "one.stl", "all"); };
    ASSERT_OK(writeWholeFolder(target.string() + "/", whole));  // as people type it
    EXPECT_EQ(content(target / "one.stl"), "all");
    EXPECT_EQ(entries(scratch.path()), 1u);
    fs::create_directory(scratch / "empty");
    ASSERT_OK(writeWholeFolder(scratch / "empty", whole));
    EXPECT_EQ(content(scratch / "empty" / "one.stl"), "all");
}

TEST(WriteWholeFolder, OverwritesNothing) {
    const test::ScratchFolder scratch;
    const auto write = [](const fs::path& folder) { return writeWhole(folder / "new", "new"); };
    fs::create_directory(scratch / "mine");
    std::ofstream(scratch / "mine" / "thesis") << "years";
    std::ofstream(scratch / "file") << "years";
    for (const char* name : {"mine", "file"}) {
        const Result<void> refused = writeWholeFolder(scratch / name, write);
        ASSERT_FALSE(refused.ok());
        EXPECT_EQ(refused.error().code, ErrorCode::invalidOption);
    }
    EXPECT_EQ(content(scratch / "mine" / "thesis"), "years");
    EXPECT_FALSE(writeWholeFolder(scratch / "nowhere" / "x", write).ok());
    EXPECT_EQ(entries(scratch.path()), 2u);
}

}  // namespace
}  // namespace fluorocut
