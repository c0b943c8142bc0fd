#include "app/cli/figures/plan_figure.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "app/cli/figures/canvas.h"
#include "core/imaging/silhouette.h"

namespace fluorocut::cli {
namespace {

constexpr double kPanel = 560;  // the longer side of a picture
constexpr double kGap = 20, kText = 13, kLine = 30;
constexpr std::array<Color, 5> kColors{kSkyBlue, kYellow, kOrange, kGreen, kVermilion};

constexpr float kOpenBeam = 0.6F;  // of the brightest level: what is brighter hardly met a body

// Black and white of both pictures of a view: of the logarithm of the one before, without its open beam.
struct Window {
    float low, high;
    explicit Window(const Image& levels) {
        const float brightest = *std::max_element(levels.pixels().begin(), levels.pixels().end());
        std::vector<float> logs;
        for (const float level : levels.pixels())
            if (level < kOpenBeam * brightest) logs.push_back(std::log(std::max(level, 1.0F)));
        if (logs.empty()) logs.push_back(std::log(std::max(brightest, 1.0F)));
        const auto percentile = [&](double share) {
            const auto nth = logs.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(logs.size() - 1));
            std::nth_element(logs.begin(), nth, logs.end());
            return *nth;
        };
        // Metal is darker than anything before: leave it room.
        high = percentile(0.97);
        low = percentile(0.005);
        low -= 0.15F * (high - low);
        high = std::max(high, low + 1e-3F);
    }
    Image shown(const Image& levels) const {
        Image picture = levels;
        for (float& value : picture.pixels())
            value = std::clamp((std::log(std::max(value, 1.0F)) - low) / (high - low), 0.0F, 1.0F);
        return picture;
    }
};

}  // namespace

Result<ColorImage> planFigure(const std::vector<PlanFigureView>& views, const std::vector<PlanFigureSolid>& solids) {
    std::vector<Silhouette> silhouettes;
    for (const PlanFigureSolid& solid : solids) {
        Result<Silhouette> silhouette = Silhouette::prepare(solid.mesh, solid.name);
        if (!silhouette) return silhouette.error();
        silhouettes.push_back(std::move(*silhouette));
    }
    const auto sizeOf = [](const PlanFigureView& view) {
        const double scale = kPanel / std::max(view.before.width(), view.before.height());
        return std::pair(scale, Vector2(scale * view.before.width(), scale * view.before.height()));
    };
    double width = 0, height = kGap + kLine;
    for (const PlanFigureView& view : views) {
        const Vector2 size = sizeOf(view).second;
        width = std::max(width, 2 * size.x() + 3 * kGap);
        height += kLine + size.y() + kGap;
    }
    Canvas canvas(static_cast<int>(width), static_cast<int>(height));

    double top = kGap;
    for (const PlanFigureView& view : views) {
        const auto [scale, size] = sizeOf(view);
        const Vector2 half(0.5 * (scale - 1), 0.5 * (scale - 1));
        const Vector2 left(kGap, top + kLine), right(2 * kGap + size.x(), top + kLine);
        canvas.text({left.x(), top + kText}, view.name, kText);
        canvas.text({right.x(), top + kText}, "predicted", kText);
        const Window window(view.before);
        canvas.picture(window.shown(view.before), left + half, scale);
        canvas.picture(window.shown(view.predicted), right + half, scale);
        for (std::size_t s = 0; s < solids.size(); ++s) {
            const auto loops = silhouettes[s].project(view.carm, view.imager_from_cavity,
                                                      {.find_outline = true, .find_hidden = false});
            if (!loops) return loops.error();
            for (const ContourLoop& loop : *loops) {
                for (const auto& part : contourParts(loop, [](const ContourPoint& p) { return p.outline; })) {
                    std::vector<Vector2> line;
                    for (const ContourPoint& p : part) {
                        const Vector2 at = scale * p.pixel;
                        const bool in = (at.array() >= 0).all() && (at.array() < size.array()).all();
                        line.push_back(in ? Vector2(right + half + at) : Vector2::Constant(NAN));
                    }
                    canvas.curve(line, kColors[s % kColors.size()], 2);
                }
            }
        }
        top += kLine + size.y() + kGap;
    }
    double x = kGap;
    for (std::size_t s = 0; s < solids.size(); ++s) {
        const double y = top + 0.5 * kText;
        canvas.curve(std::array<Vector2, 2>{Vector2(x, y), Vector2(x + 28, y)}, kColors[s % kColors.size()], 3);
        canvas.text({x + 36, top + kText}, solids[s].name, kText);
        x += 60 + 0.95 * kText * static_cast<double>(solids[s].name.size());
    }
    return canvas.image();
}

}  // namespace fluorocut::cli
