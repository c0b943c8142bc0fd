// The report of a procedure, read off its case: what was found at every step that has been done, the images after each
// cut with the cavity as it was planned and as it was found, and who decided what.
#pragma once

#include <filesystem>

#include "core/base/progress.h"
#include "core/base/result.h"
#include "core/casestore/case_store.h"
#include "core/procedure/report_html.h"

namespace fluorocut {

// Of a case in which a procedure was begun, finished or not; one stage for each that has been cut. invalidInput: there
// is no procedure in it, or what lies in it cannot be read.
Result<ProcedureReport> reportOf(const CaseStore& store, Progress& progress = Progress::none());

// By the extension: .pdf (report_pdf.h), .html (report_html.h). invalidOption: another one.
Result<void> writeReport(const std::filesystem::path& path, const ProcedureReport& report);
// The same question before long work.
Result<void> checkReportFile(const std::filesystem::path& path);

}  // namespace fluorocut
