// The manual page and the completion against the program that they speak of: what its own help names is in them, and a
// real shell completes by them.
#include "app/cli/manual.h"

#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>

#include <CLI/CLI.hpp>
#include <gmock/gmock.h>

#include "app/cli/commands/list.h"
#include "tests/app/cli.h"
#include "tests/support/fixtures.h"

namespace fluorocut::cli {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class Manual : public testing::Test {
  protected:
    bool json_ = false;
    CommandLine line_ = declareCommandLine(kCommands, json_);

    // What bash offers after these words; the last is the one that is being typed.
    std::vector<std::string> completed(const std::vector<std::string>& words) {
        const test::ScratchFolder scratch;
        const std::string script = (scratch / "completion").string();
        std::ofstream(script) << bashCompletion(*line_.app);
        std::string command = "source '" + script + "'; COMP_WORDS=(fluorocut-cli";
        for (const std::string& word : words)
            command += " '" + word + "'";
        command += "); COMP_CWORD=" + std::to_string(words.size()) +
                   "; _fluorocut_cli; for word in \"${COMPREPLY[@]}\"; do echo \"$word\"; done";
        const test::Finished shell = test::runProgram("/bin/bash", {"--norc", "-c", command});
        EXPECT_EQ(shell.exit_code, 0) << shell.err;
        EXPECT_EQ(shell.err, "");
        std::istringstream lines(shell.out);
        std::vector<std::string> offered;
        for (std::string line; std::getline(lines, line);)
            offered.push_back(line);
        return offered;
    }
};

// The page as a reader sees it: without the marks of roff.
std::string plain(std::string page) {
    for (const char* mark : {"\\fB", "\\fI", "\\fR"})
        for (std::size_t at; (at = page.find(mark)) != std::string::npos;)
            page.erase(at, 3);
    for (std::size_t at; (at = page.find("\\-")) != std::string::npos;)
        page.erase(at, 1);
    return page;
}

// Every option name at the beginning of a line of a help text: "  -o,--out TEXT REQUIRED".
std::vector<std::string> optionsInHelp(const std::string& help) {
    std::vector<std::string> names;
    std::istringstream lines(help);
    for (std::string line; std::getline(lines, line);) {
        if (line.rfind("  -", 0) != 0) continue;
        std::istringstream comma(line.substr(2, line.find(' ', 2) - 2));
        for (std::string name; std::getline(comma, name, ',');)
            names.push_back(name);
    }
    return names;
}

void everyCommand(const CLI::App& app, std::vector<std::string> path,
                  const std::function<void(const CLI::App&, const std::vector<std::string>&)>& visit) {
    visit(app, path);
    for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
        std::vector<std::string> next = path;
        next.push_back(sub->get_name());
        everyCommand(*sub, next, visit);
    }
}

TEST_F(Manual, NamesEveryCommandAndOptionOfTheHelp) {
    const std::string page = plain(manualPage(*line_.app, "1.2.3"));
    EXPECT_THAT(page, HasSubstr("FluoroCut 1.2.3"));
    int commands = 0;
    everyCommand(*line_.app, {}, [&](const CLI::App& app, const std::vector<std::string>& path) {
        ++commands;
        std::string title;
        for (const std::string& word : path)
            title += (title.empty() ? "" : " ") + word;
        const std::size_t section = path.empty() ? 0 : page.find(".SS \"" + title + "\"\n");
        ASSERT_NE(section, std::string::npos) << title;
        const std::string text = page.substr(section, page.find(".SS ", section + 1) - section);
        for (const std::string& name : optionsInHelp(app.help())) {
            if (!path.empty() && (name == "-h" || name == "--help")) continue;  // told once, at the top
            EXPECT_THAT(text, HasSubstr(name)) << title;
        }
    });
    EXPECT_GT(commands, 30);  // with those below others
}

// groff says so when a page has requests that it does not know; not where man is not installed.
TEST_F(Manual, TheFormatterHasNothingToComplainOf) {
    const test::ScratchFolder scratch;
    const std::string file = (scratch / "fluorocut-cli.1").string();
    std::ofstream(file) << manualPage(*line_.app, "1.2.3");
    const test::Finished man =
        test::runProgram("/bin/sh", {"-c", "command -v groff >/dev/null || exit 99; groff -man -Tutf8 -ww -z " + file});
    if (man.exit_code == 99) GTEST_SKIP() << "no groff";
    EXPECT_EQ(man.exit_code, 0);
    EXPECT_EQ(man.err, "");
}

TEST_F(Manual, AShellOffersCommandsOptionsAndChoices) {
    EXPECT_THAT(completed({"pro"}), ElementsAre("procedure"));
    EXPECT_THAT(completed({"procedure", ""}), Contains("run"));
    EXPECT_THAT(completed({"drr", "--ct", "femur", "--vi"}), ElementsAre("--view"));
    EXPECT_THAT(completed({"drr", "--view", ""}), ElementsAre("ap", "lateral"));
    EXPECT_THAT(completed({"drr", "--view", "ap", "--js"}), ElementsAre("--json"));
    // A file's name is the shell's own business.
    EXPECT_THAT(completed({"drr", "--ct", ""}), IsEmpty());
    EXPECT_THAT(completed({"info", ""}), IsEmpty());
}

TEST_F(Manual, AShellOffersEveryOptionOfTheHelp) {
    everyCommand(*line_.app, {}, [&](const CLI::App& app, std::vector<std::string> path) {
        const std::string title = path.empty() ? "" : path.back();
        path.emplace_back("-");
        const std::vector<std::string> offered = completed(path);
        for (const std::string& name : optionsInHelp(app.help())) {
            if (name == "-h") continue;  // --help is offered
            EXPECT_THAT(offered, Contains(name)) << title;
        }
        EXPECT_THAT(offered, Not(Contains(HasSubstr(","))));
    });
}

}  // namespace
}  // namespace fluorocut::cli
