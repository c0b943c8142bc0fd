#include "app/cli/commands/procedure_report.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include <fmt/format.h>
#include <unistd.h>

#include "app/cli/files.h"
#include "core/base/stopwatch.h"
#include "core/base/units.h"
#include "core/io/atomic_file.h"
#include "core/procedure/report.h"
#include "core/procedure/report_captures.h"

namespace fluorocut::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// A folder of its own, gone with it.
class TemporaryFolder {
  public:
    TemporaryFolder() {
        std::error_code failed;
        std::string name = (fs::temp_directory_path(failed) / "fluorocut-run-XXXXXX").string();
        if (!failed && mkdtemp(name.data()) != nullptr) path_ = name;
    }
    ~TemporaryFolder() {
        std::error_code ignored;
        if (!path_.empty()) fs::remove_all(path_, ignored);
    }
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;
    const fs::path& path() const { return path_; }

  private:
    fs::path path_;
};

Json numberOrNull(double value) {
    return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json jsonOf(const CavityOffset& offset) {
    return {{"mm", numberOrNull(offset.middle_mm)},
            {"worst_place_mm", numberOrNull(offset.most_mm)},
            {"deg", numberOrNull(degreesFromRadians(offset.turn_rad))}};
}

Json jsonOf(const StageFigures& stage) {
    return {{"stage", stage.stage},
            {"inset_mm", stage.inset_mm},
            {"true_offset", jsonOf(stage.truth)},
            {"bound_95_mm", stage.bound_mm},
            {"held", stage.held},
            {"estimated_offset", jsonOf(stage.estimate)},
            {"estimate_bound_95_mm", numberOrNull(stage.estimate_bound_mm)},
            {"estimate_error", jsonOf(stage.estimate_error)},
            {"robot_rms_mm", stage.robot_rms_mm},
            {"cutting_time_s", stage.time_s},
            {"greatest_force_n", stage.greatest_force_n}};
}

std::string offsetText(const CavityOffset& offset) {
    return fmt::format("{:.2f} mm, {:.2f} degrees", offset.middle_mm, degreesFromRadians(offset.turn_rad));
}

Report reportOf(const ProcedureRequest& request, const ProcedureRun& run, double elapsed_ms) {
    Report report;
    Json stages = Json::array();
    for (const StageFigures& stage : run.stages)
        stages.push_back(jsonOf(stage));
    const StageFigures* last = run.last();
    report.json = {
        {"scenario", request.scenario.name},
        {"seed", request.scenario.seed},
        {"implant", run.implant},
        {"case", request.case_file.empty() ? Json(nullptr) : Json(request.case_file)},
        {"case_id", run.case_id},
        {"resumed", run.resumed},
        {"finished", run.finished},
        {"stopped", run.stopped.empty() ? Json(nullptr) : Json(run.stopped)},
        {"registration", {{"true_offset", jsonOf(run.registered)}, {"bound_95_mm", numberOrNull(run.registered95_mm)}}},
        {"stages", stages},
        {"final_offset_mm", last && run.finished ? numberOrNull(last->truth.middle_mm) : Json(nullptr)},
        {"final_rotation_deg",
         last && run.finished ? numberOrNull(degreesFromRadians(last->truth.turn_rad)) : Json(nullptr)},
        {"final_worst_place_mm", last && run.finished ? numberOrNull(last->truth.most_mm) : Json(nullptr)},
        {"remarks", run.remarks},
        {"prepare_ms", run.prepare_ms},
        {"run_ms", run.run_ms},
        {"elapsed_ms", elapsed_ms}};
    report.line("patient", fmt::format("{}, {} side; {}", request.scenario.patient.name,
                                       name(request.scenario.patient.side), run.implant));
    for (const std::string& remark : run.remarks)
        report.line("plan", remark);
    if (std::isfinite(run.registered95_mm))
        report.line("registration", fmt::format("good to {:.2f} mm (95 %) at the cavity; truly {} off",
                                                run.registered95_mm, offsetText(run.registered)));
    for (const StageFigures& stage : run.stages) {
        report.line(fmt::format("cut {}", stage.stage),
                    fmt::format("{:.2f} mm inside the final cavity; it lay {} from its place{}", stage.inset_mm,
                                offsetText(stage.truth),
                                std::isfinite(stage.estimate_bound_mm)
                                    ? fmt::format(" and was found {} from it", offsetText(stage.estimate))
                                    : ", and has not been located"));
        report.line("", fmt::format("announced before the cut: no place of its wall farther off than {:.2f} mm; it was "
                                    "{:.2f} mm: {}",
                                    stage.bound_mm, stage.truth.most_mm, stage.held ? "held" : "NOT held"));
    }
    if (run.finished && last) {
        report.line("result", fmt::format("the final cavity lies {} from the plan, nowhere more than {:.2f} mm off",
                                          offsetText(last->truth), last->truth.most_mm));
    } else {
        report.line("result", "not finished: " + run.stopped);
    }
    if (!request.case_file.empty()) report.line("case", request.case_file);
    report.accepted = run.finished;
    report.json["accepted"] = report.accepted;
    return report;
}

ReportOffset reportOffset(const CavityOffset& offset) {
    return {offset.middle_mm, degreesFromRadians(offset.turn_rad)};
}

// The case's own report, with what only a simulation can know beside it, as a page and as pictures for the archive;
// either may be asked for. What was written goes into `told`.
Result<void> writePages(const ReportRequest& request, const std::vector<StageFigures>& figures, Progress& progress,
                        Report& told) {
    if (request.report.empty() && request.captures.empty()) return {};
    const auto store = CaseStore::open(request.case_file, CaseStore::Access::read);
    if (!store) return store.error();
    auto page = fluorocut::reportOf(*store, progress);
    if (!page) return page.error();
    for (std::size_t n = 0; n < page->stages.size() && n < figures.size(); ++n)
        page->stages[n].truth = reportOffset(figures[n].truth);
    if (!request.report.empty()) {
        if (auto written = writeReport(request.report, *page); !written) return written;
        told.json["report"] = request.report;
        told.line("report", request.report);
    }
    if (!request.captures.empty()) {
        const auto names = writeCaptures(request.captures, *page, request.patient_id);
        if (!names) return names.error();
        told.json["captures"] = {{"folder", request.captures}, {"files", *names}};
        told.line("captures", fmt::format("{} DICOM pictures in {}", names->size(), request.captures));
    }
    return {};
}

Result<void> checkPages(const std::string& report, const std::string& captures, const std::vector<fs::path>& inputs) {
    if (!report.empty()) {
        if (auto good = checkOutput(report, inputs, {".html", ".pdf"}); !good) return good;
    }
    return captures.empty() ? Result<void>() : requireNewFolder(captures);
}

// A line on stderr for each step and stage.
RunListener narrator(const Stopwatch& watch) {
    RunListener listener;
    listener.outcome = [&watch](const Outcome& outcome) {
        // Over the progress bar, where there is one.
        fmt::print(stderr, "{}{:5.1f} s  {:<11} {}\n", isatty(STDERR_FILENO) != 0 ? "\r\033[K" : "", watch.ms() / 1000,
                   outcome.step.name(), outcome.summary);
        for (const std::string& doubt : outcome.doubts)
            fmt::print(stderr, "         doubt       {}\n", doubt);
    };
    listener.stage = [&watch](const StageFigures& stage) {
        fmt::print(stderr, "{:5.1f} s  stage {}     truly {} from its place, found {}; announced {:.2f} mm: {}\n",
                   watch.ms() / 1000, stage.stage, offsetText(stage.truth), offsetText(stage.estimate), stage.bound_mm,
                   stage.held ? "held" : "NOT held");
    };
    return listener;
}

}  // namespace

Result<Report> runProcedureRequest(const ProcedureRequest& request, Progress& progress) {
    std::vector<fs::path> inputs;
    if (!request.scenario.patient.ct.empty()) inputs.push_back(request.scenario.patient.ct);
    if (!request.case_file.empty()) {
        if (auto good = checkOutput(request.case_file, inputs, {".fluorocut", ".case"}); !good) return good.error();
    }
    if (auto good = checkPages(request.report, request.captures, inputs); !good) return good.error();
    const TemporaryFolder folder;
    if (request.case_file.empty() && folder.path().empty())
        return outputFailed("temporary folder", "one that cannot be made", "free the disk, or give --case");
    const fs::path case_file =
        request.case_file.empty() ? folder.path() / "run.fluorocut" : fs::path(request.case_file);
    const Stopwatch watch;
    const auto run = runProcedure(request.scenario, case_file, progress, narrator(watch));
    if (!run) return run.error();
    Report report = reportOf(request, *run, watch.ms());
    if (auto written = writePages({case_file.string(), request.report, request.captures, {}}, run->stages,
                                  Progress::none(), report);
        !written)
        return written.error();
    return report;
}

Result<Report> runReportRequest(const ReportRequest& request, Progress& progress) {
    if (auto good = checkPages(request.report, request.captures, {request.case_file}); !good) return good.error();
    SubProgress looking(progress, 0, 0.7), writing(progress, 0.7, 1);
    const auto run = lookAtProcedure(request.case_file, looking);
    if (!run) return run.error();
    Report report;
    report.json = {{"case", request.case_file}, {"simulated", run->has_value()}};
    auto written = writePages(request, *run ? (*run)->stages : std::vector<StageFigures>(), writing, report);
    if (!written) return written.error();
    return report;
}

}  // namespace fluorocut::cli
