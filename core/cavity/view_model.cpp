#include "core/cavity/view_model.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include <Eigen/Cholesky>

#include "core/base/median.h"
#include "core/base/parallel.h"
#include "core/image/blur.h"

namespace fluorocut::cavity {
namespace {

constexpr float kCovered = 1e6F;       // noise of pixels that something else covers
constexpr double kLeastNoise = 0.002;  // of the logarithm: no model of an image is better
constexpr std::size_t kLevels = 8;     // of brightness, at which the residual's size is asked

// image + variance * half its Laplacian: a blur by that variance (px^2), to first order.
Image softened(const Image& image, float variance) {
    if (variance == 0) return image;
    Image result = halfLaplacian(image);
    for (std::size_t i = 0; i < result.size(); ++i)
        result.pixels()[i] = image.pixels()[i] + variance * result.pixels()[i];
    return result;
}

// Robust standard deviation of residuals at every pixel, as a function of the level that the model has there: quanta
// are fewer where it is dark, and scatter is known less.
Eigen::VectorXf noiseByLevel(const Eigen::VectorXf& residual, const Eigen::VectorXf& level) {
    const auto count = static_cast<std::size_t>(residual.size());
    std::vector<std::size_t> order(count);
    std::iota(order.begin(), order.end(), 0);
    const auto at = [&](std::size_t i) { return level[static_cast<Eigen::Index>(i)]; };
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return at(a) < at(b); });
    std::vector<double> middle, size;
    for (std::size_t bin = 0; bin < kLevels; ++bin) {
        const std::size_t begin = bin * count / kLevels, end = (bin + 1) * count / kLevels;
        if (end < begin + 20) continue;
        std::vector<float> sizes;
        for (std::size_t n = begin; n < end; ++n)
            sizes.push_back(std::abs(residual[static_cast<Eigen::Index>(order[n])]));
        middle.push_back(at(order[(begin + end) / 2]));
        size.push_back(std::max(kLeastNoise, 1.4826 * static_cast<double>(median(sizes))));
    }
    Eigen::VectorXf noise(residual.size());
    for (Eigen::Index i = 0; i < noise.size(); ++i) {
        const double x = level[i];
        const auto above = std::upper_bound(middle.begin(), middle.end(), x);
        const auto n = static_cast<std::size_t>(above - middle.begin());
        if (n == 0 || n == middle.size()) {
            noise[i] = static_cast<float>(n == 0 ? size.front() : size.back());
        } else {
            const double part = (x - middle[n - 1]) / (middle[n] - middle[n - 1]);
            noise[i] = static_cast<float>(size[n - 1] + part * (size[n] - size[n - 1]));
        }
    }
    return noise;
}

}  // namespace

ViewModel::ViewModel(const CavityView& view, const Region& where, int main_axis, double px2_per_mm2,
                     const Beforehand& beforehand)
    : given(&view), region(where), known(beforehand), main_axis_(main_axis), px2_per_mm2_(px2_per_mm2) {
    for (int j = 6; j < kOfView; ++j)
        values[j] = known[static_cast<std::size_t>(j)].value;
}

double ViewModel::blur() const {
    return std::sqrt(values[kSoft] + (binning_ * binning_ - 1) / 12.0) / binning_;
}

ProjectionOptions ViewModel::axis() const {
    ProjectionOptions options;
    options.main_axis = main_axis_;
    return options;
}

void ViewModel::prepare(int binning) {
    const CArm whole = given->carm.cropped(region.x, region.y, region.width, region.height);
    carm = binning > 1 ? whole.binned(binning) : whole;
    binning_ = binning;
    log_seen_ = logOf(given->after, region, binning);
    basis_ = slowBasis(carm.columns, carm.rows);
    clear_ = Eigen::VectorXf::Ones(basis_.rows());
    for (const CoveredDisc& disc : given->covered) {
        for (int y = 0; y < carm.rows; ++y) {
            for (int x = 0; x < carm.columns; ++x) {
                const Vector2 middle =
                    Vector2(region.x, region.y) + binning * Vector2(x + 0.5, y + 0.5) - Vector2::Constant(0.5);
                if ((middle - disc.center_px).norm() < disc.radius_px + 0.7 * (binning - 1))
                    clear_[static_cast<Eigen::Index>(y) * carm.columns + x] = 0;
            }
        }
    }
}

Image ViewModel::missing(const Image& bone, const Image& length) const {
    const auto h = static_cast<float>(values[kG] * values[kRatio]), fill = static_cast<float>(values[kFill]);
    Image sum(bone.width(), bone.height());
    for (std::size_t i = 0; i < sum.size(); ++i)
        sum.pixels()[i] = h * bone.pixels()[i] - fill * length.pixels()[i];
    return softened(sum, static_cast<float>(values[kEdge]) * px2());
}

void ViewModel::look(const VolumeProjector& bone, const Removed& here, bool fresh,
                     const std::array<std::optional<Removed>, 6>& there) {
    Beam beam;
    if (fresh) {
        ProjectionWithGradient projection = bone.projectWithGradient(carm, pose(), axis());
        bone_ = std::move(projection.image);
        bone_by_pose_ = std::move(projection.gradient);
        taken_at_ = delta;
        beam.removed = here.bone.projectWithGradient(carm, pose(), axis());
        beam.length = here.length.projectWithGradient(carm, pose(), axis());
    } else {
        beam.removed.image = here.bone.project(carm, pose(), axis());
        beam.length.image = here.length.project(carm, pose(), axis());
    }
    beam.gone = missing(beam.removed.image, beam.length.image);
    beam.bone = bone_;
    const Vector6 since = delta - taken_at_;
    const std::size_t count = beam.bone.size();
    for (int j = 0; j < 6; ++j) {
        const auto by = static_cast<float>(since[j]);
        if (by == 0) continue;
        const Image& change = bone_by_pose_[static_cast<std::size_t>(j)];
        for (std::size_t i = 0; i < count; ++i)
            beam.bone.pixels()[i] += by * change.pixels()[i];
    }
    beam.bone = softened(beam.bone, -static_cast<float>(values[kSharp]) * px2());
    const auto g = static_cast<float>(values[kG]);
    // About its mean, so that g changes contrast and not brightness.
    if (usual_bone_ == 0) {
        usual_bone_ =
            std::accumulate(beam.bone.pixels().begin(), beam.bone.pixels().end(), 0.0) / static_cast<double>(count);
    }
    const auto usual = static_cast<float>(usual_bone_);
    beam.primary = Image(carm.columns, carm.rows);
    for (std::size_t i = 0; i < count; ++i)
        beam.primary.pixels()[i] = std::exp(beam.gone.pixels()[i] - g * (beam.bone.pixels()[i] - usual));
    beam.blurred = gaussianBlurred(beam.primary, blur());
    if (level_ == 0) {
        double sum = 0;
        for (const float pixel : beam.blurred.pixels())
            sum += std::log(std::max(pixel, 1e-30f));
        level_ = std::exp(sum / static_cast<double>(count));
        // The picture's gain is anything; the rest starts from a picture as bright as this one.
        const double seen = std::accumulate(log_seen_.pixels().begin(), log_seen_.pixels().end(), 0.0);
        values[kPoly] = (seen - sum) / static_cast<double>(count) - std::log1p(values[kPedestal]);
    }
    const Eigen::VectorXf added = basis_ * (level_ * values.segment<kSlow>(kPedestal)).cast<float>();
    const Eigen::VectorXf slow = basis_ * values.tail<kSlow>().cast<float>();
    beam.seen = beam.blurred;
    residual.resize(static_cast<Eigen::Index>(count));
    log_model_.resize(static_cast<Eigen::Index>(count));
    for (std::size_t i = 0; i < count; ++i) {
        float& seen = beam.seen.pixels()[i];
        const auto at = static_cast<Eigen::Index>(i);
        seen = std::max({0.1f * seen, seen + added[at], 1e-30f});
        log_model_[at] = std::log(seen) + slow[at];
        residual[at] = log_seen_.pixels()[i] - log_model_[at];
    }
    if (fresh) differentiate(beam, there);
}

void ViewModel::differentiate(const Beam& beam, const std::array<std::optional<Removed>, 6>& there) {
    const std::size_t count = beam.seen.size();
    const auto pixels = static_cast<Eigen::Index>(count);
    jacobian.resize(pixels, kColumns);
    // exp(-line integral), blurred, over what is seen.
    const auto column = [&](Eigen::Index index, auto&& derivative) {
        Image change(carm.columns, carm.rows);
        for (std::size_t i = 0; i < count; ++i)
            change.pixels()[i] = beam.primary.pixels()[i] * derivative(i);
        change = gaussianBlurred(change, blur());
        for (std::size_t i = 0; i < count; ++i)
            jacobian(static_cast<Eigen::Index>(i), index) = change.pixels()[i] / beam.seen.pixels()[i];
    };
    const auto g = static_cast<float>(values[kG]), ratio = static_cast<float>(values[kRatio]),
               usual = static_cast<float>(usual_bone_), sharp = static_cast<float>(values[kSharp]);
    parallelFor(17, 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t c = begin; c < end; ++c) {
            const auto index = static_cast<Eigen::Index>(c);
            if (c < 6) {
                const float by = 1 / static_cast<float>(c < 3 ? kStepMm : kStepRad);
                const Image moved = missing(there[c]->bone.project(carm, pose(), axis()),
                                            there[c]->length.project(carm, pose(), axis()));
                column(index, [&](std::size_t i) { return by * (moved.pixels()[i] - beam.gone.pixels()[i]); });
            } else if (c < 12) {
                const std::size_t j = c - 6;
                const Image by_view = missing(beam.removed.gradient[j], beam.length.gradient[j]);
                const Image of_bone = softened(bone_by_pose_[j], -sharp * px2());
                column(index, [&](std::size_t i) { return by_view.pixels()[i] - g * of_bone.pixels()[i]; });
            } else if (c == 12) {
                column(6 + kG, [&](std::size_t i) {
                    return usual - beam.bone.pixels()[i] + ratio * beam.removed.image.pixels()[i];
                });
            } else if (c == 13) {
                column(6 + kRatio, [&](std::size_t i) { return g * beam.removed.image.pixels()[i]; });
            } else if (c == 14) {
                column(6 + kFill, [&](std::size_t i) { return -beam.length.image.pixels()[i]; });
            } else if (c == 15) {
                const Image edge = halfLaplacian(beam.gone);
                column(6 + kEdge, [&](std::size_t i) { return px2() * edge.pixels()[i]; });
            } else {
                const Image edge = halfLaplacian(beam.bone);
                column(6 + kSharp, [&](std::size_t i) { return g * px2() * edge.pixels()[i]; });
            }
        }
    });
    const Image soft = halfLaplacian(beam.blurred);
    const auto area = static_cast<float>(binning_ * binning_);
    Eigen::VectorXf relative(pixels);
    for (std::size_t i = 0; i < count; ++i) {
        const auto at = static_cast<Eigen::Index>(i);
        jacobian(at, 6 + kSoft) = soft.pixels()[i] / (area * beam.seen.pixels()[i]);
        relative[at] = static_cast<float>(level_) / beam.seen.pixels()[i];
    }
    jacobian.middleCols<kSlow>(6 + kPedestal) = relative.asDiagonal() * basis_;
    jacobian.rightCols<kSlow>() = basis_;
}

void ViewModel::weigh(bool robust, bool settle) {
    Eigen::VectorXf rest = residual;
    if (settle) {
        // The first looks know no polynomial yet: what it will take is taken out before the residual's size is asked.
        const Eigen::MatrixXf normal = basis_.transpose() * basis_;
        rest -= basis_ * normal.ldlt().solve(basis_.transpose() * rest);
    }
    std::vector<float> size(static_cast<std::size_t>(rest.size()));
    for (Eigen::Index i = 0; i < rest.size(); ++i)
        size[static_cast<std::size_t>(i)] = std::abs(rest[i]);
    usual_noise = std::max(kLeastNoise, 1.4826 * static_cast<double>(median(size)));
    noise = robust ? noiseByLevel(rest, log_model_)
                   : Eigen::VectorXf::Constant(rest.size(), static_cast<float>(usual_noise));
    noise.array() += kCovered * (1 - clear_.array());
    weight = noise.array().square().inverse();
    if (robust) weight.array() /= 1 + (rest.array() / (3 * noise.array())).square();
}

double ViewModel::evidence() const {
    const Eigen::VectorXf contrast = jacobian.col(6 + kRatio);
    Eigen::MatrixXf slow(jacobian.rows(), kSlow + 2);
    slow.leftCols<kSlow>() = basis_;
    slow.col(kSlow) = jacobian.col(6 + kG);
    slow.col(kSlow + 1) = jacobian.col(6 + kFill);
    const Eigen::MatrixXf weighted = weight.asDiagonal() * slow;
    const Eigen::MatrixXf normal = slow.transpose() * weighted;
    const Eigen::VectorXf own = contrast - slow * normal.ldlt().solve(weighted.transpose() * contrast);
    const Eigen::VectorXf pull = weight.array() * own.array();
    return values[kRatio] + pull.dot(residual) / std::max(pull.dot(own), 1e-20f);
}

void ViewModel::move(const Vector6& from_delta, const Eigen::Matrix<double, kOfView, 1>& from,
                     const Eigen::Matrix<double, kOfView, 1>& step, double part) {
    delta = from_delta + part * step.head<6>();
    values = from;
    values.tail<kOfView - 6>() += part * step.tail<kOfView - 6>();
    values[kG] = std::clamp(values[kG], 0.2, 5.0);
    values[kRatio] = std::clamp(values[kRatio], 0.5, 2.0);
    const Known& fill = known[kFill];
    values[kFill] = std::clamp(values[kFill], std::min(fill.value, 0.0) - 0.002, 2 * fill.value + 0.05);
    values[kPedestal] = std::clamp(values[kPedestal], 0.0, 2.0);
    values[kSoft] = std::clamp(values[kSoft], 0.05, 9.0);
    for (const int j : {kEdge, kSharp}) {
        const double most = 3 * known[static_cast<std::size_t>(j)].sigma;
        values[j] = std::clamp(values[j], -most, most);
    }
}

}  // namespace fluorocut::cavity
