#include "core/imaging/display_picture.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/base/option_checks.h"
#include "core/image/blur.h"

namespace fluorocut {
namespace {

float percentile(std::vector<float>& values, double percent) {
    const auto place = static_cast<std::ptrdiff_t>(percent / 100 * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), values.begin() + place, values.end());
    return values[static_cast<std::size_t>(place)];
}

}  // namespace

Result<void> DisplayOptions::validate() const {
    return requireRanges({{"compression", compression, 0, 1, ""},
                          {"detail", detail, 0, 10, ""},
                          {"sigma_part", sigma_part, 1e-4, 1, ""},
                          {"black_percentile", black_percentile, 0, 50, "%"},
                          {"white_percentile", white_percentile, 50, 100, "%"}});
}

Result<Image> displayPicture(const Image& levels, const DisplayOptions& options) {
    if (const Result<void> good = options.validate(); !good) return good.error();
    if (levels.empty()) return Image();
    float most = 0;
    for (const float level : levels.pixels()) {
        if (!std::isfinite(level)) return invalidInput("image", "a pixel that is not finite", "finite pixels");
        most = std::max(most, level);
    }
    // Below a 60,000th of the brightest pixel there is nothing but electronic noise. 97 % of the brightest is open
    // beam; where there is none, the few pixels left out do not matter.
    const float floor = std::max(most / 60000, std::numeric_limits<float>::min());
    const float open = 0.97F * most;
    Image picture = levels;
    Image in_body(levels.width(), levels.height(), 0.0F);
    for (std::size_t i = 0; i < picture.size(); ++i) {
        if (levels.pixels()[i] < open) in_body.pixels()[i] = 1;
        picture.pixels()[i] = std::log(std::max(levels.pixels()[i], floor));
    }
    const bool none = std::all_of(in_body.pixels().begin(), in_body.pixels().end(), [](float in) { return in == 0; });
    if (none) in_body = Image(levels.width(), levels.height(), 1.0F);

    // The mean over the body alone: the open beam would shine into the skin.
    const double sigma_px = options.sigma_part * std::max(levels.width(), levels.height());
    Image wide = picture;
    for (std::size_t i = 0; i < wide.size(); ++i)
        wide.pixels()[i] *= in_body.pixels()[i];
    wide = gaussianBlurred(wide, sigma_px);
    const Image weight = gaussianBlurred(in_body, sigma_px);
    const auto compression = static_cast<float>(options.compression);
    const auto detail = static_cast<float>(options.detail);
    std::vector<float> body;
    for (std::size_t i = 0; i < picture.size(); ++i) {
        if (in_body.pixels()[i] == 0) continue;
        float& value = picture.pixels()[i];
        const float low = wide.pixels()[i] / std::max(weight.pixels()[i], 1e-6F);
        value = compression * low + detail * (value - low);
        body.push_back(value);
    }
    const float black = percentile(body, options.black_percentile);
    const float white = percentile(body, options.white_percentile);
    if (!(white > black)) return Image(levels.width(), levels.height(), 0.5F);
    for (std::size_t i = 0; i < picture.size(); ++i) {
        float& value = picture.pixels()[i];
        value = in_body.pixels()[i] == 0 ? 1.0F : std::clamp((value - black) / (white - black), 0.0F, 1.0F);
    }
    return picture;
}

}  // namespace fluorocut
