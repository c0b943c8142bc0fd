// The frame around all commands: usage, help, JSON, exit codes.
#include "app/cli/command_line.h"

#include <array>
#include <stdexcept>

#include <CLI/CLI.hpp>
#include <gmock/gmock.h>

#include "tests/app/cli.h"

namespace fluorocut::cli {
namespace {

using test::errorMessage;
using test::onlyJson;
using testing::HasSubstr;

// A command called `try` whose outcome each test chooses.
Run g_outcome;

Command declareTry(CLI::App& parent) {
    return {parent.add_subcommand("try", "Does what the test says"), g_outcome};
}

test::Finished runTry(Run outcome, bool json) {
    g_outcome = std::move(outcome);
    std::vector<const char*> arguments{"fluorocut-cli", "try"};
    if (json) arguments.push_back("--json");
    const std::array<Declare, 1> commands{declareTry};
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    test::Finished finished;
    finished.exit_code = runCommandLine(static_cast<int>(arguments.size()), arguments.data(), commands);
    finished.out = testing::internal::GetCapturedStdout();
    finished.err = testing::internal::GetCapturedStderr();
    return finished;
}

TEST(CommandLine, ADoneCommandPrintsItsLinesOrItsJson) {
    const cli::Run done = [](Progress&) -> Result<Report> {
        Report report;
        report.json["size_px"] = {512, 256};
        report.line("size", "512 x 256 px");
        report.line("elapsed", "2.5 ms");
        return report;
    };
    const test::Finished text = runTry(done, false);
    EXPECT_EQ(text.exit_code, 0);
    EXPECT_EQ(text.out, "size     512 x 256 px\nelapsed  2.5 ms\n");
    EXPECT_EQ(text.err, "");
    const test::Finished json = runTry(done, true);
    EXPECT_EQ(json.exit_code, 0);
    EXPECT_EQ(onlyJson(json)["size_px"][1], 256);
}

TEST(CommandLine, AFailedLimitIsNotAFailedCommand) {
    const test::Finished finished = runTry(
        [](Progress&) -> Result<Report> {
            Report report;
            report.accepted = false;
            report.json["failed"] = "rms_px";
            return report;
        },
        true);
    EXPECT_EQ(finished.exit_code, 1);
    EXPECT_EQ(onlyJson(finished)["failed"], "rms_px");
}

TEST(CommandLine, EveryKindOfErrorHasItsExitCode) {
    const auto codeOf = [](const Error& error) {
        return runTry([&](Progress&) -> Result<Report> { return error; }, false).exit_code;
    };
    EXPECT_EQ(codeOf(invalidOption("--binning", "3", "1, 2, 4 or 8")), 2);
    EXPECT_EQ(codeOf(invalidInput("x.nii", "NaN", "a spacing")), 3);
    EXPECT_EQ(codeOf(noSolution("rings", "1", "4")), 4);
    EXPECT_EQ(codeOf(cancelled("drr")), 5);
    EXPECT_EQ(codeOf(outputFailed("x.png", "disk full")), 73);
}

TEST(CommandLine, AnErrorIsOneJsonObjectAndOneSentence) {
    const test::Finished finished = runTry(
        [](Progress&) -> Result<Report> {
            return invalidInput("pelvis.nii, pixdim[1]", "NaN", "a spacing", "export it again");
        },
        true);
    EXPECT_EQ(errorMessage(finished, "invalidInput"),
              "pelvis.nii, pixdim[1]: found NaN, expected a spacing; export it again.");
    EXPECT_EQ(onlyJson(finished)["error"]["advice"], "export it again");
}

TEST(CommandLine, AnExceptionIsOurBugAndSaysSo) {
    const test::Finished finished =
        runTry([](Progress&) -> Result<Report> { throw std::logic_error("BasicImage: negative size"); }, true);
    EXPECT_EQ(finished.exit_code, 70);
    EXPECT_THAT(errorMessage(finished, "ourBug"), HasSubstr("BasicImage: negative size"));
}

TEST(CommandLine, AFileNameInAnyEncodingStillGivesJson) {
    const test::Finished finished =
        runTry([](Progress&) -> Result<Report> { return invalidInput("pel\xff.nii", "nothing", "a file"); }, true);
    EXPECT_EQ(finished.exit_code, 3);
    EXPECT_TRUE(onlyJson(finished).contains("error"));
}

TEST(Program, HelpAtEachLevelGoesToStdout) {
    const test::Finished top = test::cli({"--help"});
    EXPECT_EQ(top.exit_code, 0);
    EXPECT_THAT(top.out, HasSubstr("info"));
    EXPECT_THAT(top.out, HasSubstr("not a medical device"));
    EXPECT_EQ(top.err, "");
    const test::Finished info = test::cli({"info", "--help"});
    EXPECT_EQ(info.exit_code, 0);
    EXPECT_THAT(info.out, HasSubstr("Example"));
}

TEST(Program, SaysItsVersion) {
    const test::Finished finished = test::cli({"--version"});
    EXPECT_EQ(finished.exit_code, 0);
    EXPECT_THAT(finished.out, testing::MatchesRegex("fluorocut-cli [0-9]+\\.[0-9]+\\.[0-9]+\n"));
}

TEST(Program, WrongUsageIsExitCodeTwo) {
    for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
             {}, {"--nonsense"}, {"transmogrify"}, {"info"}, {"info", "a", "--nonsense"}, {"info", "a", "b"}}) {
        std::string shown;
        for (const std::string& argument : arguments)
            shown += argument + " ";
        const test::Finished text = test::cli(arguments);
        EXPECT_EQ(text.exit_code, 2) << shown;
        EXPECT_EQ(text.out, "") << shown;
        EXPECT_THAT(text.err, HasSubstr("--help")) << shown;
        std::vector<std::string> with_json = arguments;
        with_json.push_back("--json");
        const test::Finished json = test::cli(with_json);
        EXPECT_EQ(json.exit_code, 2) << shown;
        EXPECT_NE(errorMessage(json, "invalidOption"), "") << shown;
    }
}

TEST(Program, TakesJsonBeforeAndAfterTheCommand) {
    EXPECT_EQ(test::cli({"--json", "info", "/nowhere"}).exit_code, 3);
    EXPECT_NE(errorMessage(test::cli({"--json", "info", "/nowhere"}), "invalidInput"), "");
    EXPECT_NE(errorMessage(test::cli({"info", "--json", "/nowhere"}), "invalidInput"), "");
}

}  // namespace
}  // namespace fluorocut::cli
