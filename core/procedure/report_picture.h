// Pictures of a report on paper and in archives: grey as the eye takes it, contours drawn over it.
#pragma once

#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/procedure/report_html.h"

namespace fluorocut {

// As a C-arm's monitor shows it (core/imaging/display_picture.h), 0 to 255, with the contrast set by what lies about
// the curves: an intensifier's dark corners and the open beam take none of it. invalidInput: no pixels.
Result<Image> reportGrey(const ReportPicture& picture);

// The picture with its contours, its key and these lines burned in, for programs that show nothing but pixels. Enlarged
// by a whole number so that lines and letters are sharp: at least 1024 pixels wide.
Result<ColorImage> burnedIn(const ReportPicture& picture, const std::vector<std::string>& lines);

}  // namespace fluorocut
