#include "app/cli/command_line.h"

#include <cstdio>
#include <exception>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/progress_bar.h"

namespace fluorocut::cli {
namespace {

constexpr int kNotAccepted = 1;
constexpr int kWrongUsage = 2;
constexpr int kOurBug = 70;

int exitCode(ErrorCode code) {
    switch (code) {
        case ErrorCode::invalidOption:
            return kWrongUsage;
        case ErrorCode::invalidInput:
            return 3;
        case ErrorCode::noSolution:
            return 4;
        case ErrorCode::cancelled:
            return 5;
        case ErrorCode::outputFailed:
            return 73;
    }
    return kOurBug;
}

// Text may hold a file's name in whatever encoding: replaced where it is not UTF-8, never thrown at.
void printJson(const nlohmann::ordered_json& json) {
    fmt::print("{}\n", json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
}

int fail(bool json, int code, std::string_view name, const Error& error, const std::string& message) {
    if (json) {
        printJson({{"error",
                    {{"code", name},
                     {"where", error.where},
                     {"found", error.found},
                     {"expected", error.expected},
                     {"advice", error.advice},
                     {"message", message}}}});
    }
    fmt::print(stderr, "fluorocut-cli: {}\n", message);
    return code;
}

int fail(bool json, const Error& error) {
    return fail(json, exitCode(error.code), name(error.code), error, error.message());
}

int failWithBug(bool json, const std::exception& bug) {
    const Error error{ErrorCode::noSolution, "fluorocut-cli", bug.what(), {}, "please report it"};
    return fail(json, kOurBug, "ourBug", error,
                fmt::format("this is a fault of FluoroCut, not of your input ({}); please report it.", bug.what()));
}

int finish(bool json, const Report& report) {
    if (json) {
        printJson(report.json);
    } else {
        fmt::print("{}", report.text());
    }
    if (std::fflush(stdout) != 0) return fail(false, outputFailed("standard output", "it cannot be written to"));
    return report.accepted ? 0 : kNotAccepted;
}

}  // namespace

CommandLine declareCommandLine(std::span<const Declare> commands, bool& json) {
    CommandLine line;
    line.app = std::make_shared<CLI::App>(
        "FluoroCut without a screen: C-arm images, their geometry, and the cavity they guide.\n"
        "Research software, not a medical device.",
        "fluorocut-cli");
    CLI::App& app = *line.app;
    app.set_version_flag("--version", "fluorocut-cli " FLUOROCUT_VERSION);
    app.add_flag("--json", json, "Print exactly one JSON object on stdout");
    app.fallthrough();
    app.footer(
        "`fluorocut-cli COMMAND --help` tells more about a command.\n"
        "Exit codes: 0 done, 1 done but a limit failed, 2 wrong usage, 3 bad input, 4 no solution,\n"
        "5 cancelled, 70 a fault of FluoroCut, 73 a result could not be written.");
    for (const Declare declare : commands) {
        line.commands.push_back(declare(app));
        CLI::App* command = line.commands.back().app;
        command->footer(command->get_footer() + "\n\nWith --json: exactly one JSON object on stdout.");
    }
    return line;
}

int runCommandLine(int argc, const char* const* argv, std::span<const Declare> declarations) {
    // Known before the rest is read, so that wrong usage is told as JSON too.
    bool json = false;
    for (int i = 1; i < argc && std::string_view(argv[i]) != "--"; ++i)
        json = json || std::string_view(argv[i]) == "--json";

    try {
        const CommandLine line = declareCommandLine(declarations, json);
        CLI::App& app = *line.app;
        try {
            app.parse(argc, argv);
        } catch (const CLI::Success& help) {
            return app.exit(help);
        } catch (const CLI::ParseError& wrong) {
            const Error error{ErrorCode::invalidOption, "command line", wrong.what(), {}, "see --help"};
            return fail(json, kWrongUsage, name(error.code), error, fmt::format("{} (see --help)", wrong.what()));
        }

        ProgressBar progress;
        for (const Command& command : line.commands) {
            if (!command.app->parsed()) continue;
            const Result<Report> report = command.run(progress);
            progress.clear();
            return report ? finish(json, *report) : fail(json, report.error());
        }
        return fail(json, invalidOption("command line", "no command", "one of those in --help"));
    } catch (const std::exception& bug) {
        return failWithBug(json, bug);
    }
}

}  // namespace fluorocut::cli
