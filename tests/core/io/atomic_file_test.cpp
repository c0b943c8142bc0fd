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

}  // namespace
}  // namespace fluorocut
