// A report as a value, and as one page of HTML that needs nothing else: pictures lie in it, contours are drawn over
// them as vectors, and it prints. What stands in it comes from the case (report.h); what only a simulation can know,
// the true offsets, is added by whoever ran one, and shown apart. As PDF: report_pdf.h.
//
// mm and degrees, as people read them.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/acceptance.h"
#include "core/base/result.h"
#include "core/geometry/rigid3.h"
#include "core/image/image.h"

namespace fluorocut {

// A contour in pixels of its picture, pixel centres at integers.
struct ReportCurve {
    enum class Kind { planned, first, found };  // the final cavity's plan, the first stage's, what was found
    Kind kind = Kind::planned;
    std::vector<Vector2> points;
};

struct ReportPicture {
    std::string title;
    Image image;  // levels, bright: more photons; shown by its own range
    std::vector<ReportCurve> curves;
};

struct ReportOffset {
    double mm = std::numeric_limits<double>::quiet_NaN();
    double degrees = std::numeric_limits<double>::quiet_NaN();
};

struct ReportStage {
    std::string name;  // "Cut 1 of 3"
    std::vector<std::pair<std::string, std::string>> facts;
    double announced_mm = std::numeric_limits<double>::quiet_NaN();  // before the cut: 95 % bound of its worst place
    ReportOffset measured;                                           // planned to found, in the images after the cut
    double measured_bound_mm = std::numeric_limits<double>::quiet_NaN();  // 95 %, of what was found
    std::optional<ReportOffset> truth;                                    // in a simulation
    Acceptance acceptance;
    std::vector<std::string> doubts;
    std::vector<ReportPicture> pictures;
};

struct ReportDecision {
    std::string when, step, who, why;
    bool accepted = false;
};

struct ReportTerm {
    std::string name;
    double share = 0;  // of the variance
};

struct ReportView {
    std::string name, position;  // "ap", "orbital 0°, angulation 0°"
    std::string imager;          // "f 1000 mm, centre 255.5, 255.5 px, 0.32 mm pixels"
    double residual_mm = std::numeric_limits<double>::quiet_NaN();  // of the registration
    double residual_deg = std::numeric_limits<double>::quiet_NaN();
    std::vector<std::pair<std::string, double>> beads_px;  // after which cut, residual of the femur's beads
};

struct ReportPose {
    std::string name, from;  // "robot from femur", "register"
    Rigid3 target_from_source;
    std::optional<double> sigma_mm, sigma_deg;  // root mean square over the axes
};

struct ProcedureReport {
    std::string title;
    std::string conclusion;  // one or two sentences for the surgeon
    bool finished = false;   // all steps are accepted
    std::vector<std::pair<std::string, std::string>> facts;
    std::vector<std::pair<std::string, std::string>> calibrations;  // what, and how exactly it is known; ages
    std::vector<ReportView> views;
    std::vector<ReportPicture> plan_pictures;  // before the first cut, with what is planned
    std::string budget_at;                     // "0.31 mm (95 %) at the stem's tip"
    std::vector<ReportTerm> budget;
    std::vector<ReportStage> stages;
    std::vector<ReportPose> poses;
    std::vector<ReportDecision> decisions;
    std::string software, case_id, newest_hash;
    // For an archive.
    std::string patient, side, created_utc;
};

// Fails where a picture cannot be encoded.
Result<std::string> html(const ProcedureReport& report);

}  // namespace fluorocut
