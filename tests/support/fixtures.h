// What tests of several folders need: where the shared data lies, a scratch folder, matchers for poses.
#pragma once

#include <filesystem>
#include <string>

#include <gmock/gmock.h>

#include "core/base/result.h"

namespace fluorocut::test {

// The folder of real data beside the checkout (or $FLUOROCUT_TEST_DATA). Empty when it is absent: then skip, saying so.
std::filesystem::path sharedData();

// An empty folder of its own for the running test, removed when the object goes.
class ScratchFolder {
  public:
    ScratchFolder();
    ~ScratchFolder();
    ScratchFolder(const ScratchFolder&) = delete;
    ScratchFolder& operator=(const ScratchFolder&) = delete;
    const std::filesystem::path& path() const { return path_; }
    std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

  private:
    std::filesystem::path path_;
};

}  // namespace fluorocut::test

#define SKIP_WITHOUT_SHARED_DATA()               \
    if (::fluorocut::test::sharedData().empty()) \
    GTEST_SKIP() << "the shared test data is not beside the checkout; set FLUOROCUT_TEST_DATA to its folder"

// ASSERT_OK(result): the Result holds a value; otherwise shows the error's sentence.
#define ASSERT_OK(result) ASSERT_TRUE((result).ok()) << (result).error().message()
#define EXPECT_OK(result) EXPECT_TRUE((result).ok()) << (result).error().message()
