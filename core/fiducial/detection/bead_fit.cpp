#include "core/fiducial/detection/bead_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Dense>

#include "core/base/median.h"

namespace fluorocut::detection {
namespace {

constexpr int kParameters = 9;  // x y R ln(k) ln(blur) A c0 cx cy
enum Index { kX, kY, kRadius, kSteepness, kBlur, kDepth, kLevel, kSlopeX, kSlopeY };
using Parameters = Eigen::Matrix<double, kParameters, 1>;
using Normal = Eigen::Matrix<double, kParameters, kParameters>;

constexpr int kRounds = 3;      // of robust weights
constexpr int kSteps = 8;       // within one
constexpr double kOutlier = 4;  // residuals of so many standard deviations have a quarter of their say
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// Central differences, one-sided at the border.
Vector2 gradientAt(const Image& image, int x, int y) {
    const int left = std::max(0, x - 1), right = std::min(image.width() - 1, x + 1);
    const int top = std::max(0, y - 1), bottom = std::min(image.height() - 1, y + 1);
    return {static_cast<double>(image(right, y) - image(left, y)) / (right - left),
            static_cast<double>(image(x, bottom) - image(x, top)) / (bottom - top)};
}

struct Pixel {
    int x, y;  // in the patch
    double u, v;
    double value;
    double level;
    Vector2 steepness;    // of the level: the gradient of its logarithm
    double weight = 1;    // robust
    double expected = 0;  // of the last evaluation
    double variance = 1;
    Parameters row;
};

class Fit {
  public:
    Fit(const Image& image, const BackgroundPatch& patch, const Vector2& center, const BeadShape& start,
        double start_depth, const ShapePrior& prior, const NoiseModel& noise, bool blurred_product)
        : prior_(prior), noise_(noise), center_(center), start_(start) {
        parameters_ << 0, 0, start.radius_px, start.log_steepness, start.log_blur, start_depth, 1, 0, 0;
        const double blur = std::exp(start.log_blur);
        const double window = 1.5 * start.radius_px + 2.5 * blur + 1.5;
        for (int y = 0; y < patch.log_level.height(); ++y) {
            for (int x = 0; x < patch.log_level.width(); ++x) {
                const Vector2 away = Vector2(patch.left + x, patch.top + y) - center;
                if (patch.usable(x, y) == 0 || !(away.norm() <= window)) continue;
                pixels_.push_back(
                    {x, y, away.x(), away.y(), image(patch.left + x, patch.top + y), std::exp(patch.log_level(x, y)),
                     blurred_product ? gradientAt(patch.log_level, x, y) : Vector2(0, 0), 1, 0, 1, Parameters::Zero()});
            }
        }
    }

    bool run() {
        if (pixels_.size() < 2 * kParameters) return false;
        for (int round = 0; round < kRounds; ++round) {
            // Weights and variances are those of the last round's model while one round settles.
            evaluate(parameters_);
            takeVariances();
            if (round > 0) reweight();
            evaluate(parameters_);
            double cost = weightedCost();
            double damping = 1e-3;
            for (int step = 0; step < kSteps; ++step) {
                Normal damped = normalMatrix();
                damped.diagonal() *= 1 + damping;
                const Parameters change = damped.ldlt().solve(-gradientVector());
                if (!change.allFinite()) return false;
                const Parameters before = parameters_;
                parameters_ = limited(parameters_ + change);
                const std::vector<Pixel> kept = pixels_;
                evaluate(parameters_);
                const double now = weightedCost();
                if (now <= cost) {
                    const bool settled = cost - now < 1e-2 && (parameters_ - before).head<3>().norm() < 1e-3;
                    cost = now;
                    damping = std::max(1e-6, damping * 0.2);
                    if (settled) break;
                } else {
                    parameters_ = before;
                    pixels_ = kept;
                    damping *= 10;
                    if (damping > 1e6) break;
                }
            }
            if (!(parameters_.head<2>().norm() < 0.7 * start_.radius_px + 1)) return false;
        }
        takeVariances();
        reweight();
        evaluate(parameters_);
        return true;
    }

    BeadFit result(const BackgroundPatch& patch) const {
        BeadFit fit;
        fit.ok = true;
        fit.center_px = center_ + parameters_.head<2>();
        fit.shape = {parameters_[kRadius], parameters_[kSteepness], parameters_[kBlur]};
        fit.depth = parameters_[kDepth];
        // The curvature of the robust cost is less than its weights say.
        double curvature = 0, weights = 0;
        for (const Pixel& pixel : pixels_) {
            const double q = std::pow(normalized(pixel) / (kOutlier * faults_), 2);
            curvature += std::max(0.0, 1 - 3 * q) / ((1 + q) * (1 + q) * (1 + q));
            weights += pixel.weight;
        }
        const Normal inverse = normalMatrix().inverse() * (faults_ * weights / std::max(curvature, 0.3 * weights));
        if (!inverse.allFinite()) {
            fit.ok = false;
            return fit;
        }
        const int width = patch.log_level.width(), height = patch.log_level.height();
        fit.residuals = Image(width, height, static_cast<float>(kNaN));
        fit.expected = Image(width, height, static_cast<float>(kNaN));
        // How each pixel's noise, in its own standard deviations, moves the centre and the depth.
        using Influence = Eigen::Matrix<double, 3, 1>;
        std::vector<Influence> influence(static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                                         Influence::Zero());
        const auto at = [width](int x, int y) {
            return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
        };
        for (const Pixel& pixel : pixels_) {
            fit.residuals(pixel.x, pixel.y) = static_cast<float>(pixel.value - pixel.expected);
            fit.expected(pixel.x, pixel.y) = static_cast<float>(pixel.expected);
            const Parameters all = pixel.weight * (inverse * pixel.row);
            influence[at(pixel.x, pixel.y)] = Influence(all[kX], all[kY], all[kDepth]);
        }
        Matrix3 covariance = Matrix3::Zero();
        constexpr int kReach = NoiseModel::kReach;
        for (const Pixel& pixel : pixels_) {
            const Influence& here = influence[at(pixel.x, pixel.y)];
            for (int dy = -kReach; dy <= kReach; ++dy) {
                for (int dx = -kReach; dx <= kReach; ++dx) {
                    const int x = pixel.x + dx, y = pixel.y + dy;
                    if (x < 0 || x >= width || y < 0 || y >= height) continue;
                    covariance +=
                        noise_
                            .correlation[static_cast<std::size_t>(dy + kReach)][static_cast<std::size_t>(dx + kReach)] *
                        here * influence[at(x, y)].transpose();
                }
            }
        }
        covariance = (0.5 * (covariance + covariance.transpose())).eval();
        // A measured correlation need not be one of a possible noise: never below a quarter of the uncorrelated.
        Matrix3 white = Matrix3::Zero();
        for (const Influence& one : influence)
            white += one * one.transpose();
        const Eigen::Matrix2d least = 0.25 * white.topLeftCorner<2, 2>();
        fit.covariance_px2 = covariance.topLeftCorner<2, 2>();
        if ((fit.covariance_px2 - least).llt().info() != Eigen::Success) fit.covariance_px2 = 4 * least;
        fit.depth_sigma = std::sqrt(std::max(covariance(2, 2), 0.25 * white(2, 2)));
        fit.score = score();
        return fit;
    }

  private:
    static Parameters limited(Parameters p) {
        p[kRadius] = std::clamp(p[kRadius], 0.5, 200.0);
        p[kSteepness] = std::clamp(p[kSteepness], -3.0, 3.7);
        p[kBlur] = std::clamp(p[kBlur], -1.4, 2.5);
        p[kDepth] = std::clamp(p[kDepth], -50.0, 1.2);
        return p;
    }

    // Fills in expected intensities and normalised derivatives.
    void evaluate(const Parameters& p) {
        const BeadProfile profile({p[kRadius], p[kSteepness], p[kBlur]});
        const double scale = 1 / start_.radius_px;
        const double variance = std::exp(2 * p[kBlur]);
        for (Pixel& pixel : pixels_) {
            const double du = pixel.u - p[kX], dv = pixel.v - p[kY];
            const double distance = std::sqrt(du * du + dv * dv);
            const ProfilePoint g = profile.at(distance);
            const double slope = p[kLevel] + (p[kSlopeX] * pixel.u + p[kSlopeY] * pixel.v) * scale;
            // The detector blurs the product of background and bead. That is the product of the two, each blurred, and
            // variance * gradient * gradient: it counts where a groove's edge passes below the bead's rim.
            const double shared = distance > 1e-9 ? variance * g.by_distance *
                                                        (pixel.steepness.x() * du + pixel.steepness.y() * dv) / distance
                                                  : 0;
            const double seen = g.value + shared;
            const double shade = 1 - p[kDepth] * seen;
            pixel.expected = pixel.level * slope * shade;
            const double inverse = 1 / std::sqrt(pixel.variance);
            const double by_value = -pixel.level * slope * p[kDepth] * inverse;
            const double radial = distance > 1e-9 ? by_value * g.by_distance / distance : 0;
            pixel.row << -radial * du, -radial * dv, by_value * g.by_radius, by_value * g.by_log_steepness,
                by_value * g.by_log_blur, -pixel.level * slope * seen * inverse, pixel.level * shade * inverse,
                pixel.level * shade * pixel.u * scale * inverse, pixel.level * shade * pixel.v * scale * inverse;
        }
    }

    void takeVariances() {
        for (Pixel& pixel : pixels_)
            pixel.variance = std::max(noise_.variance(std::max(pixel.expected, 0.0)), 1e-30);
    }

    double normalized(const Pixel& pixel) const { return (pixel.value - pixel.expected) / std::sqrt(pixel.variance); }

    double weightedCost() const {
        double cost = 0;
        for (const Pixel& pixel : pixels_) {
            const double r = normalized(pixel);
            cost += pixel.weight * r * r;
        }
        const double k = (parameters_[kSteepness] - prior_.log_steepness) / prior_.log_steepness_sigma;
        const double b = (parameters_[kBlur] - prior_.log_blur) / prior_.log_blur_sigma;
        return cost + k * k + b * b;
    }

    // Where the noise is less than the model's own faults (a disk drawn without smooth edges), those are the measure.
    // They lie at the rim, which is too small a part of the window to show in its median.
    void measureFaults() {
        std::vector<double> all, rim;
        for (const Pixel& pixel : pixels_) {
            const double off = std::hypot(pixel.u - parameters_[kX], pixel.v - parameters_[kY]) - parameters_[kRadius];
            const double size = std::abs(normalized(pixel));
            all.push_back(size);
            if (std::abs(off) < 0.7 + std::exp(parameters_[kBlur])) rim.push_back(size);
        }
        faults_ = std::max(1.0, 1.4826 * median(all));
        if (rim.size() >= 8) faults_ = std::max(faults_, 1.4826 * median(rim));
    }

    void reweight() {
        measureFaults();
        for (Pixel& pixel : pixels_) {
            const double ratio = normalized(pixel) / (kOutlier * faults_);
            pixel.weight = 1 / ((1 + ratio * ratio) * (1 + ratio * ratio));
        }
    }

    Normal normalMatrix() const {
        Normal normal = Normal::Zero();
        for (const Pixel& pixel : pixels_)
            normal.selfadjointView<Eigen::Lower>().rankUpdate(pixel.row, pixel.weight);
        normal = normal.selfadjointView<Eigen::Lower>();
        normal(kSteepness, kSteepness) += 1 / (prior_.log_steepness_sigma * prior_.log_steepness_sigma);
        normal(kBlur, kBlur) += 1 / (prior_.log_blur_sigma * prior_.log_blur_sigma);
        return normal;
    }

    Parameters gradientVector() const {
        Parameters gradient = Parameters::Zero();
        for (const Pixel& pixel : pixels_)
            gradient -= pixel.weight * normalized(pixel) * pixel.row;
        gradient[kSteepness] += (parameters_[kSteepness] - prior_.log_steepness) /
                                (prior_.log_steepness_sigma * prior_.log_steepness_sigma);
        gradient[kBlur] += (parameters_[kBlur] - prior_.log_blur) / (prior_.log_blur_sigma * prior_.log_blur_sigma);
        return gradient;
    }

    double score() const {
        const BeadProfile profile({parameters_[kRadius], parameters_[kSteepness], parameters_[kBlur]});
        double explained = 0, left = 0;
        std::array<double, 8> sector_sum{}, sector_norm{};
        for (const Pixel& pixel : pixels_) {
            const double du = pixel.u - parameters_[kX], dv = pixel.v - parameters_[kY];
            const double distance = std::hypot(du, dv);
            const double slope = parameters_[kLevel] +
                                 (parameters_[kSlopeX] * pixel.u + parameters_[kSlopeY] * pixel.v) / start_.radius_px;
            const double seen = parameters_[kDepth] * profile.at(distance).value;
            const double residual = (pixel.value - pixel.expected) / (pixel.level * slope);
            explained += seen * seen;
            left += residual * residual - pixel.variance / (pixel.level * slope * pixel.level * slope);
            // The rim, where round tells itself from straight; eight sectors.
            const auto sector =
                static_cast<std::size_t>(std::floor((std::atan2(dv, du) / std::numbers::pi + 1) * 4)) % 8;
            sector_sum[sector] += (seen - residual) * seen;
            sector_norm[sector] += seen * seen;
        }
        double evenness = 1;
        int seen_sectors = 0;
        const double typical = explained / 8;
        for (std::size_t i = 0; i < 8; ++i) {
            if (sector_norm[i] < 0.3 * typical) continue;  // hidden by a neighbour
            ++seen_sectors;
            evenness = std::min(evenness, sector_sum[i] / sector_norm[i]);
        }
        if (seen_sectors < 5 || !(explained > 0)) return 0;
        return explained / (explained + std::max(0.0, left)) * std::clamp(evenness / 0.6, 0.0, 1.0);
    }

    const ShapePrior& prior_;
    const NoiseModel& noise_;
    Vector2 center_;
    BeadShape start_;
    Parameters parameters_;
    double faults_ = 1;  // in standard deviations of the noise
    std::vector<Pixel> pixels_;
};

}  // namespace

NoiseModel NoiseModel::white(double constant, double per_intensity) {
    NoiseModel model;
    model.constant = constant;
    model.per_intensity = per_intensity;
    model.correlation[kReach][kReach] = 1;
    return model;
}

BeadFit fitBead(const Image& image, const BackgroundPatch& patch, const Vector2& center_px, const BeadShape& start,
                double start_depth, const ShapePrior& prior, const NoiseModel& noise, bool blurred_product) {
    Fit fit(image, patch, center_px, start, start_depth, prior, noise, blurred_product);
    if (!fit.run()) return {};
    return fit.result(patch);
}

NoiseModel measureNoise(const std::vector<const BeadFit*>& fits, const NoiseModel& otherwise) {
    struct Sample {
        double expected, residual;
    };
    std::vector<Sample> samples;
    for (const BeadFit* fit : fits) {
        for (std::size_t i = 0; i < fit->residuals.size(); ++i) {
            if (std::isfinite(fit->residuals.pixels()[i]))
                samples.push_back({fit->expected.pixels()[i], fit->residuals.pixels()[i]});
        }
    }
    constexpr std::size_t kBins = 8;
    if (samples.size() < 40 * kBins) return otherwise;
    std::sort(samples.begin(), samples.end(), [](const Sample& a, const Sample& b) {
        return a.expected < b.expected || (a.expected == b.expected && a.residual < b.residual);
    });
    // Robust variance in bins of like intensity, then a line through them, each weighted by its relative precision.
    std::array<double, kBins> level{}, variance{};
    for (std::size_t bin = 0; bin < kBins; ++bin) {
        const std::size_t begin = bin * samples.size() / kBins, end = (bin + 1) * samples.size() / kBins;
        std::vector<double> sizes;
        double sum = 0;
        for (std::size_t i = begin; i < end; ++i) {
            sizes.push_back(std::abs(samples[i].residual));
            sum += samples[i].expected;
        }
        level[bin] = sum / static_cast<double>(end - begin);
        const double sigma = 1.4826 * median(sizes);
        variance[bin] = sigma * sigma;
    }
    const double typical = variance[kBins / 2];
    if (!(typical > 0)) return otherwise;
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Vector2 right = Vector2::Zero();
    double mean = 0;
    for (std::size_t bin = 0; bin < kBins; ++bin) {
        const double weight = 1 / std::pow(variance[bin] + 0.05 * typical, 2);
        const Vector2 row(1, level[bin]);
        normal += weight * row * row.transpose();
        right += weight * variance[bin] * row;
        mean += variance[bin] / kBins;
    }
    Vector2 line = normal.ldlt().solve(right);
    if (!(line[0] >= 0 && line.allFinite())) line = Vector2(0, right[1] / normal(1, 1));
    if (!(line[1] >= 0 && line.allFinite())) line = Vector2(mean, 0);
    NoiseModel model = NoiseModel::white(std::max(line[0], 0.02 * typical), line[1]);

    // Correlation of what is left, in units of its own standard deviation, without what is far off.
    NoiseModel counted;
    constexpr int kReach = NoiseModel::kReach;
    for (const BeadFit* fit : fits) {
        const int width = fit->residuals.width(), height = fit->residuals.height();
        Image normalized(width, height);
        for (std::size_t i = 0; i < normalized.size(); ++i) {
            const double value =
                fit->residuals.pixels()[i] / std::sqrt(model.variance(std::max(0.0F, fit->expected.pixels()[i])));
            normalized.pixels()[i] = static_cast<float>(std::abs(value) < 4 ? value : kNaN);
        }
        for (int y = 0; y < height; ++y) {
            for (int x = 0; x < width; ++x) {
                const double here = normalized(x, y);
                if (!std::isfinite(here)) continue;
                for (int dy = -kReach; dy <= kReach; ++dy) {
                    for (int dx = -kReach; dx <= kReach; ++dx) {
                        if (x + dx < 0 || x + dx >= width || y + dy < 0 || y + dy >= height) continue;
                        const double there = normalized(x + dx, y + dy);
                        if (!std::isfinite(there)) continue;
                        const auto j = static_cast<std::size_t>(dy + kReach), i = static_cast<std::size_t>(dx + kReach);
                        model.correlation[j][i] += here * there;
                        counted.correlation[j][i] += 1;
                    }
                }
            }
        }
    }
    const double own = (model.correlation[kReach][kReach] - 1) / std::max(1.0, counted.correlation[kReach][kReach]);
    for (std::size_t j = 0; j < 2 * kReach + 1; ++j) {
        for (std::size_t i = 0; i < 2 * kReach + 1; ++i)
            model.correlation[j][i] /= std::max(1.0, counted.correlation[j][i]) * own;
    }
    model.correlation[kReach][kReach] = 1;
    // What the trimmed variance says, for the whole.
    model.constant *= own;
    model.per_intensity *= own;
    return model;
}

}  // namespace fluorocut::detection
