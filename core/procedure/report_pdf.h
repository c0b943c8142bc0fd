// The report as a PDF: A4 pages with text that can be searched, contours as vectors, bookmarks; for the file of a
// patient and for printing. It tells what the page of HTML tells (report_document.h). The same report gives the same
// pages.
#pragma once

#include <string>

#include "core/base/result.h"
#include "core/procedure/report_html.h"

namespace fluorocut {

// The file's bytes. Fails where a picture has no pixels.
Result<std::string> pdf(const ProcedureReport& report);

}  // namespace fluorocut
