// The desktop's manual page and completion are written by hand: every option of its help is in them, and no other.
#include <fstream>
#include <regex>
#include <set>

#include <gmock/gmock.h>

#include "tests/support/program.h"

namespace fluorocut {
namespace {

std::set<std::string> longOptions(const std::string& text, const std::string& pattern) {
    std::set<std::string> found;
    const std::regex option(pattern);
    for (auto it = std::sregex_iterator(text.begin(), text.end(), option); it != std::sregex_iterator(); ++it)
        found.insert((*it)[1]);
    return found;
}

std::string contentOf(const std::string& name) {
    std::ifstream stream(std::string(FLUOROCUT_SOURCE_DIR) + "/packaging/share/" + name);
    std::string text(std::istreambuf_iterator<char>(stream), {});
    return std::regex_replace(text, std::regex(R"(\\-)"), "-");
}

TEST(DesktopManual, KnowsEveryOptionOfTheHelp) {
    const test::Finished help = test::runProgram(FLUOROCUT_DESKTOP, {"--help"});
    ASSERT_EQ(help.exit_code, 0) << help.err;
    const std::set<std::string> options = longOptions(help.out, R"((?:^|\s)--([a-z-]+))");
    ASSERT_TRUE(options.contains("screenshot")) << help.out;
    EXPECT_EQ(longOptions(contentOf("fluorocut.1.in"), R"(\\fB--([a-z-]+)\\fR)"), options);
    EXPECT_EQ(longOptions(contentOf("fluorocut.bash"), R"(--([a-z-]+))"), options);
}

}  // namespace
}  // namespace fluorocut
