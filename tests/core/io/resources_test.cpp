#include "core/io/resources.h"

#include <cstdlib>
#include <fstream>

#include <gmock/gmock.h>

#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// The environment as it was, afterwards.
class Resources : public testing::Test {
  protected:
    Resources() {
        const char* old = std::getenv("FLUOROCUT_RESOURCES");
        had_ = old != nullptr;
        if (had_) old_ = old;
        unsetenv("FLUOROCUT_RESOURCES");
    }
    ~Resources() override {
        if (had_) {
            setenv("FLUOROCUT_RESOURCES", old_.c_str(), 1);
        } else {
            unsetenv("FLUOROCUT_RESOURCES");
        }
    }
    void use(const fs::path& folder) const { setenv("FLUOROCUT_RESOURCES", folder.c_str(), 1); }

    test::ScratchFolder scratch_;

  private:
    bool had_;
    std::string old_;
};

TEST_F(Resources, APlateThatComesWithTheSourcesIsFoundByName) {
    const auto path = findResource("plates", "paper");
    ASSERT_OK(path);
    EXPECT_TRUE(fs::is_regular_file(*path));
    EXPECT_THAT(resourceNames("plates"), Contains("paper"));
}

TEST_F(Resources, TheEnvironmentAloneCountsWhenItIsSet) {
    fs::create_directories(scratch_ / "plates");
    for (const char* name : {"b.json", "a.json", "notes.txt"})
        std::ofstream(scratch_ / "plates" / name) << "{}";
    use(scratch_.path());
    EXPECT_THAT(resourceNames("plates"), ElementsAre("a", "b"));
    const auto found = findResource("plates", "b");
    ASSERT_OK(found);
    EXPECT_EQ(*found, scratch_ / "plates" / "b.json");
    EXPECT_FALSE(findResource("plates", "paper").ok());
    EXPECT_THAT(resourceNames("phantoms"), IsEmpty());
}

TEST_F(Resources, AFileComesFirst) {
    const fs::path mine = scratch_ / "paper";
    std::ofstream(mine) << "{}";
    const auto found = findResource("plates", mine.string());
    ASSERT_OK(found);
    EXPECT_EQ(*found, mine);
}

TEST_F(Resources, RefusesInWords) {
    const auto unknown = findResource("plates", "no-such-plate");
    ASSERT_FALSE(unknown.ok());
    EXPECT_THAT(unknown.error().message(), HasSubstr("no-such-plate"));
    EXPECT_THAT(unknown.error().message(), HasSubstr("paper"));
    use(scratch_ / "nowhere");
    const auto folder = resourceFolder();
    ASSERT_FALSE(folder.ok());
    EXPECT_THAT(folder.error().message(), HasSubstr("FLUOROCUT_RESOURCES"));
}

// A name cannot lead out of its folder.
TEST_F(Resources, ANameWithFoldersIsNotAnEntry) {
    fs::create_directories(scratch_ / "plates");
    std::ofstream(scratch_ / "secret.json") << "{}";
    use(scratch_.path());
    EXPECT_FALSE(findResource("plates", "../secret").ok());
}

}  // namespace
}  // namespace fluorocut
