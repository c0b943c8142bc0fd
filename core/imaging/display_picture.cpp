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
    std::vector<float> body;
    for (float& value : picture.pixels()) {
        const bool in_body = value < open;
        value = std::log(std::max(value, floor));
        if (in_body) body.push_back(value);
    }
    if (body.empty()) body = picture.pixels();
    // What is brighter than the body is cut off first, or the open beam would shine into the skin.
    const float brightest = percentile(body, options.white_percentile);
    for (float& value : picture.pixels())
        value = std::min(value, brightest);

    const Image wide = gaussianBlurred(picture, options.sigma_part * std::max(levels.width(), levels.height()));
    const auto compression = static_cast<float>(options.compression);
    const auto detail = static_cast<float>(options.detail);
    body.clear();
    for (std::size_t i = 0; i < picture.size(); ++i) {
        float& value = picture.pixels()[i];
        const float low = wide.pixels()[i];
        value = compression * low + detail * (value - low);
        if (levels.pixels()[i] < open) body.push_back(value);
    }
    if (body.empty()) body = picture.pixels();
    const float black = percentile(body, options.black_percentile);
    // Never above what the open beam has become, so that it is white.
    const float white = std::min(percentile(body, options.white_percentile), compression * brightest);
    if (!(white > black)) return Image(levels.width(), levels.height(), 0.5F);
    for (float& value : picture.pixels())
        value = std::clamp((value - black) / (white - black), 0.0F, 1.0F);
    return picture;
}

}  // namespace fluorocut
