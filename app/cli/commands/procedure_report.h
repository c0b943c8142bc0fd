// A procedure that was run in simulation, for `demo` and `procedure run`: progress as it goes, figures, a summary.
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
    std::string report;     // .html; empty: none
};

Result<Report> runProcedureRequest(const ProcedureRequest& request, Progress& progress);

}  // namespace fluorocut::cli
