#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "core/base/median.h"
#include "core/base/parallel.h"
#include "core/fiducial/corkscrew_refinement/detector_blur.h"
#include "core/fiducial/corkscrew_refinement/fit_support.h"
#include "core/fiducial/corkscrew_refinement/high_pass.h"
#include "core/fiducial/corkscrew_refinement/image_evidence.h"
#include "core/fiducial/corkscrew_refinement/image_noise.h"
#include "core/fiducial/corkscrew_refinement/predicted_image.h"
#include "core/fiducial/corkscrew_refinement/row_kernels.h"

namespace fluorocut {

using namespace corkscrew;

namespace {

constexpr const char* kStep = "corkscrew, fit of the image";
constexpr double kMarginPx = 20;
constexpr double kLeastVisible = 0.3;
constexpr int kMostIterations = 12;
constexpr std::size_t kLeastPixels = 300;
constexpr double kPlaysAPart = 0.01;  // of a pixel: that much of the logarithm comes of metal
constexpr double kNearReachPx = 6, kNearRad = 0.045;
constexpr double kSmallStep = 0.2;        // standard deviations; the next one would be a tenth of it
constexpr double kLongestStride = 1.7;    // against a step with fixed weights
constexpr double kDerivativeTail = 2e-3;  // of the blur, which derivatives do without
constexpr double kMostFall = 0.4;         // what a step leaves of the pedestal: log(I + pedestal) is steep near zero
constexpr std::size_t kScaleStep = 3;     // every so many residuals tell their scale
constexpr int kLastRounds = 3;
constexpr double kLastCoarseStep = 3;  // the same; from then on with fine images
constexpr int kMostCoarse = 6;
constexpr double kFarPx = 0.4;    // moved so far, derivatives are taken anew,
constexpr double kAsidePx = 0.1;  // or so far for the last steps: where they are taken, the fit ends

Followers expectedFollowers() {
    Followers at;
    at << 1, 1, 1, 1, 0.55, 0.15;
    return at;
}
Followers followersSigma() {
    Followers sigma;
    sigma << 0.3, 0.3, 0.3, 0.3, 0.3, 0.15;
    return sigma;
}
Followers withinLimits(Followers at) {
    for (int k = 0; k < kParts; ++k)
        at[k] = std::clamp(at[k], 0.2, 4.0);
    at[blur_variance] = std::clamp(at[blur_variance], 0.05, 9.0);
    at[pedestal] = std::clamp(at[pedestal], 0.0, 0.6);
    return at;
}

struct State {
    Rigid3 pose;
    Followers followers = expectedFollowers();
};

class ImageFit {
  public:
    ImageFit(const Image& image, const CArm& carm, const CorkscrewLayout& layout, const PixelRegion& region)
        : carm_(carm),
          layout_(layout),
          region_(region),
          predictor_(carm, layout, region),
          log_seen_(logarithm(image, region)) {
        noise_ = noiseOf(image);
        seen_ = highPassed(log_seen_);
        // The noise at a pixel goes by the brightness about it: its own would prefer dark accidents.
        Image level(region.width, region.height);
        float brightest = 0;
        for (int y = 0; y < region.height; ++y) {
            const float* in = image.row(region.y + y) + region.x;
            std::copy(in, in + region.width, level.row(y));
            brightest = std::max(brightest, *std::max_element(in, in + region.width));
        }
        const float dark = 2e-3f * brightest;
        usable_.resize(level.size());
        for (std::size_t i = 0; i < level.size(); ++i)
            usable_[i] = level.pixels()[i] > dark;
        level = detectorBlurred(level, 1);
        inverse_sigma_ = Image(region.width, region.height);
        for (std::size_t i = 0; i < level.size(); ++i) {
            const double value = std::max(level.pixels()[i], dark);
            inverse_sigma_.pixels()[i] = static_cast<float>(1 / std::sqrt(noise_.variance(value)));
        }
    }

    const PixelRegion& region() const { return region_; }
    const LogImage logImage() const {
        return {region_, detectorBlurred(log_seen_, kLastSmoothingPx * kLastSmoothingPx)};
    }

    // log(predicted) from the blurred transmission.
    Image logPredicted(const Image& blurred, const Followers& at) const {
        Image out = blurred;
        const auto stray = static_cast<float>(at[pedestal]);
        for (float& value : out.pixels())
            value = (value + stray) / (1 + stray);
        forRows([&](int y) { rowKernels().logarithm(out.row(y), out.width(), 1e-6f); });
        return out;
    }

    std::array<double, kParts> gains(const Followers& at) const { return {at[0], at[1], at[2], at[3]}; }

    // High-passed log(seen) - log(predicted after this step), in the noise's standard deviations, at the Jacobian's
    // pixels.
    std::vector<double> residuals(const Jacobian& jacobian, const Image& predicted,
                                  const Row& step = Row::Zero()) const {
        std::vector<double> e(jacobian.pixels.size());
        const Eigen::Matrix<float, kUnknowns, 1> change = step.cast<float>();
        for (std::size_t i = 0; i < e.size(); ++i) {
            const std::uint32_t p = jacobian.pixels[i];
            const float moved =
                Eigen::Map<const Eigen::Matrix<float, kUnknowns, 1>>(jacobian.rows.data() + i * kUnknowns).dot(change);
            e[i] = static_cast<double>(seen_.pixels()[p] - predicted.pixels()[p] - moved) * inverse_sigma_.pixels()[p];
        }
        return e;
    }

    // What a fit takes from step to step: memory, more than anything.
    struct Linearised {
        Jacobian jacobian;
        Image predicted;      // high-passed log
        Image log_predicted;  // not high-passed
        Image inverse;        // 1 / (blurred + pedestal)
        Image blurred;
        PredictedImage image;  // raw
        std::vector<Image> columns;
    };

    void predict(const State& state, Sampling sampling, Linearised& out) const {
        predictor_.predict(state.pose, gains(state.followers), Derivatives::none, sampling, out.image);
        expose(state, DetectorBlur(state.followers[blur_variance]), out);
    }

    // Coarse derivatives are good for steps. Not for evidence: focal length and depth do almost the same, their small
    // difference would drown.
    void linearise(const State& state, Derivatives derivatives, Sampling sampling, Linearised& out) const {
        predictor_.predict(state.pose, gains(state.followers), derivatives, sampling, out.image);
        expose(state, DetectorBlur(state.followers[blur_variance]), out);
        const DetectorBlur kernel(state.followers[blur_variance], kDerivativeTail);
        out.inverse = out.blurred;
        for (float& value : out.inverse.pixels())
            value = 1 / (value + static_cast<float>(state.followers[pedestal]));

        out.columns.resize(kUnknowns);
        parallelFor(kUnknowns, 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t k = begin; k < end; ++k) {
                if (k < 6 + kParts) {
                    toLogarithm(k < 6 ? out.image.pose[k] : out.image.gains[k - 6], out.image.drawn, kernel,
                                out.inverse, out.columns[k]);
                } else if (k == 6 + blur_variance) {
                    out.columns[k] = timesInverse(halfLaplacian(out.blurred), out.inverse);
                } else {
                    out.columns[k] = out.inverse;
                    const auto open = static_cast<float>(1 / (1 + state.followers[pedestal]));
                    for (float& value : out.columns[k].pixels())
                        value -= open;
                }
            }
        });
        Jacobian& jacobian = out.jacobian;
        jacobian.pixels.clear();
        const std::vector<float>& of_wire = out.columns[6 + wire].pixels();
        const std::vector<float>& of_shaft = out.columns[6 + shaft].pixels();
        const std::vector<float>& of_beads = out.columns[6 + beads].pixels();
        for (std::size_t p = 0; p < usable_.size(); ++p) {
            const float part = std::abs(of_wire[p]) + std::abs(of_shaft[p]) + std::abs(of_beads[p]);
            if (part > kPlaysAPart && usable_[p]) jacobian.pixels.push_back(static_cast<std::uint32_t>(p));
        }
        jacobian.pose = state.pose;
        jacobian.followers = state.followers;
        jacobian.rows.resize(jacobian.pixels.size() * kUnknowns);
        parallelFor(kUnknowns, 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t k = begin; k < end; ++k)
                highPassedAt(out.columns[k], jacobian.pixels, kUnknowns, jacobian.rows.data() + k);
        });
    }

    // d log(predicted) / d what images share, high-passed, at the pixels that play a part: pixels x parameters.
    std::vector<float> shared(const Linearised& at, const State& state) const {
        const std::vector<std::uint32_t>& pixels = at.jacobian.pixels;
        const std::size_t parameters = 3 + static_cast<std::size_t>(predictor_.solid().dimensions);
        std::vector<float> rows(pixels.size() * parameters, 0.0f);
        const DetectorBlur kernel(state.followers[blur_variance], kDerivativeTail);
        const auto put = [&](const Image& plane, const PixelRegion& box, std::size_t parameter) {
            if (box.empty()) return;
            Image inverse(box.width, box.height), values;
            for (int y = 0; y < box.height; ++y)
                std::copy_n(at.inverse.row(box.y + y) + box.x, box.width, inverse.row(y));
            toLogarithm(plane, {}, kernel, inverse, values);
            // The pixels that lie in the box, and where they are among all.
            std::vector<std::uint32_t> inside;
            std::vector<std::size_t> where;
            for (std::size_t i = 0; i < pixels.size(); ++i) {
                const int x = static_cast<int>(pixels[i]) % region_.width - box.x;
                const int y = static_cast<int>(pixels[i]) / region_.width - box.y;
                if (!(x >= 0 && y >= 0 && x < box.width && y < box.height)) continue;
                inside.push_back(static_cast<std::uint32_t>(y * box.width + x));
                where.push_back(i);
            }
            std::vector<float> high(inside.size());
            highPassedAt(values, inside, 1, high.data());
            for (std::size_t i = 0; i < inside.size(); ++i)
                rows[where[i] * parameters + parameter] = high[i];
        };
        std::vector<std::pair<std::size_t, std::size_t>> tasks;  // group, plane; groups counted from 1, the imager is 0
        for (std::size_t k = 0; k < 3; ++k)
            tasks.push_back({0, k});
        for (std::size_t g = 0; g < at.image.groups.size(); ++g)
            for (std::size_t k = 0; k < at.image.groups[g].planes.size(); ++k)
                tasks.push_back({g + 1, k});
        parallelFor(tasks.size(), 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t t = begin; t < end; ++t) {
                const auto [group, plane] = tasks[t];
                if (group == 0) {
                    put(at.image.imager[plane], {0, 0, region_.width, region_.height}, plane);
                } else {
                    const GroupDerivatives& of = at.image.groups[group - 1];
                    const int first = 3 + predictor_.solid().groups[group - 1].first_parameter;
                    put(of.planes[plane], of.box, static_cast<std::size_t>(first) + plane);
                }
            }
        });
        return rows;
    }

    // A derivative of the transmission, blurred, as one of the logarithm.
    // `drawn`: as PredictedImage's; empty: anywhere.
    static void toLogarithm(const Image& derivative, const std::vector<std::array<int, 2>>& drawn,
                            const DetectorBlur& kernel, const Image& inverse, Image& out) {
        const int width = derivative.width(), height = derivative.height(), reach = kernel.radius();
        if (out.width() != width || out.height() != height) out = Image(width, height);
        for (int y = 0; y < height; ++y) {
            float* const row = out.row(y);
            int begin = drawn.empty() ? 0 : width, end = drawn.empty() ? width : 0;
            for (int s = std::max(0, y - reach) / kStripRows;
                 s < static_cast<int>(drawn.size()) && s * kStripRows <= y + reach; ++s) {
                const auto [first, last] = drawn[static_cast<std::size_t>(s)];
                if (first >= last) continue;
                begin = std::min(begin, std::max(0, first - reach));
                end = std::max(end, std::min(width, last + reach));
            }
            if (begin >= end) begin = end = 0;
            std::fill(row, row + begin, 0.0f);
            std::fill(row + end, row + width, 0.0f);
            kernel.row(derivative, y, begin, end, row + begin);
            const float* factor = inverse.row(y);
            for (int x = begin; x < end; ++x)
                row[x] *= factor[x];
        }
    }
    static Image timesInverse(Image values, const Image& inverse) {
        for (std::size_t i = 0; i < values.size(); ++i)
            values.pixels()[i] *= inverse.pixels()[i];
        return values;
    }

    const CorkscrewPredictor& predictor() const { return predictor_; }
    const ImageNoise& noise() const { return noise_; }
    const Image& inverseSigma() const { return inverse_sigma_; }
    const Image& seen() const { return seen_; }
    bool usable(std::size_t p) const { return usable_[p] != 0; }

  private:
    void expose(const State& state, const DetectorBlur& kernel, Linearised& out) const {
        corkscrew::blur(out.image.transmission, kernel, out.blurred);
        out.log_predicted = logPredicted(out.blurred, state.followers);
        out.predicted = highPassed(out.log_predicted);
    }

    template <class Body>
    void forRows(const Body& body) const {
        parallelFor(static_cast<std::size_t>(region_.height), 32, [&](std::size_t begin, std::size_t end) {
            for (std::size_t y = begin; y < end; ++y)
                body(static_cast<int>(y));
        });
    }

    // d / d variance of a Gaussian blur.
    static Image halfLaplacian(const Image& image) {
        Image out(image.width(), image.height());
        for (int y = 0; y < image.height(); ++y) {
            const float *here = image.row(y), *above = image.row(std::max(0, y - 1));
            const float* below = image.row(std::min(image.height() - 1, y + 1));
            for (int x = 0; x < image.width(); ++x) {
                const float left = here[std::max(0, x - 1)], right = here[std::min(image.width() - 1, x + 1)];
                out(x, y) = 0.5f * (left + right + above[x] + below[x] - 4 * here[x]);
            }
        }
        return out;
    }

    const CArm& carm_;
    const CorkscrewLayout& layout_;
    PixelRegion region_;
    CorkscrewPredictor predictor_;
    Image log_seen_, seen_, inverse_sigma_;
    std::vector<std::uint8_t> usable_;
    ImageNoise noise_;
};

Weighted weighted(std::vector<double> residuals) {
    Weighted out;
    std::vector<float> sizes;
    sizes.reserve(residuals.size() / kScaleStep + 1);
    for (std::size_t i = 0; i < residuals.size(); i += kScaleStep)
        sizes.push_back(static_cast<float>(std::abs(residuals[i])));
    out.scale = std::max(1.0, 1.4826 * median(std::move(sizes)));
    out.residuals = std::move(residuals);
    out.weights.reserve(out.residuals.size());
    double weights = 0, slopes = 0;
    for (const double e : out.residuals) {
        const double weight = tukeyWeight(e, out.scale), inside = std::sqrt(weight);
        out.weights.push_back(weight);
        weights += weight;
        if (weight > 0) slopes += inside * (5 * inside - 4);  // (1 - r^2) (1 - 5 r^2)
    }
    out.stride = std::clamp(weights / std::max(slopes, 1e-9), 1.0, kLongestStride);
    return out;
}

// Normal equations over the pixels, added up piece by piece in order.
void normalEquations(const Jacobian& jacobian, const Weighted& at, const Image& inverse_sigma, Square& normal,
                     Row& right) {
    constexpr std::size_t kPiece = 2048;
    const std::size_t count = jacobian.pixels.size(), pieces = (count + kPiece - 1) / kPiece;
    std::vector<Square> normals(pieces, Square::Zero());
    std::vector<Row> rights(pieces, Row::Zero());
    parallelFor(pieces, 1, [&](std::size_t begin, std::size_t end) {
        using Rows = Eigen::Matrix<float, Eigen::Dynamic, kUnknowns, Eigen::RowMajor>;
        for (std::size_t piece = begin; piece < end; ++piece) {
            const std::size_t first = piece * kPiece, last = std::min(count, first + kPiece);
            Rows rows(static_cast<Eigen::Index>(last - first), kUnknowns);
            Eigen::VectorXf e(static_cast<Eigen::Index>(last - first));
            for (std::size_t i = first; i < last; ++i) {
                const auto r = static_cast<Eigen::Index>(i - first);
                const float root = static_cast<float>(std::sqrt(at.weights[i]));
                const float factor = root * inverse_sigma.pixels()[jacobian.pixels[i]];
                rows.row(r) =
                    factor * Eigen::Map<const Eigen::Matrix<float, 1, kUnknowns>>(jacobian.rows.data() + i * kUnknowns);
                e[r] = root * static_cast<float>(at.residuals[i]);
            }
            normals[piece] = (rows.transpose() * rows).cast<double>();
            rights[piece] = (rows.transpose() * e).cast<double>();
        }
    });
    normal.setZero();
    right.setZero();
    for (std::size_t piece = 0; piece < pieces; ++piece) {
        normal += normals[piece];
        right += rights[piece];
    }
}

// What is known of the followers beforehand, per pixel that is alike.
void addPrior(const Followers& at, double alike_px, Square& normal, Row& right) {
    const Followers expected = expectedFollowers(), sigma = followersSigma();
    for (int k = 0; k < kFollowers; ++k) {
        const double weight = alike_px / (sigma[k] * sigma[k]);
        normal(6 + k, 6 + k) += weight;
        right[6 + k] += weight * (expected[k] - at[k]);
    }
}

// d / d column and d / d row of the logarithm, high-passed.
std::array<Image, 2> gradientOf(const Image& log_predicted) {
    std::array<Image, 2> gradient{Image(log_predicted.width(), log_predicted.height()),
                                  Image(log_predicted.width(), log_predicted.height())};
    for (int y = 1; y + 1 < log_predicted.height(); ++y) {
        const float *above = log_predicted.row(y - 1), *here = log_predicted.row(y), *below = log_predicted.row(y + 1);
        for (int x = 1; x + 1 < log_predicted.width(); ++x) {
            gradient[0](x, y) = 0.5f * (here[x + 1] - here[x - 1]);
            gradient[1](x, y) = 0.5f * (below[x] - above[x]);
        }
    }
    return {highPassed(gradient[0]), highPassed(gradient[1])};
}

// Stray light and gains change how much everything pulls.
bool derivativesHold(const Followers& then, const Followers& now, double times) {
    const auto alike = [&](int k, double of) { return std::abs(now[k] - then[k]) < times * of; };
    return alike(pedestal, 0.3 * (then[pedestal] + 0.08)) && alike(wire, 0.2) && alike(shaft, 0.2);
}

double movedPx(const Rigid3& from, const Rigid3& to, const CArm& carm, const CorkscrewLayout& layout) {
    const Vector6 step = to.deltaFrom(from);
    const double magnification = carm.focal_length_mm / to.translation().z() / carm.pixel_mm.mean();
    const double reach = 0.5 * (layout.rod_x_mm[1] - layout.rod_x_mm[0]);
    return magnification * (step.head<2>().norm() + std::abs(step[2]) * reach / to.translation().z() +
                            layout.rod_radius_mm * step.tail<3>().norm());
}

// A start that is off by more than the steps of a fit like: the shape brings it nearer at a tenth of their cost. Not
// far away: that would be another explanation, which nobody asked for.
Rigid3 nearerStart(const Image& image, const CArm& carm, const CorkscrewLayout& layout, const Rigid3& start,
                   const PixelRegion& region, Progress& progress) {
    const LogImage seen{region, detectorBlurred(logarithm(image, region), kLastSmoothingPx * kLastSmoothingPx)};
    const SeenLines lines = findLines(seen, carm, layout, wirePoints(layout), shaftPoints(layout), start, kNearReachPx);
    CorkscrewFit at_start;
    rate(at_start, lines);
    std::vector<double> offsets;
    for (const SeenPoint& point : lines.wire)
        offsets.push_back(std::abs(point.offset_px));
    if (!offsets.empty() && median(std::move(offsets)) < kFarPx) return start;
    const Result<CorkscrewFit> shape = refineOnShape(image, carm, layout, start, progress);
    if (!shape || !(shape->score > at_start.score)) return start;
    const Vector6 step = shape->imager_from_corkscrew.deltaFrom(start);
    const bool near = step.tail<3>().norm() < kNearRad && std::abs(step[2]) < 0.02 * start.translation().z();
    return near ? shape->imager_from_corkscrew : start;
}

}  // namespace

Result<CorkscrewFit> refineOnImage(const Image& image, const CArm& carm, const CorkscrewLayout& layout,
                                   const Rigid3& start, const CorkscrewFitOptions& options, Progress& progress) {
    if (const Result<void> good = checkInputs(kStep, image, carm, layout, start); !good) return good.error();
    if (const Result<void> good = options.validate(); !good) return good.error();
    if (progress.isCancelled()) return cancelled(kStep);
    const auto tooLittle = [&](const std::string& found) {
        return noSolution(kStep, found, "more of the corkscrew inside the image",
                          "move the corkscrew into the field of view");
    };
    PixelRegion region = regionAround(carm, layout, start, kMarginPx);
    if (region.width < 32 || region.height < 32) return tooLittle("a corkscrew outside the image");
    const Rigid3 nearer = nearerStart(image, carm, layout, start, region, progress);
    region = regionAround(carm, layout, nearer, kMarginPx);
    if (region.width < 32 || region.height < 32) return tooLittle("a corkscrew outside the image");

    const ImageFit work(image, carm, layout, region);
    State state{nearer};
    CorkscrewFit fit;
    ImageFit::Linearised at;
    Weighted now;
    Square normal;
    Row right;
    // Coarsely until the steps are small, then finely.
    Sampling sampling = Sampling::coarse;
    Row last_step = Row::Zero();
    const auto move = [&](const Row& step) {
        state.pose = state.pose.perturbed(step.head<6>());
        const double least = kMostFall * state.followers[pedestal];
        state.followers = withinLimits(state.followers + step.tail<kFollowers>());
        state.followers[pedestal] = std::max(state.followers[pedestal], least);
    };
    for (fit.iterations = 0; fit.iterations < kMostIterations; ++fit.iterations) {
        if (progress.isCancelled()) return cancelled(kStep);
        if (sampling == Sampling::coarse && fit.iterations >= kMostCoarse) sampling = Sampling::fine;
        const bool fine = sampling == Sampling::fine;
        const bool anew = fit.iterations == 0 ||
                          movedPx(at.jacobian.pose, state.pose, carm, layout) > (fine ? kAsidePx : kFarPx) ||
                          !derivativesHold(at.jacobian.followers, state.followers, fine ? 1 : 2);
        if (anew) work.linearise(state, Derivatives::pose, Sampling::coarse, at);
        if (!anew || sampling == Sampling::fine) work.predict(state, sampling, at);
        if (at.jacobian.pixels.size() < kLeastPixels)
            return tooLittle(fmt::format("{} pixels with metal of it", at.jacobian.pixels.size()));
        now = weighted(work.residuals(at.jacobian, at.predicted));
        normalEquations(at.jacobian, now, work.inverseSigma(), normal, right);
        addPrior(state.followers, work.noise().alike_px, normal, right);
        Square damped = normal;
        damped.diagonal() *= 1 + 1e-6;
        Row step = damped.ldlt().solve(right);
        if (!step.allFinite()) break;
        if (fit.iterations >= 2) step *= now.stride;  // the first ones are about more than weights
        const double size =
            std::max({step.segment<3>(3).norm() / 0.1, step.head<2>().norm() / 2, std::abs(step[2]) / 20});
        if (size > 1) step /= size;
        const double variances = step.head<6>().dot(normal.topLeftCorner<6, 6>() * step.head<6>());
        const double sigmas = std::sqrt(variances / work.noise().alike_px);
        move(step);
        last_step = step;
        if (!(state.pose.translation().z() > layout.rod_radius_mm)) return tooLittle("a fit that ran into the source");
        // A step that is small beside what noise does to the pose.
        if (sampling == Sampling::fine && sigmas < kSmallStep) {
            fit.converged = true;
            ++fit.iterations;
            break;
        }
        if (sigmas < kLastCoarseStep) sampling = Sampling::fine;
    }

    const auto equations = [&](const Row& step) {
        normalEquations(at.jacobian, now, work.inverseSigma(), normal, right);
        addPrior(state.followers + step.tail<kFollowers>(), work.noise().alike_px, normal, right);
    };
    if (options.evidence) {
        // Fine derivatives, which are good for one more step: a small one, found in a few rounds without another image.
        work.linearise(state, Derivatives::all, Sampling::fine, at);
        last_step.setZero();
        Row step = Row::Zero();
        for (int round = 0; round < kLastRounds; ++round) {
            now = weighted(work.residuals(at.jacobian, at.predicted, step));
            equations(step);
            step += normal.ldlt().solve(right);
        }
        const double variances = step.head<6>().dot(normal.topLeftCorner<6, 6>() * step.head<6>());
        if (variances < kLastCoarseStep * kLastCoarseStep * work.noise().alike_px) {
            move(step);
            last_step = step;
        }
    }
    // The image was drawn before the last step, whose share is next to nothing: the derivatives tell it.
    now = weighted(work.residuals(at.jacobian, at.predicted, last_step));
    if (options.evidence) equations(Row::Zero());
    fit.imager_from_corkscrew = state.pose;
    fit.residual = now.scale;

    double likelihood = 0;
    for (std::size_t p = 0; p < at.predicted.size(); ++p) {
        if (std::abs(at.predicted.pixels()[p]) < 0.004f || !work.usable(p)) continue;
        const double sigma = work.inverseSigma().pixels()[p], seen = work.seen().pixels()[p];
        likelihood += tukeyLoss(seen * sigma, 1.5) - tukeyLoss((seen - at.predicted.pixels()[p]) * sigma, 1.5);
    }
    fit.log_likelihood = likelihood / work.noise().alike_px;

    const SeenLines lines =
        findLines(work.logImage(), carm, layout, wirePoints(layout), shaftPoints(layout), state.pose, kLastReachPx);
    rate(fit, lines);
    if (!(lines.visible >= kLeastVisible))
        return tooLittle(fmt::format("{:.0f} % of the wires inside the image", 100 * lines.visible));
    if (options.evidence) {
        Linearisation here{region,
                           carm.pixel_mm,
                           at.jacobian,
                           work.shared(at, state),
                           now,
                           work.inverseSigma(),
                           normal,
                           right,
                           gradientOf(at.log_predicted)};
        fit.evidence = evidenceOf(here, state.pose);
        fit.distortion_gain = distortionGain(here, options.distortion_length_mm);
    }
    return fit;
}

}  // namespace fluorocut
