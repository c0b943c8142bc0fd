#include "core/fiducial/corkscrew/other_focal.h"

#include <array>
#include <cmath>
#include <limits>

#include "core/base/parallel.h"
#include "core/fiducial/corkscrew_refinement.h"

namespace fluorocut::corkscrew {
namespace {

constexpr double kFewerLines = 0.03;      // of the score
constexpr double kFirstStep = 0.18;       // of the factor's logarithm: 20 %
constexpr double kLastStep = 0.01;        // 1 %
constexpr double kNotWorthNaming = 0.05;  // where no factor farther away is better
constexpr double kMostLogarithm = 1.1;    // a factor of 3

}  // namespace

CArm withFocalFactor(const CArm& carm, double factor) {
    CArm other = carm;
    if (other.distortion)  // whose map has its own idea of the pixels
        other.focal_length_mm *= factor;
    else
        other.pixel_mm /= factor;
    return other;
}

ScaledFit scaledFit(const Image& image, const CArm& carm, const CorkscrewLayout& layout, const ScaledFit& from,
                    double factor) {
    const Rigid3& pose = from.imager_from_corkscrew;
    const Rigid3 start(pose.rotation(), pose.translation().cwiseProduct(Vector3(1, 1, factor / from.factor)));
    const Result<CorkscrewFit> fit = refineOnShape(image, withFocalFactor(carm, factor), layout, start);
    if (!(fit && fit->score > from.score - kFewerLines))
        return {factor, start, std::numeric_limits<double>::infinity(), 0};
    return {factor, fit->imager_from_corkscrew, fit->rms_px, fit->score};
}

ScaledFit bestScaledFit(const Image& image, const CArm& carm, const CorkscrewLayout& layout, ScaledFit from) {
    const double first = from.factor;
    for (double step = kFirstStep; step > (from.factor == first ? kNotWorthNaming : kLastStep);) {
        std::array<ScaledFit, 2> beside;
        parallelFor(beside.size(), 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i)
                beside[i] = scaledFit(image, carm, layout, from, from.factor * std::exp(i == 0 ? step : -step));
        });
        const ScaledFit& better = beside[0].rms_px < beside[1].rms_px ? beside[0] : beside[1];
        const bool farther = better.rms_px < from.rms_px && std::abs(std::log(better.factor)) < kMostLogarithm;
        if (farther)
            from = better;
        else
            step /= 2.5;
    }
    return from;
}

}  // namespace fluorocut::corkscrew
