// case: what a saved case holds, whether it is as it was written, and its content as files.
#include <filesystem>
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/cli/commands/list.h"
#include "core/casestore/case_store.h"
#include "core/io/atomic_file.h"
#include "core/procedure/recompute.h"

namespace fluorocut::cli {
namespace {

struct Options {
    std::string file;
    std::string known_hash;
    std::string folder;
    bool recompute = false;
};

Result<CaseStore> openCase(const Options& options) {
    return CaseStore::open(options.file, CaseStore::Access::read);
}

std::string verdictText(const CaseContent& content, const Step& step) {
    for (auto decision = content.decisions.rbegin(); decision != content.decisions.rend(); ++decision) {
        if (decision->step != step.record) continue;
        return fmt::format("{} by {}: {}", decision->accepted ? "accepted" : "refused", decision->who, decision->why);
    }
    return "not decided";
}

nlohmann::ordered_json jsonOf(const CaseContent& content) {
    nlohmann::ordered_json items = nlohmann::ordered_json::array(), steps = items, decisions = items;
    for (const Item& item : content.items) {
        items.push_back({{"record", item.record},
                         {"recorded_utc", item.recorded_utc},
                         {"kind", name(item.kind)},
                         {"schema", item.schema},
                         {"file_name", item.file_name},
                         {"bytes", item.bytes},
                         {"hash", item.hash}});
    }
    for (const Step& step : content.steps) {
        nlohmann::ordered_json inputs = nlohmann::ordered_json::array();
        for (const StepInput& input : step.inputs)
            inputs.push_back({{"role", input.role}, {"hash", input.hash}});
        steps.push_back({{"record", step.record},
                         {"recorded_utc", step.recorded_utc},
                         {"name", step.name},
                         {"inputs", std::move(inputs)},
                         {"options", nlohmann::ordered_json::parse(step.options_json)},  // checked when it was read
                         {"result", step.result},
                         {"started_utc", step.started_utc},
                         {"finished_utc", step.finished_utc},
                         {"software", step.software}});
    }
    for (const Decision& decision : content.decisions) {
        decisions.push_back({{"record", decision.record},
                             {"recorded_utc", decision.recorded_utc},
                             {"step", decision.step},
                             {"accepted", decision.accepted},
                             {"who", decision.who},
                             {"why", decision.why}});
    }
    return {{"items", std::move(items)}, {"steps", std::move(steps)}, {"decisions", std::move(decisions)}};
}

Result<Report> runInfo(const Options& options) {
    const Result<CaseStore> store = openCase(options);
    if (!store) return store.error();
    const Result<CaseInfo> info = store->info();
    if (!info) return info.error();
    const Result<CaseContent> content = store->content();
    if (!content) return content.error();
    Report report;
    report.json = {{"file", options.file},
                   {"label", info->label},
                   {"id", info->id},
                   {"schema_version", info->schema_version},
                   {"software", info->software},
                   {"created_utc", info->created_utc},
                   {"newest_utc", info->newest_utc},
                   {"newest_hash", info->newest_hash},
                   {"records", info->records},
                   {"contents", info->contents},
                   {"content_bytes", info->content_bytes}};
    report.json.update(jsonOf(*content));
    report.line("case", info->label);
    report.line("created", fmt::format("{} by {}", info->created_utc, info->software));
    report.line("newest record", fmt::format("{}, {}", info->newest_utc, info->newest_hash));
    report.line("holds", fmt::format("{} records; {} contents, {:.1f} MB", info->records, info->contents,
                                     static_cast<double>(info->content_bytes) / 1e6));
    for (const Item& item : content->items) {
        report.line(fmt::format("{} {}", item.record, name(item.kind)),
                    fmt::format("{} ({}, {} bytes)", item.file_name, item.schema, item.bytes));
    }
    for (const Step& step : content->steps)
        report.line(fmt::format("{} step", step.record),
                    fmt::format("{}, {}; {}", step.name, step.finished_utc, verdictText(*content, step)));
    return report;
}

// Every step that only calculates, again from what lies in the case.
Result<void> reportRecomputation(const CaseStore& store, Report& report, Progress& progress) {
    const Result<Recomputation> again = recompute(store, progress);
    if (!again) return again.error();
    nlohmann::ordered_json steps = nlohmann::ordered_json::array();
    for (const RecomputedStep& step : again->steps) {
        steps.push_back({{"record", step.record}, {"name", step.name}, {"same", step.same}, {"fault", nullptr}});
        if (step.same) continue;
        steps.back()["fault"] = step.what;
        report.line("differs", step.what);
    }
    report.json["recomputed"] = std::move(steps);
    report.line("recomputed", fmt::format("{} steps{}", again->steps.size(),
                                          again->same() ? ", all with the result that the case has" : ""));
    report.accepted = report.accepted && again->same();
    return {};
}

Result<Report> runVerify(const Options& options, Progress& progress) {
    const Result<CaseStore> store = openCase(options);
    if (!store) return store.error();
    SubProgress checking(progress, 0, options.recompute ? 0.1 : 1), recomputing(progress, 0.1, 1);
    const Result<CaseCheck> check = store->verify({.known_hash = options.known_hash}, checking);
    if (!check) return check.error();
    Report report;
    report.accepted = check->whole();
    report.json = {{"file", options.file},
                   {"whole", check->whole()},
                   {"records", check->records},
                   {"contents", check->contents},
                   {"newest_hash", check->newest_hash},
                   {"first_broken_record", nullptr},
                   {"fault", nullptr}};
    report.line("case",
                check->whole() ? "whole: every hash is right and every record follows the one before" : "NOT whole");
    if (check->fault) {
        if (check->fault->record) report.json["first_broken_record"] = *check->fault->record;
        report.json["fault"] = check->fault->what;
        report.line("first fault", check->fault->what);
    }
    report.line("checked", fmt::format("{} records, {} contents", check->records, check->contents));
    report.line("newest hash", check->newest_hash);
    if (options.recompute && check->whole()) {
        if (const Result<void> done = reportRecomputation(*store, report, recomputing); !done) return done.error();
    }
    return report;
}

// "0007_pose.json": the record in front makes it one of its own.
std::string exportName(const Item& item) {
    return fmt::format("{:04}_{}", item.record, item.file_name);
}

Result<Report> runExport(const Options& options, Progress& progress) {
    if (const Result<void> good = requireNewFolder(options.folder); !good) return good.error();
    const Result<CaseStore> store = openCase(options);
    if (!store) return store.error();
    const Result<CaseContent> content = store->content();
    if (!content) return content.error();
    const Result<std::string> records = store->recordsJson();
    if (!records) return records.error();
    nlohmann::ordered_json files = nlohmann::ordered_json::array();
    const Result<void> written = writeWholeFolder(options.folder, [&](const std::filesystem::path& folder) {
        for (const Item& item : content->items) {
            if (progress.isCancelled()) return Result<void>(cancelled("case export"));
            const std::string file = exportName(item);
            progress.report(static_cast<double>(files.size()) / static_cast<double>(content->items.size()), file);
            const Result<std::string> bytes = store->bytes(item.hash);
            if (!bytes) return Result<void>(bytes.error());
            const Result<void> done = writeWhole(folder / file, *bytes);
            if (!done) return done;
            files.push_back(file);
        }
        return writeWhole(folder / "records.json", *records);
    });
    if (!written) return written.error();
    Report report;
    report.line("folder", options.folder);
    report.line("files", fmt::format("{}, and records.json with all records", files.size()));
    report.json = {
        {"file", options.file}, {"folder", options.folder}, {"files", std::move(files)}, {"records", "records.json"}};
    return report;
}

CLI::App* declarePart(CLI::App& parent, const char* part_name, const char* purpose, Options& options) {
    CLI::App* app = parent.add_subcommand(part_name, purpose);
    app->add_option("FILE", options.file, "The saved case")->required();
    return app;
}

}  // namespace

Command declareCase(CLI::App& parent) {
    const auto options = std::make_shared<Options>();
    CLI::App* app =
        parent.add_subcommand("case", "What a saved case holds; whether it was altered; its content as files");
    app->fallthrough();
    const CLI::App* info = declarePart(*app, "info", "Its items, steps and decisions", *options);
    CLI::App* verify =
        declarePart(*app, "verify",
                    "Compute every hash again; exit code 1 and the first broken record when it was altered", *options);
    verify->add_flag("--recompute", options->recompute,
                     "Also calculate registration, plan, locations and corrections again from what lies in the case");
    verify
        ->add_option("--known-hash", options->known_hash,
                     "Newest hash as it was noted elsewhere: one of the records must have it")
        ->check(CLI::Validator(
            [](std::string& text) {
                const bool good = text.size() == 64 && text.find_first_not_of("0123456789abcdef") == std::string::npos;
                return good ? std::string() : "found " + text + ", expected 64 hexadecimal digits";
            },
            "SHA-256"));
    CLI::App* exporting = declarePart(
        *app, "export", "Its images, meshes, transforms as they were stored, and its records as JSON", *options);
    exporting->add_option("DIR", options->folder, "New folder")->required();
    app->footer(
        "Examples:\n  fluorocut-cli case verify hip.fluorocut\n  fluorocut-cli case export hip.fluorocut hip_files");
    return {app, [info, verify, exporting, options](Progress& progress) -> Result<Report> {
                if (info->parsed()) return runInfo(*options);
                if (verify->parsed()) return runVerify(*options, progress);
                if (exporting->parsed()) return runExport(*options, progress);
                return invalidOption("case", "nothing to do", "info, verify or export", "see --help");
            }};
}

}  // namespace fluorocut::cli
