// Whether an image can be one of a C-arm's: the right number of pixels, all of them numbers.
#pragma once

#include <string_view>

#include "core/base/result.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"

namespace fluorocut {

// `where` names the image: "image", "view ap, image".
Result<void> requireTakenBy(const CArm& carm, const Image& image, std::string_view where = "image");

}  // namespace fluorocut
