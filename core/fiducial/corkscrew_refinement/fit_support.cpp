#include "core/fiducial/corkscrew_refinement/fit_support.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

#include "core/base/option_checks.h"
#include "core/base/parallel.h"
#include "core/fiducial/corkscrew_refinement/row_kernels.h"

namespace fluorocut {

CorkscrewFit::CorkscrewFit()
    : residual(std::numeric_limits<double>::quiet_NaN()),
      log_likelihood(std::numeric_limits<double>::quiet_NaN()),
      rms_px(std::numeric_limits<double>::quiet_NaN()) {}

Result<void> CorkscrewFitOptions::validate() const {
    return requireRange("distortion_length_mm", distortion_length_mm, 0.1, 1e4, "mm");
}

namespace corkscrew {
namespace {

constexpr double kTukey = 4.685;    // 95 % efficient where residuals are normal
constexpr int kLeastLookedAt = 25;  // points of 1 mm that a score can be told from

}  // namespace

Result<void> checkInputs(const char* step, const Image& image, const CArm& carm, const CorkscrewLayout& layout,
                         const Rigid3& start) {
    if (const Result<void> good = carm.validate(); !good) return good.error();
    if (const Result<void> good = layout.validate(); !good) return good.error();
    if (image.width() != carm.columns || image.height() != carm.rows)
        throw std::logic_error(fmt::format("{}: the image does not have the C-arm's size", step));
    if (!(start.translation().z() > layout.rod_radius_mm)) {
        return noSolution(step, fmt::format("a start {:.0f} mm from the source", start.translation().z()),
                          "a corkscrew between source and detector");
    }
    return {};
}

Image logarithm(const Image& image, const PixelRegion& region) {
    Image out(region.width, region.height);
    float brightest = 0;
    for (int y = 0; y < region.height; ++y) {
        const float* in = image.row(region.y + y) + region.x;
        brightest = std::max(brightest, *std::max_element(in, in + region.width));
    }
    const float floor = std::max(1e-3f * brightest, 1e-30f);
    parallelFor(static_cast<std::size_t>(region.height), 32, [&](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            const float* in = image.row(region.y + y) + region.x;
            std::copy(in, in + region.width, out.row(y));
            rowKernels().logarithm(out.row(y), region.width, floor);
        }
    });
    return out;
}

double tukeyWeight(double e, double scale) {
    const double r = e / (kTukey * scale), rest = 1 - r * r;
    return rest > 0 ? rest * rest : 0;
}

double tukeyLoss(double e, double scale) {
    const double r = e / (kTukey * scale), rest = std::max(0.0, 1 - r * r);
    return kTukey * kTukey / 6 * (1 - rest * rest * rest);
}

void rate(CorkscrewFit& fit, const SeenLines& lines) {
    fit.visible = lines.visible;
    fit.rms_px = lines.rms_px;
    fit.score = static_cast<double>(lines.on_place) / std::max(lines.looked_at, kLeastLookedAt);
}

}  // namespace corkscrew
}  // namespace fluorocut
