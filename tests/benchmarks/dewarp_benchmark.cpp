// Dewarping beside OpenCV's remap in one run: time to straighten an image with a prepared map, and the error of the
// resampling on a picture known in closed form; then the time to find the grooves and to fit each model. Prints
// Markdown tables.
//
//     dewarp_benchmark [rounds]
//
// Every round takes all programs in turn, so that a change of the machine's speed meets all of them; medians.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "core/base/median.h"
#include "core/base/parallel.h"
#include "core/distortion/dewarp.h"
#include "core/distortion/groove_detection.h"
#include "tests/benchmarks/timing.h"
#include "tests/core/distortion/plate_images.h"

using namespace fluorocut;
using benchmark::timedMs;

namespace {

struct Contender {
    std::string name;
    std::function<Image(const Image&)> straighten;
    std::vector<double> ms;
};

// Waves of 6 px: finer than the blur of a C-arm's detector lets pass, well below half the sampling rate.
double closedForm(const Vector2& pixel) {
    return 1000 + 300 * std::sin(2 * std::numbers::pi * (0.15 * pixel.x() + 0.06 * pixel.y())) +
           200 * std::cos(2 * std::numbers::pi * (0.04 * pixel.x() - 0.16 * pixel.y()));
}

Image closedFormImage(const DistortionMap& map) {
    Image image(map.columns(), map.rows());
    for (int v = 0; v < image.height(); ++v)
        for (int u = 0; u < image.width(); ++u)
            image(u, v) = static_cast<float>(closedForm(Vector2(u, v)));
    return image;
}

// Root mean square over the supported part, of the waves' own.
double relativeError(const Image& straight, const DistortionMap& map) {
    double sum = 0;
    int count = 0;
    for (int y = 0; y < straight.height(); y += 3) {
        for (int x = 0; x < straight.width(); x += 3) {
            const Vector2 pixel = map.distortedPixel(Vector2(x, y));
            if (!map.covers(pixel)) continue;
            const double error = static_cast<double>(straight(x, y)) - closedForm(pixel);
            sum += error * error;
            ++count;
        }
    }
    return std::sqrt(sum / count) / std::sqrt(0.5 * (300 * 300 + 200 * 200));
}

Image remapped(const Image& image, const cv::Mat& at_x, const cv::Mat& at_y, int interpolation) {
    const cv::Mat source(image.height(), image.width(), CV_32F, const_cast<float*>(image.pixels().data()));
    Image result(image.width(), image.height());
    cv::Mat target(result.height(), result.width(), CV_32F, result.pixels().data());
    cv::remap(source, target, at_x, at_y, interpolation);
    return result;
}

void benchmarkSize(int size_px, double pixel_mm, int rounds) {
    Random random(5);
    const test::BentField field = test::BentField::random(size_px, pixel_mm, random);
    const test::PlateImageOptions scene;
    const Image picture = test::renderPlate(field, scene, 7).image;

    std::vector<double> detect_ms;
    GrooveDetection grooves;
    for (int round = 0; round < rounds; ++round) {
        detect_ms.push_back(
            timedMs([&] { grooves = detectGrooves(picture, scene.plate, {}, Progress::none()).value(); }));
    }
    fmt::print("\n{} x {}: grooves found in {:.0f} ms ({} points)\n\n", size_px, size_px, median(detect_ms),
               grooves.points.along_x.size() + grooves.points.along_y.size());
    fmt::print("| model | fit, ms |\n|---|---|\n");
    for (const DistortionModelKind& kind : distortionModels()) {
        if (!kind.fit) continue;
        DistortionFitOptions options;
        options.model = kind.name;
        std::vector<double> ms;
        for (int round = 0; round < rounds; ++round)
            ms.push_back(timedMs([&] { (void)fitDistortion(grooves.points, options).value(); }));
        fmt::print("| {} | {:.1f} |\n", kind.name, median(ms));
    }

    const DistortionMap map = fitDistortion(grooves.points, {}).value();
    std::vector<double> prepare_ms;
    for (int round = 0; round < rounds; ++round)
        prepare_ms.push_back(timedMs([&] { const Dewarper dewarper(map); }));
    const Dewarper bspline(map, Resampling::bspline), two_pass(map, Resampling::twoPass),
        linear(map, Resampling::linear);
    cv::Mat at_x(size_px, size_px, CV_32F), at_y(size_px, size_px, CV_32F);
    for (int y = 0; y < size_px; ++y) {
        for (int x = 0; x < size_px; ++x) {
            const Vector2 at = map.distortedPixel(Vector2(x, y));
            at_x.at<float>(y, x) = static_cast<float>(at.x());
            at_y.at<float>(y, x) = static_cast<float>(at.y());
        }
    }
    std::vector<Contender> contenders{
        {"FluoroCut, cubic B-spline", [&](const Image& i) { return bspline.dewarped(i).value(); }, {}},
        {"FluoroCut, two-pass", [&](const Image& i) { return two_pass.dewarped(i).value(); }, {}},
        {"FluoroCut, linear", [&](const Image& i) { return linear.dewarped(i).value(); }, {}},
        {"OpenCV remap, linear", [&](const Image& i) { return remapped(i, at_x, at_y, cv::INTER_LINEAR); }, {}},
        {"OpenCV remap, cubic", [&](const Image& i) { return remapped(i, at_x, at_y, cv::INTER_CUBIC); }, {}},
        {"OpenCV remap, Lanczos4", [&](const Image& i) { return remapped(i, at_x, at_y, cv::INTER_LANCZOS4); }, {}}};
    const Image waves = closedFormImage(map);
    for (int round = 0; round < 5 * rounds; ++round)
        for (Contender& contender : contenders)
            contender.ms.push_back(timedMs([&] { (void)contender.straighten(waves); }));
    const double lanczos_ms = median(contenders.back().ms);
    fmt::print("\nprepared in {:.1f} ms\n\n", median(prepare_ms));
    fmt::print("| straighten {} x {} | ms | times Lanczos4's speed | error, of the waves' rms |\n|---|---|---|---|\n",
               size_px, size_px);
    for (const Contender& contender : contenders) {
        const double ms = median(contender.ms);
        fmt::print("| {} | {:.2f} | {:.2f} | {:.1e} |\n", contender.name, ms, lanczos_ms / ms,
                   relativeError(contender.straighten(waves), map));
    }
}

}  // namespace

int main(int argc, char** argv) {
    const int rounds = argc > 1 ? std::max(1, std::atoi(argv[1])) : 5;
    cv::setNumThreads(parallelThreads());
    benchmarkSize(512, 0.32, rounds);
    benchmarkSize(1024, 0.16, rounds);
}
