#include "core/imaging/carm_image.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <fmt/format.h>

namespace fluorocut {

Result<void> requireTakenBy(const CArm& carm, const Image& image, std::string_view where) {
    if (image.width() != carm.columns || image.height() != carm.rows) {
        return invalidInput(std::string(where), fmt::format("{} x {} pixels", image.width(), image.height()),
                            fmt::format("{} x {}, as the C-arm file says", carm.columns, carm.rows),
                            "give the C-arm file that belongs to this image");
    }
    if (!std::all_of(image.pixels().begin(), image.pixels().end(), [](float v) { return std::isfinite(v); }))
        return invalidInput(std::string(where), "a pixel that is not a number", "finite levels", "export it again");
    return {};
}

}  // namespace fluorocut
