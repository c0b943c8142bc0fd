#include "core/procedure/report_document.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "core/base/units.h"

namespace fluorocut {
namespace {

using Cells = std::vector<ReportCell>;
using Shape = ReportDrawing::Shape;

std::string length(double mm) {
    return std::isfinite(mm) ? fmt::format("{:.2f} mm", mm) : std::string("not known");
}

std::string angle(double degrees) {
    return std::isfinite(degrees) ? fmt::format("{:.2f}°", degrees) : std::string("not known");
}

// "2026-03-01 09:30:00" of "2026-03-01T09:30:00.125Z"; another form as it is.
std::string momentText(std::string utc) {
    if (utc.size() < 20 || utc[10] != 'T' || utc.back() != 'Z') return utc;
    utc[10] = ' ';
    return utc.substr(0, 19);
}

std::string both(double mm, double degrees) {
    return length(mm) + ", " + angle(degrees);
}

bool isSimulated(const ProcedureReport& report) {
    return std::any_of(report.stages.begin(), report.stages.end(),
                       [](const ReportStage& stage) { return stage.truth.has_value(); });
}

// Offsets from cut to cut on a logarithmic scale, with what was announced before each.
ReportDrawing chart(const std::vector<ReportStage>& stages) {
    constexpr double kLeft = 76, kTop = 14, kHeight = 220, kStep = 150, kBottom = kTop + kHeight;
    constexpr double kLeast = 0.01, kMost = 10;
    ReportDrawing chart{
        "Offset after each cut", kLeft + kStep * static_cast<double>(stages.size()) + 10, kBottom + 34, {}};
    const auto y = [&](double mm) {
        return kTop + kHeight * std::log(kMost / std::clamp(mm, kLeast, kMost)) / std::log(kMost / kLeast);
    };
    for (const double mm : {0.01, 0.1, 1.0, 10.0}) {
        chart.shapes.push_back({Shape::Kind::line, kLeft, y(mm), chart.width - kLeft, 0, kReportLine});
        chart.shapes.push_back({Shape::Kind::text, kLeft - 8, y(mm) + 5, 14, 0, kReportFaint, 1, 1,
                                fmt::format("{:g} mm", mm), Shape::Anchor::end});
    }
    for (std::size_t i = 0; i < stages.size(); ++i) {
        const ReportStage& stage = stages[i];
        const double x = kLeft + kStep * (static_cast<double>(i) + 0.5);
        if (std::isfinite(stage.announced_mm)) {
            const double top = y(stage.announced_mm);
            chart.shapes.push_back({Shape::Kind::rectangle, x - 28, top, 56, kBottom - top, kReportBlue, 0.16});
            chart.shapes.push_back({Shape::Kind::line, x - 28, top, 56, 0, kReportBlue, 1, 2});
        }
        if (std::isfinite(stage.measured.mm))
            chart.shapes.push_back({Shape::Kind::circle, x, y(stage.measured.mm), 6, 0, kReportRed});
        if (stage.truth && std::isfinite(stage.truth->mm))
            chart.shapes.push_back({Shape::Kind::cross, x, y(stage.truth->mm), 4, 0, kReportInk, 1, 2.5});
        chart.shapes.push_back(
            {Shape::Kind::text, x, kBottom + 24, 14, 0, kReportInk, 1, 1, stage.name, Shape::Anchor::middle});
    }
    return chart;
}

ReportSection courseSection(const ProcedureReport& report) {
    const bool simulated = isSimulated(report);
    ReportKey key{{{"announced before the cut (95 %)", kReportBlue}, {"found after it", kReportRed}}};
    ReportTable table{
        {{"Cut"}, {"announced before it, 95 %", true}, {"found off the plan", true}, {"known to, 95 %", true}}, {}};
    if (simulated) {
        key.entries.push_back({"truth of the simulation", kReportInk});
        table.columns.push_back({"truly off the plan (simulation)", true});
    }
    for (const ReportStage& stage : report.stages) {
        Cells row{{stage.name},
                  {length(stage.announced_mm)},
                  {both(stage.measured.mm, stage.measured.degrees)},
                  {length(stage.measured_bound_mm)}};
        if (simulated) row.push_back({stage.truth ? both(stage.truth->mm, stage.truth->degrees) : "not known"});
        table.rows.push_back(std::move(row));
    }
    return {"From cut to cut", {chart(report.stages), key, std::move(table)}};
}

ReportKey keyOf(const std::vector<ReportPicture>& pictures) {
    ReportKey key;
    for (const auto kind : {ReportCurve::Kind::planned, ReportCurve::Kind::first, ReportCurve::Kind::found}) {
        const bool drawn = std::any_of(pictures.begin(), pictures.end(), [&](const ReportPicture& picture) {
            return std::any_of(picture.curves.begin(), picture.curves.end(),
                               [&](const ReportCurve& curve) { return curve.kind == kind; });
        });
        const CurveLook& look = lookOf(kind);
        if (drawn) key.entries.push_back({look.label, look.color, look.dashed});
    }
    return key;
}

void addPictures(const std::vector<ReportPicture>& pictures, ReportSection& section) {
    if (pictures.empty()) return;
    if (ReportKey key = keyOf(pictures); !key.entries.empty()) section.blocks.emplace_back(std::move(key));
    section.blocks.emplace_back(ReportPictures{&pictures});
}

ReportSection calibrationSection(const ProcedureReport& report) {
    ReportSection section{"Calibration and registration", {}};
    if (!report.calibrations.empty()) section.blocks.emplace_back(ReportFacts{report.calibrations});
    if (report.views.empty()) return section;
    ReportTable table{{{"View"}, {"C-arm"}, {"Imager"}, {"residual in the registration", true}}, {}};
    for (const auto& [cut, residual] : report.views.front().beads_px)
        table.columns.push_back({"beads, " + cut, true});
    for (const ReportView& view : report.views) {
        Cells row{{view.name}, {view.position}, {view.imager}, {both(view.residual_mm, view.residual_deg)}};
        for (const auto& [cut, residual] : view.beads_px)
            row.push_back({std::isfinite(residual) ? fmt::format("{:.2f} px", residual) : "not known"});
        row.resize(table.columns.size());
        table.rows.push_back(std::move(row));
    }
    section.blocks.emplace_back(std::move(table));
    return section;
}

ReportSection budgetSection(const ProcedureReport& report) {
    ReportTable table{{{""}, {"", true}, {""}}, {}};
    for (const ReportTerm& term : report.budget) {
        if (term.share < 0.005) continue;  // they round to nothing
        table.rows.push_back({{term.name},
                              {fmt::format("{:.0f} %", 100 * term.share)},
                              {"", ReportCell::Tone::plain, std::clamp(term.share, 0.0, 1.0)}});
    }
    return {"Where the first registration's error comes from", {ReportText{report.budget_at}, std::move(table)}};
}

ReportSection stageSection(const ReportStage& stage) {
    ReportSection section{stage.name, {}};
    for (const std::string& doubt : stage.doubts)
        section.blocks.emplace_back(ReportText{doubt, ReportText::Style::doubt});
    section.blocks.emplace_back(ReportFacts{stage.facts});
    addPictures(stage.pictures, section);
    ReportTable table{{{""}, {""}}, {}};
    for (const Judgement& judgement : stage.acceptance) {
        const bool good = judgement.accepted();
        table.rows.push_back({{good ? "good" : "not good", good ? ReportCell::Tone::good : ReportCell::Tone::bad},
                              {judgement.sentence()}});
    }
    if (!table.rows.empty()) section.blocks.emplace_back(std::move(table));
    return section;
}

std::string triple(const Vector3& v, int digits) {
    return fmt::format("{:.{}f}, {:.{}f}, {:.{}f}", v.x(), digits, v.y(), digits, v.z(), digits);
}

std::string sigmaText(const ReportPose& pose) {
    if (!pose.sigma_mm || !pose.sigma_deg) return "not known";
    if (*pose.sigma_mm == 0 && *pose.sigma_deg == 0) return "exact";
    return fmt::format("{:.3f} mm, {:.3f}°", *pose.sigma_mm, *pose.sigma_deg);
}

ReportSection poseSection(const ProcedureReport& report) {
    ReportTable table{{{"Pose"}, {"from"}, {"place, mm", true}, {"rotation vector, degrees", true}, {"1 σ", true}}, {}};
    for (const ReportPose& pose : report.poses) {
        const Rigid3& m = pose.target_from_source;
        table.rows.push_back(
            {{pose.name},
             {pose.from},
             {triple(m.translation(), 2)},
             {triple(logRotation(m.rotation()).unaryExpr([](double rad) { return degreesFromRadians(rad); }), 2)},
             {sigmaText(pose)}});
    }
    return {"Poses", {std::move(table)}};
}

ReportSection decisionSection(const ProcedureReport& report) {
    ReportTable table{{{"when (UTC)"}, {"step"}, {"decision"}, {"who"}, {"why"}}, {}};
    for (const ReportDecision& decision : report.decisions) {
        table.rows.push_back({{momentText(decision.when)},
                              {decision.step},
                              {decision.accepted ? "accepted" : "refused",
                               decision.accepted ? ReportCell::Tone::good : ReportCell::Tone::bad},
                              {decision.who},
                              {decision.why}});
    }
    return {"Decisions", {std::move(table)}};
}

}  // namespace

const CurveLook& lookOf(ReportCurve::Kind kind) {
    static constexpr CurveLook kPlanned{"planned", "planned", {0x56, 0xb4, 0xe9}, true},
        kFirst{"first", "planned for the first cut", {0xf0, 0xe4, 0x42}, true},
        kFound{"found", "found", {0xe6, 0x9f, 0x00}, false};
    return kind == ReportCurve::Kind::planned ? kPlanned : kind == ReportCurve::Kind::first ? kFirst : kFound;
}

ReportDocument documentOf(const ProcedureReport& report) {
    ReportDocument document;
    document.title = report.title;
    document.notice = "FluoroCut: research software, not a medical device";
    document.footer =
        fmt::format("{}. Case {}, newest record {}.", report.software, report.case_id, report.newest_hash);
    document.sections.push_back(
        {"",
         {ReportText{report.conclusion, ReportText::Style::conclusion, report.finished}, ReportFacts{report.facts}}});
    if (!report.stages.empty()) document.sections.push_back(courseSection(report));
    if (!report.plan_pictures.empty()) {
        document.sections.push_back({"The plan", {}});
        addPictures(report.plan_pictures, document.sections.back());
    }
    for (const ReportStage& stage : report.stages)
        document.sections.push_back(stageSection(stage));
    if (!report.calibrations.empty() || !report.views.empty()) document.sections.push_back(calibrationSection(report));
    if (!report.budget.empty()) document.sections.push_back(budgetSection(report));
    if (!report.poses.empty()) document.sections.push_back(poseSection(report));
    if (!report.decisions.empty()) document.sections.push_back(decisionSection(report));
    return document;
}

}  // namespace fluorocut
