#include "core/procedure/report.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "core/base/units.h"
#include "core/imaging/silhouette.h"
#include "core/procedure/standing.h"
#include "core/procedure/steps.h"

namespace fluorocut {
namespace {

// Of one case: reads the newest result of every step.
class Reader {
  public:
    Reader(const CaseStore& store, CaseContent content) : store_(store), content_(std::move(content)) {}

    const CaseContent& content() const { return content_; }
    ContentReader reader() const {
        return [this](const std::string& hash) { return store_.bytes(hash); };
    }

    // Nothing: it has not been done.
    template <class T>
    Result<std::optional<T>> newest(const std::string& step,
                                    Result<T> (*parse)(std::string_view, const std::string&)) const {
        const Step* found = newestStep(content_, step);
        if (!found) return std::optional<T>();
        const Result<std::string> text = store_.bytes(found->result);
        if (!text) return text.error();
        Result<T> result = parse(*text, step);
        if (!result) return result.error();
        return std::optional<T>(std::move(*result));
    }

    Result<ProcedureSetup> setup() const {
        const Step* step = newestStep(content_, kSetupStep);
        if (!step) return invalidInput("case", "no procedure in it", "a case in which one was begun");
        const Result<std::string> text = store_.bytes(step->result);
        if (!text) return text.error();
        return readSetup(*text, reader());
    }

    Result<StepInputs> inputsFor(const ProcedureStep& step) const {
        const Result<std::vector<StepInput>> inputs = inputsOf(step, content_, store_);
        if (!inputs) return inputs.error();
        return StepInputs(*inputs, reader());
    }

  private:
    const CaseStore& store_;
    CaseContent content_;
};

std::string mm(double value) {
    return std::isfinite(value) ? fmt::format("{:.2f} mm", value) : std::string("not known");
}

void addContours(const Silhouette& cavity, const CArm& carm, const Rigid3& imager_from_cavity, ReportCurve::Kind kind,
                 std::vector<ReportCurve>& curves) {
    SilhouetteOptions options;
    options.find_outline = true;
    const Result<std::vector<ContourLoop>> loops = cavity.project(carm, imager_from_cavity, options);
    if (!loops) return;  // not wholly in the picture: it is shown without
    for (const ContourLoop& loop : *loops) {
        for (const std::vector<ContourPoint>& part : contourParts(loop, [](const auto& p) { return p.outline; })) {
            ReportCurve curve{kind, {}};
            for (const ContourPoint& point : part)
                if (point.pixel.allFinite()) curve.points.push_back(point.pixel);
            if (curve.points.size() > 1) curves.push_back(std::move(curve));
        }
    }
}

Result<std::vector<ReportPicture>> picturesOf(const ProcedureSetup& setup, int stage, const LocationResult& location,
                                              const StepInputs& inputs) {
    const Result<StageImages> taken = readImages(setup, stage, inputs);
    if (!taken) return taken.error();
    Result<TriangleMesh> mesh = readStageMesh(stage, inputs);
    if (!mesh) return mesh.error();
    const Result<Silhouette> cavity = Silhouette::prepare(std::move(*mesh));
    if (!cavity) return cavity.error();
    std::vector<ReportPicture> pictures;
    for (std::size_t i = 0; i < setup.views.size() && i < location.views.size(); ++i) {
        const ProcedureView& view = setup.views[i];
        ReportPicture picture{fmt::format("{}, after cut {}", view.name, stage), taken->images[i], {}};
        const Rigid3& imager_from_femur = location.views[i].imager_from_femur.target_from_source;
        addContours(*cavity, view.carm, imager_from_femur * setup.plan.femur_from_cavity, ReportCurve::Kind::planned,
                    picture.curves);
        addContours(*cavity, view.carm, imager_from_femur * location.femur_from_cut_cavity.target_from_source,
                    ReportCurve::Kind::found, picture.curves);
        pictures.push_back(std::move(picture));
    }
    return pictures;
}

void addFindings(const StepFindings& findings, ReportStage& stage) {
    stage.acceptance.insert(stage.acceptance.end(), findings.acceptance.begin(), findings.acceptance.end());
    stage.doubts.insert(stage.doubts.end(), findings.doubts.begin(), findings.doubts.end());
}

// Nothing: not cut yet.
Result<std::optional<ReportStage>> stageOf(const Reader& reader, const ProcedureSetup& setup, int number) {
    const auto cut = reader.newest(ProcedureStep{StepKind::cut, number}.name(), parseCut);
    if (!cut) return cut.error();
    if (!*cut) return std::optional<ReportStage>();
    const auto location = reader.newest(ProcedureStep{StepKind::locate, number}.name(), parseLocation);
    if (!location) return location.error();
    const auto correction = reader.newest(ProcedureStep{StepKind::correct, number}.name(), parseCorrection);
    if (!correction) return correction.error();

    const CutStepResult& done = **cut;
    ReportStage stage;
    stage.name = fmt::format("Cut {} of {}", number, setup.plan.stages);
    stage.announced_mm = done.bound_mm;
    stage.facts = {{"Cavity", done.inset_mm > 0 ? fmt::format("{:.2f} mm inside the final one", done.inset_mm)
                                                : std::string("the final one")},
                   {"Cutting", fmt::format("{:.1f} m in {:.0f} min {:02.0f} s", done.length_mm / 1000,
                                           std::floor(done.time_s / 60), std::fmod(done.time_s, 60))},
                   {"Greatest force", fmt::format("{:.1f} N", done.greatest_force_n)},
                   {"Bone moved while it was cut", fmt::format("at most {}", mm(done.bone_most_mm))}};
    addFindings(done.findings, stage);
    if (*location) {
        const LocationResult& found = **location;
        stage.measured = {found.offset.most_mm, degreesFromRadians(found.offset.turn_rad)};
        stage.measured_bound_mm = found.bound_mm;
        addFindings(found.findings, stage);
        const Result<StepInputs> inputs = reader.inputsFor({StepKind::locate, number});
        if (!inputs) return inputs.error();
        Result<std::vector<ReportPicture>> pictures = picturesOf(setup, number, found, *inputs);
        if (!pictures) return pictures.error();
        stage.pictures = std::move(*pictures);
    }
    if (*correction) {
        const CorrectionResult& next = **correction;
        if (next.next_bound_mm) {
            stage.facts.emplace_back(
                "Correction for the next cut",
                fmt::format("{} and {:.2f} degrees; then known to {} (95 %)", mm(next.correction.most_mm),
                            degreesFromRadians(next.correction.turn_rad), mm(*next.next_bound_mm)));
        }
        addFindings(next.findings, stage);
    }
    return std::optional(std::move(stage));
}

std::string conclusionOf(const ProcedureReport& report, const std::vector<StepStanding>& steps) {
    for (const StepStanding& standing : steps) {
        if (standing.state == StepState::accepted) continue;
        return fmt::format("Not finished: the next step is \"{}\"{}.", standing.step.name(),
                           standing.why.empty() ? std::string() : " (" + standing.why + ")");
    }
    if (report.stages.empty()) return "Finished.";
    const ReportStage& last = report.stages.back();
    return fmt::format(
        "The final cavity lies {} and {:.2f} degrees from its plan at its worst place, which is known to {} (95 %). "
        "The "
        "first cut lay {} off.",
        mm(last.measured.mm), last.measured.degrees, mm(last.measured_bound_mm), mm(report.stages.front().measured.mm));
}

}  // namespace

Result<ProcedureReport> reportOf(const CaseStore& store, Progress& progress) {
    Result<CaseContent> content = store.content();
    if (!content) return content.error();
    const Result<CaseInfo> info = store.info();
    if (!info) return info.error();
    const Reader reader(store, std::move(*content));
    const Result<ProcedureSetup> setup = reader.setup();
    if (!setup) return setup.error();
    const auto registration = reader.newest(ProcedureStep{StepKind::registration, 0}.name(), parseRegistration);
    if (!registration) return registration.error();
    const auto plan = reader.newest(ProcedureStep{StepKind::plan, 0}.name(), parsePlan);
    if (!plan) return plan.error();

    ProcedureReport report;
    report.title = info->label;
    report.software = info->software;
    report.case_id = info->id;
    report.newest_hash = info->newest_hash;
    report.facts = {{"Patient", setup->patient.name},
                    {"Side", setup->patient.side},
                    {"Implant", setup->plan.implant},
                    {"Begun", info->created_utc},
                    {"Calibrated", setup->calibration.calibrated_utc},
                    {"Views", fmt::format("{}", setup->views.size())}};
    if (*registration) {
        report.facts.emplace_back("First registration", (*registration)->findings.summary);
        report.budget_at = (*registration)->budget_sentence;
        for (const BudgetShare& share : (*registration)->budget)
            report.budget.push_back({share.term, share.share});
    }
    if (*plan) report.facts.emplace_back("Plan", (*plan)->findings.summary);
    for (int number = 1; number <= setup->plan.stages; ++number) {
        if (progress.isCancelled()) return cancelled("report");
        progress.report(static_cast<double>(number - 1) / setup->plan.stages, "writing the report");
        Result<std::optional<ReportStage>> stage = stageOf(reader, *setup, number);
        if (!stage) return stage.error();
        if (*stage) report.stages.push_back(std::move(**stage));
    }
    for (const Decision& decision : reader.content().decisions) {
        const auto step = std::find_if(reader.content().steps.begin(), reader.content().steps.end(),
                                       [&](const Step& s) { return s.record == decision.step; });
        report.decisions.push_back({decision.recorded_utc, step == reader.content().steps.end() ? "" : step->name,
                                    decision.who, decision.why, decision.accepted});
    }
    const std::vector<StepStanding> steps = standingOf(reader.content(), setup->plan.stages);
    report.finished =
        std::all_of(steps.begin(), steps.end(), [](const StepStanding& s) { return s.state == StepState::accepted; });
    report.conclusion = conclusionOf(report, steps);
    return report;
}

}  // namespace fluorocut
