#include "core/cavity/cavity_outline.h"

#include <algorithm>
#include <cmath>

#include "core/base/median.h"
#include "core/cavity/plane_images.h"
#include "core/image/blur.h"

namespace fluorocut::cavity {
namespace {

constexpr double kStepPx = 3;

Vector2 middleOf(const Contour& contour) {
    // Of the area.
    const double area = signedArea(contour);
    Vector2 sum = Vector2::Zero();
    for (std::size_t i = 0; i < contour.size(); ++i) {
        const Vector2& a = contour[i];
        const Vector2& b = contour[(i + 1) % contour.size()];
        sum += (a.x() * b.y() - b.x() * a.y()) * (a + b);
    }
    return sum / (6 * area);
}

}  // namespace

std::optional<Contour> predictedOutline(const Silhouette& silhouette, const CArm& carm,
                                        const Rigid3& imager_from_cavity) {
    SilhouetteOptions options;
    options.find_outline = true;
    const auto loops = silhouette.project(carm.ideal(), imager_from_cavity, options);
    if (!loops) return std::nullopt;
    std::vector<std::vector<ContourPoint>> parts;
    for (const ContourLoop& loop : *loops) {
        auto own = contourParts(loop, [](const ContourPoint& p) { return p.outline; });
        parts.insert(parts.end(), own.begin(), own.end());
    }
    if (parts.empty()) return std::nullopt;
    // Parts of the border begin and end where contours cross: each is followed by the one that begins at its end.
    const auto longest =
        std::max_element(parts.begin(), parts.end(), [](const auto& a, const auto& b) { return a.size() < b.size(); });
    std::swap(*longest, parts.front());
    Contour outline;
    const auto append = [&](const std::vector<ContourPoint>& part) {
        for (std::size_t i = 0; i + 1 < part.size(); ++i)
            outline.push_back(part[i].pixel);
        return part.back().pixel;
    };
    const Vector2 start = parts.front().front().pixel;
    Vector2 end = append(parts.front());
    std::vector<bool> used(parts.size());
    used[0] = true;
    while ((end - start).norm() > 0.01) {
        std::size_t next = parts.size();
        double nearest = (end - start).norm();
        for (std::size_t i = 0; i < parts.size(); ++i) {
            if (used[i]) continue;
            const double distance = (parts[i].front().pixel - end).norm();
            if (distance < nearest) {
                nearest = distance;
                next = i;
            }
        }
        if (next == parts.size()) break;
        used[next] = true;
        end = append(parts[next]);
    }
    if (outline.size() < 3 || !(length(outline) > 4 * kStepPx)) return std::nullopt;
    return resampled(outline, kStepPx);
}

std::optional<Contour> detectedOutline(const Image& difference, const Region& region, const Contour& expected,
                                       const OutlineOptions& options) {
    Contour here;
    for (const Vector2& p : expected)
        here.emplace_back(p - Vector2(region.x, region.y));
    const int width = difference.width(), height = difference.height();
    Image smooth = difference;
    for (float& pixel : smooth.pixels())
        if (!std::isfinite(pixel)) pixel = 0;
    smooth = gaussianBlurred(smooth, options.blur_px);
    // Contrast enhanced: what lies inside the expected outline against what lies outside, in the latter's spread.
    const Mask inside = filledMask(width, height, {here}, 0),
               near = filledMask(width, height, {here}, std::sqrt(std::abs(signedArea(here))) / 3);
    std::vector<float> in, out;
    for (std::size_t i = 0; i < smooth.size(); ++i) {
        if (inside.pixels()[i]) in.push_back(smooth.pixels()[i]);
        if (!near.pixels()[i]) out.push_back(smooth.pixels()[i]);
    }
    if (in.size() < 50 || out.size() < 50) return std::nullopt;
    const float ground = median(out), top = median(in);
    for (float& value : out)
        value = std::abs(value - ground);
    const double unrest = std::max(1e-6, 1.4826 * static_cast<double>(median(out)));
    if (top - ground < options.least_contrast * unrest) return std::nullopt;
    for (float& pixel : smooth.pixels())
        pixel = std::clamp((pixel - ground) / (top - ground), -0.5f, 1.5f);

    std::vector<Contour> contours = isoContours(smooth, static_cast<float>(options.level));
    const auto largest = std::min_element(contours.begin(), contours.end(), [](const Contour& a, const Contour& b) {
        return signedArea(a) < signedArea(b);
    });
    if (largest == contours.end()) return std::nullopt;
    const double area = std::abs(signedArea(here));
    const auto fits = [&](const Contour& contour) {
        const double own = -signedArea(contour);
        return own >= options.least_area * area && own <= options.most_area * area &&
               (middleOf(contour) - middleOf(here)).norm() <= options.most_shift * std::sqrt(area);
    };
    if (!fits(*largest)) return std::nullopt;
    Image steep(width, height);
    for (int y = 1; y + 1 < height; ++y)
        for (int x = 1; x + 1 < width; ++x)
            steep(x, y) = std::hypot(smooth(x + 1, y) - smooth(x - 1, y), smooth(x, y + 1) - smooth(x, y - 1));
    Contour drawn = snake(resampled(*largest, kStepPx), gaussianBlurred(steep, options.blur_px));
    if (!fits(drawn)) return std::nullopt;
    for (Vector2& p : drawn)
        p += Vector2(region.x, region.y);
    return resampled(drawn, kStepPx);
}

}  // namespace fluorocut::cavity
