// The report of a procedure as one page of HTML that needs nothing else: pictures lie in it, contours are drawn over
// them as vectors, and it prints. What stands in it comes from the case (report.h); what only a simulation can know,
// the true offsets, is added by whoever ran one, and shown apart.
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
    enum class Kind { planned, found };
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

struct ProcedureReport {
    std::string title;
    std::string conclusion;  // one or two sentences for the surgeon
    bool finished = false;   // all steps are accepted
    std::vector<std::pair<std::string, std::string>> facts;
    std::string budget_at;  // "0.31 mm (95 %) at the stem's tip"
    std::vector<ReportTerm> budget;
    std::vector<ReportStage> stages;
    std::vector<ReportDecision> decisions;
    std::string software, case_id, newest_hash;
};

// Fails where a picture cannot be encoded.
Result<std::string> html(const ProcedureReport& report);

}  // namespace fluorocut
