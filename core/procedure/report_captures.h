// Pictures of a report for the archive: the plan's views and the final ones, with what is drawn over them burned in, as
// DICOM Secondary Capture (core/io/secondary_capture.h). One study for a case, one series for the planned and one for
// the final views.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/procedure/report_html.h"

namespace fluorocut {

// planned_1.dcm, planned_2.dcm, ..., final_1.dcm, ... in a folder that is new or empty; it appears whole or not at all.
// Their names, without the folder. `patient_id`: the archive's; may be empty. noSolution: the report has no pictures
// yet.
Result<std::vector<std::string>> writeCaptures(const std::filesystem::path& folder, const ProcedureReport& report,
                                               const std::string& patient_id = {});

}  // namespace fluorocut
