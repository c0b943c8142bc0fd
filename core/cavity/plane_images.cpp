#include "core/cavity/plane_images.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "core/base/median.h"
#include "core/base/parallel.h"
#include "core/image/blur.h"

namespace fluorocut::cavity {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr std::array<double, 3> kAlignBlurPx{5, 2.5, 1.2};
constexpr double kHighPassPx = 14;  // what is slower than this is scatter, gain and soft tissue
constexpr double kEdgeShare = 0.2;  // of the region's pixels: the strongest edges
constexpr int kMostSteps = 30;
constexpr double kFarPx = 12;  // from where the poses say it lies
// Where the poses say it lies is taken for right to these: along a straight bone nothing else tells.
constexpr double kShiftSigmaPx = 2, kTurnSigma = 0.005, kAlikePlaces = 30;  // so many neighbours are as good as one

float at(const Image& image, int x, int y) {
    return image(std::clamp(x, 0, image.width() - 1), std::clamp(y, 0, image.height() - 1));
}

// Only where it is seen.
bool reaches(const Image& image, const Vector2& p) {
    return p.x() >= 0 && p.y() >= 0 && p.x() <= image.width() - 1 && p.y() <= image.height() - 1;
}

Image cropped(const Image& image, const Region& r) {
    Image result(r.width, r.height);
    for (int y = 0; y < r.height; ++y)
        for (int x = 0; x < r.width; ++x)
            result(x, y) = at(image, x + r.x, y + r.y);
    return result;
}

Image bandPassed(const Image& image, double blur_px) {
    Image fine = gaussianBlurred(image, blur_px);
    const Image slow = gaussianBlurred(image, kHighPassPx);
    for (std::size_t i = 0; i < fine.size(); ++i)
        fine.pixels()[i] -= slow.pixels()[i];
    return fine;
}

Vector2 slopeAt(const Image& image, const Vector2& p) {
    const auto sample = [&](double dx, double dy) { return linearAt(image, p + Vector2(dx, dy)); };
    return {(sample(1, 0) - sample(-1, 0)) / 2, (sample(0, 1) - sample(0, -1)) / 2};
}

}  // namespace

double PlaneSimilarity::scale() const {
    return std::hypot(a, b);
}

double PlaneSimilarity::angle() const {
    return std::atan2(b, a);
}

float linearAt(const Image& image, const Vector2& pixel) {
    const double x = std::clamp(pixel.x(), 0.0, image.width() - 1.0);
    const double y = std::clamp(pixel.y(), 0.0, image.height() - 1.0);
    const int x0 = std::min(static_cast<int>(x), std::max(0, image.width() - 2));
    const int y0 = std::min(static_cast<int>(y), std::max(0, image.height() - 2));
    const auto u = static_cast<float>(x - x0), v = static_cast<float>(y - y0);
    return (1 - v) * ((1 - u) * at(image, x0, y0) + u * at(image, x0 + 1, y0)) +
           v * ((1 - u) * at(image, x0, y0 + 1) + u * at(image, x0 + 1, y0 + 1));
}

float cubicAt(const Image& image, const Vector2& pixel) {
    const double x = std::clamp(pixel.x(), 0.0, image.width() - 1.0);
    const double y = std::clamp(pixel.y(), 0.0, image.height() - 1.0);
    const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
    const auto weights = [](double t) {
        return std::array<double, 4>{((-t + 2) * t - 1) * t / 2, ((3 * t - 5) * t * t + 2) / 2,
                                     ((-3 * t + 4) * t + 1) * t / 2, (t - 1) * t * t / 2};
    };
    const std::array<double, 4> u = weights(x - x0), v = weights(y - y0);
    double sum = 0;
    for (int j = 0; j < 4; ++j)
        for (int i = 0; i < 4; ++i)
            sum += v[static_cast<std::size_t>(j)] * u[static_cast<std::size_t>(i)] *
                   double{at(image, x0 + i - 1, y0 + j - 1)};
    return static_cast<float>(sum);
}

PlaneSimilarity bestSimilarity(const Contour& from, const Contour& to) {
    Vector2 from_mean = Vector2::Zero(), to_mean = Vector2::Zero();
    const auto count = static_cast<double>(from.size());
    for (std::size_t i = 0; i < from.size(); ++i) {
        from_mean += from[i] / count;
        to_mean += to[i] / count;
    }
    double along = 0, across = 0, size = 0;
    for (std::size_t i = 0; i < from.size(); ++i) {
        const Vector2 p = from[i] - from_mean, q = to[i] - to_mean;
        along += p.dot(q);
        across += p.x() * q.y() - p.y() * q.x();
        size += p.squaredNorm();
    }
    PlaneSimilarity fit;
    if (size > 0) {
        fit.a = along / size;
        fit.b = across / size;
    }
    fit.shift_px =
        to_mean - Vector2(fit.a * from_mean.x() - fit.b * from_mean.y(), fit.b * from_mean.x() + fit.a * from_mean.y());
    return fit;
}

Image idealImage(const Image& image, const CArm& carm) {
    if (!carm.distortion) return image;
    double sum = 0;
    for (const float pixel : image.pixels())
        sum += pixel;
    const auto usual = static_cast<float>(sum / static_cast<double>(image.size()));
    Image result(image.width(), image.height());
    parallelFor(static_cast<std::size_t>(image.height()), 16, [&](std::size_t begin, std::size_t end) {
        for (auto y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            for (int x = 0; x < image.width(); ++x) {
                const Vector2 seen = carm.distortedPixel({x, y});
                result(x, y) = seen.allFinite() ? cubicAt(image, seen) : usual;
            }
        }
    });
    return result;
}

Mask filledMask(int width, int height, const std::vector<Contour>& contours, double margin_px) {
    Mask mask(width, height);
    for (const Contour& contour : contours) {
        // Inside: by the parity of crossings of each row.
        std::vector<std::vector<double>> crossings(static_cast<std::size_t>(height));
        for (std::size_t i = 0; i < contour.size(); ++i) {
            const Vector2& a = contour[i];
            const Vector2& b = contour[(i + 1) % contour.size()];
            const double low = std::min(a.y(), b.y()), high = std::max(a.y(), b.y());
            for (int y = std::max(0, static_cast<int>(std::ceil(low))); y < height && y < high; ++y)
                crossings[static_cast<std::size_t>(y)].push_back(a.x() +
                                                                 (y - a.y()) / (b.y() - a.y()) * (b.x() - a.x()));
        }
        for (int y = 0; y < height; ++y) {
            auto& row = crossings[static_cast<std::size_t>(y)];
            std::sort(row.begin(), row.end());
            for (std::size_t k = 0; k + 1 < row.size(); k += 2) {
                const int last = std::min(width - 1, static_cast<int>(std::floor(row[k + 1])));
                for (int x = std::max(0, static_cast<int>(std::ceil(row[k]))); x <= last; ++x)
                    mask(x, y) = 1;
            }
        }
        if (!(margin_px > 0)) continue;
        const int reach = static_cast<int>(std::ceil(margin_px));
        for (const Vector2& p : resampled(contour, std::max(1.0, margin_px / 4))) {
            const int px = static_cast<int>(std::lround(p.x())), py = static_cast<int>(std::lround(p.y()));
            for (int y = std::max(0, py - reach); y <= std::min(height - 1, py + reach); ++y)
                for (int x = std::max(0, px - reach); x <= std::min(width - 1, px + reach); ++x)
                    if ((Vector2(x, y) - p).norm() <= margin_px) mask(x, y) = 1;
        }
    }
    return mask;
}

std::optional<Alignment> alignImages(const Image& log_before, const Image& log_after, const Region& region,
                                     const Mask& mask, const PlaneSimilarity& start) {
    Alignment alignment;
    alignment.before_from_after = start;
    PlaneSimilarity& map = alignment.before_from_after;
    // Parameters about the region's middle, so that turn and scale do not shift.
    const Vector2 middle(region.x + region.width / 2.0, region.y + region.height / 2.0);
    const Image after_region = cropped(log_after, region);
    for (const double blur : kAlignBlurPx) {
        const Image before = bandPassed(log_before, blur), after = bandPassed(after_region, blur);
        struct Place {
            int x, y;
            float strength;
        };
        std::vector<Place> places;
        const int step = blur > 2 ? 2 : 1;
        for (int y = 2; y + 2 < region.height; y += step) {
            for (int x = 2; x + 2 < region.width; x += step) {
                if (mask(x, y)) continue;
                const float gx = after(x + 1, y) - after(x - 1, y), gy = after(x, y + 1) - after(x, y - 1);
                places.push_back({x, y, gx * gx + gy * gy});
            }
        }
        const auto keep = static_cast<std::size_t>(kEdgeShare * static_cast<double>(places.size()));
        if (keep < 100) return std::nullopt;
        std::nth_element(places.begin(), places.begin() + static_cast<std::ptrdiff_t>(keep), places.end(),
                         [](const Place& a, const Place& b) { return a.strength > b.strength; });
        places.resize(keep);
        bool settled = false;
        for (int iteration = 0; iteration < kMostSteps && !settled; ++iteration) {
            ++alignment.iterations;
            // Unknowns: a, b, shift, contrast, level.
            std::vector<Eigen::Matrix<double, 6, 1>> rows;
            std::vector<double> residuals;
            std::vector<float> sizes;
            for (const Place& place : places) {
                const Vector2 p(place.x + region.x, place.y + region.y), q = map * p;
                if (!reaches(before, q)) continue;
                const double seen = after(place.x, place.y), there = linearAt(before, q);
                if (!std::isfinite(seen) || !std::isfinite(there)) continue;
                const Vector2 slope = slopeAt(before, q), r = p - middle;
                Eigen::Matrix<double, 6, 1> row;
                row << slope.x() * r.x() + slope.y() * r.y(), -slope.x() * r.y() + slope.y() * r.x(), slope.x(),
                    slope.y(), there, 1;
                rows.push_back(row);
                residuals.push_back(seen - there);
                sizes.push_back(static_cast<float>(std::abs(seen - there)));
            }
            if (rows.size() < 100) return std::nullopt;
            const double spread = std::max(1e-6, 1.4826 * static_cast<double>(median(sizes)));
            Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Identity() * 1e-9;
            Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
            double sum = 0, weights = 0;
            for (std::size_t i = 0; i < rows.size(); ++i) {
                const double weight = 1 / (1 + std::pow(residuals[i] / (2 * spread), 2));
                normal += weight * rows[i] * rows[i].transpose();
                right += weight * residuals[i] * rows[i];
                sum += weight * residuals[i] * residuals[i];
                weights += weight;
            }
            alignment.rms_log = std::sqrt(sum / weights);
            const Vector2 off = map * middle - start * middle;
            const auto know = [&](int i, double value, double sigma) {
                const double weight = kAlikePlaces * std::pow(spread / sigma, 2);
                normal(i, i) += weight;
                right[i] -= weight * value;
            };
            know(0, map.a - start.a, kTurnSigma);
            know(1, map.b - start.b, kTurnSigma);
            know(2, off.x(), kShiftSigmaPx);
            know(3, off.y(), kShiftSigmaPx);
            const Eigen::Matrix<double, 6, 1> change = normal.ldlt().solve(right);
            if (!change.allFinite()) return std::nullopt;
            map.a += change[0];
            map.b += change[1];
            map.shift_px += change.segment<2>(2) - Vector2(change[0] * middle.x() - change[1] * middle.y(),
                                                           change[1] * middle.x() + change[0] * middle.y());
            const double moved = change.segment<2>(2).norm() + change.head<2>().norm() * region.height / 2;
            settled = moved < 0.01;
            if ((map * middle - start * middle).norm() > kFarPx) return std::nullopt;
        }
    }
    return alignment;
}

Image alignedBefore(const Image& log_before, const Region& region, const PlaneSimilarity& before_from_after) {
    Image aligned(region.width, region.height);
    for (int y = 0; y < region.height; ++y) {
        for (int x = 0; x < region.width; ++x) {
            const Vector2 seen = before_from_after * Vector2(x + region.x, y + region.y);
            aligned(x, y) = reaches(log_before, seen) ? cubicAt(log_before, seen) : kNone;
        }
    }
    return aligned;
}

Image differenceFrom(const Image& reference, const Image& log_after, const Region& region, const Mask& mask) {
    using Row = Eigen::Matrix<double, 7, 1>;
    Image difference = cropped(log_after, region);
    for (std::size_t i = 0; i < difference.size(); ++i)
        difference.pixels()[i] -= reference.pixels()[i];
    std::vector<float> known;
    for (const float pixel : reference.pixels())
        if (std::isfinite(pixel)) known.push_back(pixel);
    const double usual = known.empty() ? 0 : median(known);
    const auto term = [&](int x, int y) {
        const double u = 2.0 * x / region.width - 1, v = 2.0 * y / region.height - 1;
        return Row{1, u, v, u * u, u * v, v * v, reference(x, y) - usual};
    };
    Row values = Row::Zero();
    double spread = std::numeric_limits<double>::infinity();
    for (int iteration = 0; iteration < 6; ++iteration) {
        Eigen::Matrix<double, 7, 7> normal = Eigen::Matrix<double, 7, 7>::Identity() * 1e-6;
        Row right = Row::Zero();
        std::vector<float> sizes;
        for (int y = 0; y < region.height; y += 2) {
            for (int x = 0; x < region.width; x += 2) {
                if (mask(x, y) || !std::isfinite(difference(x, y))) continue;
                const Row row = term(x, y);
                const double rest = difference(x, y) - row.dot(values);
                const double weight = 1 / (1 + std::pow(rest / (2 * spread), 2));
                normal += weight * row * row.transpose();
                right += weight * difference(x, y) * row;
                sizes.push_back(static_cast<float>(std::abs(rest)));
            }
        }
        if (sizes.size() < 50) return difference;
        values = normal.ldlt().solve(right);
        spread = std::max(1e-6, 1.4826 * static_cast<double>(median(sizes)));
    }
    for (int y = 0; y < region.height; ++y)
        for (int x = 0; x < region.width; ++x)
            difference(x, y) -= static_cast<float>(term(x, y).dot(values));
    return difference;
}

}  // namespace fluorocut::cavity
