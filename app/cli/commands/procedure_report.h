// A procedure that was run in simulation, for `demo` and `procedure run`: progress as it goes, figures, a summary.
// Reports and pictures of any case, for `procedure report`.
#pragma once

#include <string>

#include "app/cli/report.h"
#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/experiments/procedure_run.h"

namespace fluorocut::cli {

struct ProcedureRequest {
    Scenario scenario;
    std::string case_file;  // empty: one that is gone afterwards
    std::string report;     // .pdf or .html; empty: none
    std::string captures;   // folder for DICOM pictures; empty: none
};

Result<Report> runProcedureRequest(const ProcedureRequest& request, Progress& progress);

// Of a case that is there: it is only read.
struct ReportRequest {
    std::string case_file;
    std::string report;    // .pdf or .html
    std::string captures;  // folder for DICOM pictures; empty: none
    std::string patient_id;
};

Result<Report> runReportRequest(const ReportRequest& request, Progress& progress);

}  // namespace fluorocut::cli
