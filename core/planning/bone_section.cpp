#include "core/planning/bone_section.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace fluorocut {
namespace {

// Everything that can be reached from the seeds over pixels for which `open` holds.
template <class Open>
Mask reached(int size, std::vector<std::pair<int, int>> seeds, const Open& open) {
    Mask mask(size, size);
    std::vector<std::pair<int, int>> stack;
    const auto visit = [&](int x, int y) {
        if (x < 0 || y < 0 || x >= size || y >= size || mask(x, y) || !open(x, y)) return;
        mask(x, y) = 1;
        stack.emplace_back(x, y);
    };
    for (const auto& [x, y] : seeds)
        visit(x, y);
    while (!stack.empty()) {
        const auto [x, y] = stack.back();
        stack.pop_back();
        visit(x - 1, y);
        visit(x + 1, y);
        visit(x, y - 1);
        visit(x, y + 1);
    }
    return mask;
}

// With everything within so many pixels, along rows and columns.
Mask widened(const Mask& mask, int pixels) {
    Mask wide = mask, rows = mask;
    const int size = mask.width();
    for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x)
            for (int d = -pixels; d <= pixels; ++d)
                if (x + d >= 0 && x + d < size && mask(x + d, y)) rows(x, y) = 1;
    for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x)
            for (int d = -pixels; d <= pixels; ++d)
                if (y + d >= 0 && y + d < size && rows(x, y + d)) wide(x, y) = 1;
    return wide;
}

template <class Has>
std::optional<std::pair<int, int>> nearestPixel(const BoneSection& section, const Vector2& place, double near_mm,
                                                const Has& has) {
    std::optional<std::pair<int, int>> nearest;
    double least = near_mm;
    for (int y = 0; y < section.hounsfield.height(); ++y)
        for (int x = 0; x < section.hounsfield.width(); ++x)
            if (const double away = (section.place(x, y) - place).norm(); away <= least && has(x, y)) {
                least = away;
                nearest = {x, y};
            }
    return nearest;
}

}  // namespace

bool BoneSection::covers(const Vector2& p) const {
    const long x = std::lround((p.x() + reach_mm) / pixel_mm), y = std::lround((p.y() + reach_mm) / pixel_mm);
    return x >= 0 && y >= 0 && x < solid.width() && y < solid.height() &&
           solid(static_cast<int>(x), static_cast<int>(y)) != 0;
}

std::optional<BoneSection> boneSection(const Volume& ct, const SectionPlane& plane, double reach_mm, double pixel_mm,
                                       const Vector2& place, double near_mm, const SectionThresholds& thresholds) {
    const int half = static_cast<int>(std::ceil(reach_mm / pixel_mm)), size = 2 * half + 1;
    BoneSection section{pixel_mm, half * pixel_mm, Image(size, size), {}, Vector2::Zero()};
    Image& hu = section.hounsfield;
    for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x)
            hu(x, y) = sampleLinear(ct, ct.grid().indexFromPoint(plane.at(section.place(x, y))), kAirHounsfield);

    std::vector<std::pair<int, int>> border;
    for (int i = 0; i < size; ++i)
        for (const int end : {0, size - 1}) {
            border.emplace_back(i, end);
            border.emplace_back(end, i);
        }
    const Mask outside = reached(size, border, [&](int x, int y) { return hu(x, y) <= thresholds.shell_hu; });
    // The shell's outer edge is no denser than marrow where it fills its pixels in part.
    const int rim = std::max(1, static_cast<int>(std::lround(1.2 / pixel_mm)));
    const Mask edge = widened(outside, rim);
    const auto marrow = [&](int x, int y) { return !edge(x, y) && hu(x, y) < thresholds.marrow_hu; };
    const auto seed = nearestPixel(section, place, near_mm, marrow);
    if (!seed) return std::nullopt;
    section.solid = reached(size, {*seed}, [&](int x, int y) { return !outside(x, y); });
    const Mask inside = reached(size, {*seed}, marrow);

    int low_x = size, high_x = -1, low_y = size, high_y = -1, pixels = 0, marrow_pixels = 0;
    for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x) {
            if (inside(x, y)) {
                section.marrow_mm += section.place(x, y);
                ++marrow_pixels;
            }
            if (!section.solid(x, y)) continue;
            ++pixels;
            low_x = std::min(low_x, x);
            high_x = std::max(high_x, x);
            low_y = std::min(low_y, y);
            high_y = std::max(high_y, y);
        }
    section.marrow_mm /= marrow_pixels;
    section.area_mm2 = pixels * pixel_mm * pixel_mm;
    section.width_mm = pixel_mm * (1 + std::max(high_x - low_x, high_y - low_y));
    section.at_border = low_x == 0 || low_y == 0 || high_x == size - 1 || high_y == size - 1;
    return section;
}

}  // namespace fluorocut
