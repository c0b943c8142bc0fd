#include "core/procedure/report.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "core/base/units.h"
#include "core/imaging/silhouette.h"
#include "core/io/atomic_file.h"
#include "core/io/mesh_file.h"
#include "core/procedure/report_pdf.h"
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

std::string lowerExtension(const std::filesystem::path& path) {
    std::string extension = path.extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return extension;
}

// Root mean square over the axes, mm and degrees.
std::pair<std::optional<double>, std::optional<double>> sigmasOf(const Pose& pose) {
    if (!pose.covariance) return {};
    const Vector6 variance = pose.covariance->diagonal();
    return {std::sqrt(variance.head<3>().mean()), degreesFromRadians(std::sqrt(variance.tail<3>().mean()))};
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

// A stage's image of each view with the cavities that it is to be held against: { kind, mesh, femur_from_cavity }.
struct DrawnCavity {
    ReportCurve::Kind kind;
    const Silhouette* cavity;
    Rigid3 femur_from_cavity;
};

Result<std::vector<ReportPicture>> picturesOf(const ProcedureSetup& setup, int stage, const StepInputs& inputs,
                                              const std::vector<Rigid3>& imager_from_femur, const std::string& when,
                                              const std::vector<DrawnCavity>& cavities) {
    const Result<StageImages> taken = readImages(setup, stage, inputs);
    if (!taken) return taken.error();
    std::vector<ReportPicture> pictures;
    for (std::size_t i = 0; i < setup.views.size() && i < imager_from_femur.size(); ++i) {
        const ProcedureView& view = setup.views[i];
        ReportPicture picture{view.name + ", " + when, taken->images[i], {}};
        for (const DrawnCavity& drawn : cavities)
            addContours(*drawn.cavity, view.carm, imager_from_femur[i] * drawn.femur_from_cavity, drawn.kind,
                        picture.curves);
        pictures.push_back(std::move(picture));
    }
    return pictures;
}

Result<Silhouette> stageSilhouette(const CaseStore& store, const PlannedStage& stage) {
    const Result<std::string> bytes = store.bytes(stage.mesh);
    if (!bytes) return bytes.error();
    Result<MeshFile> mesh =
        readBytes("stage.stl", *bytes, [](const std::filesystem::path& path) { return readMesh(path); });
    if (!mesh) return mesh.error();
    return Silhouette::prepare(std::move(mesh->mesh));
}

// The first and the final cavity where they are to be cut, over the images before the first cut.
Result<std::vector<ReportPicture>> planPictures(const CaseStore& store, const ProcedureSetup& setup,
                                                const StepInputs& inputs, const RegistrationResult& registration,
                                                const PlanResult& plan) {
    if (plan.stages.empty()) return std::vector<ReportPicture>();
    const Result<Silhouette> final = stageSilhouette(store, plan.stages.back());
    if (!final) return final.error();
    const Result<Silhouette> first = stageSilhouette(store, plan.stages.front());
    if (!first) return first.error();
    std::vector<DrawnCavity> cavities{{ReportCurve::Kind::planned, &*final, setup.plan.femur_from_cavity}};
    if (plan.stages.size() > 1) cavities.push_back({ReportCurve::Kind::first, &*first, setup.plan.femur_from_cavity});
    std::vector<Rigid3> poses;
    for (const RegisteredView& view : registration.views)
        poses.push_back(view.imager_from_femur.target_from_source);
    return picturesOf(setup, 0, inputs, poses, "before the first cut", cavities);
}

void addFindings(const StepFindings& findings, ReportStage& stage) {
    stage.acceptance.insert(stage.acceptance.end(), findings.acceptance.begin(), findings.acceptance.end());
    stage.doubts.insert(stage.doubts.end(), findings.doubts.begin(), findings.doubts.end());
}

std::string sigmas(const Pose& pose) {
    const auto [place, turn] = sigmasOf(pose);
    return place ? fmt::format("{:.3f} mm, {:.3f}°", *place, *turn) : std::string("not known");
}

std::string duration(double s) {
    if (!std::isfinite(s)) return "not known";
    const double minutes = std::floor(s / 60);
    return minutes < 180 ? fmt::format("{:.0f} min", minutes) : fmt::format("{:.1f} h", s / 3600);
}

// How exactly everything is known that the procedure rests on (standard deviations), and how old it was at each cut.
Result<std::vector<std::pair<std::string, std::string>>> calibrationsOf(const Reader& reader,
                                                                        const ProcedureSetup& setup) {
    const ProcedureCalibration& known = setup.calibration;
    std::vector<std::pair<std::string, std::string>> rows{
        {"Calibrated", known.calibrated_utc},
        {"Imager",
         fmt::format("focal length to {:.2f} mm, image centre to {:.2f} px, distortion straightened to {:.3f} mm "
                     "(1 σ)",
                     known.focal_length_sigma_mm, known.image_centre_sigma_px, known.local_distortion_mm)},
        {"Corkscrew on the flange", sigmas(known.flange_from_corkscrew) + " (1 σ)"},
        {"Corkscrew's dimensions", fmt::format("{:.3f} mm (1 σ)", known.corkscrew_sigma_mm)},
        {"Beads in the femur",
         fmt::format("{}, each to {:.3f} mm (1 σ)", setup.patient.beads.beads.size(), known.bead_sigma_mm)},
        {"Robot", fmt::format("{:.3f} mm, {:.3f}° (root mean square)", known.robot_sigma_mm,
                              degreesFromRadians(known.robot_sigma_rad))}};
    for (int number = 1; number <= setup.plan.stages; ++number) {
        const auto shown = reader.newest(ProcedureStep{StepKind::timeOut, number}.name(), parseTimeOut);
        if (!shown) return shown.error();
        if (*shown) rows.emplace_back(fmt::format("Age at time-out {}", number), duration((*shown)->calibration_age_s));
    }
    return rows;
}

ReportView viewOf(const ProcedureView& view) {
    const CArm& carm = view.carm;
    return {view.name,
            fmt::format("orbital {:.0f}°, angulation {:.0f}°", degreesFromRadians(view.position.orbital_rad),
                        degreesFromRadians(view.position.angulation_rad)),
            fmt::format("f {:.1f} mm, centre {:.1f}, {:.1f} px, pixel {:.3f} mm{}", carm.focal_length_mm,
                        carm.principal_point_px.x(), carm.principal_point_px.y(), carm.pixel_mm.x(),
                        carm.distortion ? ", straightened" : ""),
            kUnknown,
            kUnknown,
            {}};
}

ReportPose reportPose(const std::string& name, const std::string& from, const Pose& pose) {
    const auto [place, turn] = sigmasOf(pose);
    return {name, from, pose.target_from_source, place, turn};
}

// Everything by which one frame is found from another, in the order in which it was found.
Result<void> addPosesAndViews(const Reader& reader, const ProcedureSetup& setup,
                              const std::optional<RegistrationResult>& registration, ProcedureReport& report) {
    const Matrix6 exact = Matrix6::Zero();
    report.poses.push_back(reportPose("flange from corkscrew", "calibration", setup.calibration.flange_from_corkscrew));
    report.poses.push_back(reportPose("flange from cutter", "calibration",
                                      {Frame::flange, Frame::cutter, setup.calibration.flange_from_cutter, exact}));
    report.poses.push_back(
        reportPose("femur from cavity", "plan", {Frame::femur, Frame::cavity, setup.plan.femur_from_cavity, exact}));
    for (const ProcedureView& view : setup.views)
        report.views.push_back(viewOf(view));
    if (registration) {
        for (std::size_t i = 0; i < registration->views.size() && i < report.views.size(); ++i) {
            const RegisteredView& view = registration->views[i];
            if (!view.used) report.views[i].position += ", left out";
            report.views[i].residual_mm = view.residual_mm;
            report.views[i].residual_deg = degreesFromRadians(view.residual_rad);
            report.poses.push_back(reportPose("imager from femur, " + view.name, "register", view.imager_from_femur));
        }
        report.poses.push_back(reportPose("robot from femur", "register", registration->robot_from_femur));
    }
    for (int number = 1; number <= setup.plan.stages; ++number) {
        const std::string locate = ProcedureStep{StepKind::locate, number}.name();
        const auto location = reader.newest(locate, parseLocation);
        if (!location) return location.error();
        if (*location) {
            report.poses.push_back(reportPose("femur from cut cavity", locate, (*location)->femur_from_cut_cavity));
            for (std::size_t i = 0; i < report.views.size() && i < (*location)->views.size(); ++i)
                report.views[i].beads_px.emplace_back(fmt::format("cut {}", number), (*location)->views[i].beads_px);
        }
        const std::string correct = ProcedureStep{StepKind::correct, number}.name();
        const auto correction = reader.newest(correct, parseCorrection);
        if (!correction) return correction.error();
        if (*correction)
            report.poses.push_back(reportPose("robot from femur", correct, (*correction)->robot_from_femur));
    }
    return {};
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
        Result<TriangleMesh> mesh = readStageMesh(number, *inputs);
        if (!mesh) return mesh.error();
        const Result<Silhouette> cavity = Silhouette::prepare(std::move(*mesh));
        if (!cavity) return cavity.error();
        std::vector<Rigid3> poses;
        for (const LocatedView& view : found.views)
            poses.push_back(view.imager_from_femur.target_from_source);
        Result<std::vector<ReportPicture>> pictures =
            picturesOf(setup, number, *inputs, poses, fmt::format("after cut {}", number),
                       {{ReportCurve::Kind::found, &*cavity, found.femur_from_cut_cavity.target_from_source},
                        {ReportCurve::Kind::planned, &*cavity, setup.plan.femur_from_cavity}});
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
                    {"Newest record", info->newest_utc},
                    {"Views", fmt::format("{}", setup->views.size())},
                    {"Case", info->id},
                    {"Newest hash", info->newest_hash},
                    {"Software", info->software}};
    report.patient = setup->patient.name;
    report.side = setup->patient.side;
    report.created_utc = info->created_utc;
    auto calibrations = calibrationsOf(reader, *setup);
    if (!calibrations) return calibrations.error();
    report.calibrations = std::move(*calibrations);
    if (auto added = addPosesAndViews(reader, *setup, *registration, report); !added) return added.error();
    if (*registration) {
        report.facts.emplace_back("First registration", (*registration)->findings.summary);
        report.budget_at = (*registration)->budget_sentence;
        for (const BudgetShare& share : (*registration)->budget)
            report.budget.push_back({share.term, share.share});
    }
    if (*plan) report.facts.emplace_back("Plan", (*plan)->findings.summary);
    if (*registration && *plan) {
        const Result<StepInputs> inputs = reader.inputsFor({StepKind::registration, 0});
        if (!inputs) return inputs.error();
        auto pictures = planPictures(store, *setup, *inputs, **registration, **plan);
        if (!pictures) return pictures.error();
        report.plan_pictures = std::move(*pictures);
    }
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

Result<void> checkReportFile(const std::filesystem::path& path) {
    const std::string extension = lowerExtension(path);
    if (extension == ".html" || extension == ".pdf") return {};
    return invalidOption(path.string(), extension.empty() ? "no extension" : extension, ".pdf or .html");
}

Result<void> writeReport(const std::filesystem::path& path, const ProcedureReport& report) {
    if (Result<void> good = checkReportFile(path); !good) return good;
    const Result<std::string> bytes = lowerExtension(path) == ".pdf" ? pdf(report) : html(report);
    if (!bytes) return bytes.error();
    return writeWhole(path, *bytes);
}

}  // namespace fluorocut
