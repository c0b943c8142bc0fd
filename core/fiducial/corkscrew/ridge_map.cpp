#include "core/fiducial/corkscrew/ridge_map.h"

#include <algorithm>
#include <numbers>

#include <fmt/format.h>

#include "core/base/median.h"
#include "core/base/parallel.h"
#include "core/image/blur.h"

namespace fluorocut::corkscrew {
namespace {

constexpr double kMapStepPx = 16;        // between the places where the distortion is evaluated
constexpr double kMostGrowth = 1.4;      // of the ideal image over the distorted one
constexpr int kMostWorkingPixels = 640;  // along a side
constexpr double kDarkest = 0.01;        // of the median, added to every intensity: black has a logarithm too
constexpr float kNoiseMultiple = 1.5F;   // of a working pixel's noise; a ridge's is 0.4 of it: 3.7 standard deviations
constexpr float kContrast = 0.12F;       // above that, in log intensity, at which a line is certainly one
constexpr std::size_t kRows = 16;

Image blockMeans(const Image& image, int factor) {
    if (factor == 1) return image;
    Image result(image.width() / factor, image.height() / factor);
    const float scale = 1.0F / static_cast<float>(factor * factor);
    parallelFor(static_cast<std::size_t>(result.height()), kRows, [&](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            float* out = result.row(y);
            for (int dy = 0; dy < factor; ++dy) {
                const float* in = image.row(y * factor + dy);
                for (int x = 0; x < result.width(); ++x)
                    for (int dx = 0; dx < factor; ++dx)
                        out[x] += scale * in[x * factor + dx];
            }
        }
    });
    return result;
}

float bilinear(const Image& image, float x, float y) {
    x = std::clamp(x, 0.0F, static_cast<float>(image.width() - 1));
    y = std::clamp(y, 0.0F, static_cast<float>(image.height() - 1));
    const int ix = std::min(static_cast<int>(x), std::max(0, image.width() - 2));
    const int iy = std::min(static_cast<int>(y), std::max(0, image.height() - 2));
    const int jx = std::min(ix + 1, image.width() - 1), jy = std::min(iy + 1, image.height() - 1);
    const float fx = x - static_cast<float>(ix), fy = y - static_cast<float>(iy);
    const float* low = image.row(iy);
    const float* high = image.row(jy);
    return (1 - fy) * (low[ix] + fx * (low[jx] - low[ix])) + fy * (high[ix] + fx * (high[jx] - high[ix]));
}

// Where the pixels of the working grid lie in the binned, distorted image: exact at nodes, bilinear between.
struct PixelMap {
    int columns = 0, rows = 0;  // of nodes
    std::vector<Eigen::Vector2f> nodes;

    Eigen::Vector2f operator()(int x, int y) const {
        const float u = static_cast<float>(x / kMapStepPx), v = static_cast<float>(y / kMapStepPx);
        const int i = std::min(static_cast<int>(u), columns - 2), j = std::min(static_cast<int>(v), rows - 2);
        const float fu = u - static_cast<float>(i), fv = v - static_cast<float>(j);
        const auto node = [&](int a, int b) { return nodes[static_cast<std::size_t>((j + b) * columns + i + a)]; };
        return (1 - fv) * ((1 - fu) * node(0, 0) + fu * node(1, 0)) + fv * ((1 - fu) * node(0, 1) + fu * node(1, 1));
    }
};

// An ideal C-arm with square pixels that sees all the distorted one sees.
CArm idealGrid(const CArm& carm, double pixel_mm) {
    const Vector2 corner(carm.columns - 0.5, carm.rows - 0.5);
    Vector2 low = (Vector2(-0.5, -0.5) - carm.principal_point_px).cwiseProduct(carm.pixel_mm);
    Vector2 high = (corner - carm.principal_point_px).cwiseProduct(carm.pixel_mm);
    const Vector2 low_most = low - (kMostGrowth - 1) / 2 * (high - low),
                  high_most = high + (kMostGrowth - 1) / 2 * (high - low);
    if (carm.distortion) {
        constexpr int kSteps = 16;
        Vector2 seen_low = Vector2::Constant(1e9), seen_high = -seen_low;
        for (int i = 0; i <= kSteps; ++i) {
            for (const Vector2& at :
                 {Vector2(i / 16.0, 0), Vector2(i / 16.0, 1), Vector2(0, i / 16.0), Vector2(1, i / 16.0)}) {
                const Vector3 place =
                    carm.detectorPoint(at.cwiseProduct(corner + Vector2(0.5, 0.5)) - Vector2(0.5, 0.5));
                if (!place.allFinite()) continue;
                seen_low = seen_low.cwiseMin(place.head<2>());
                seen_high = seen_high.cwiseMax(place.head<2>());
            }
        }
        if (((seen_high - seen_low).array() > 0.5 * (high - low).array()).all()) {
            low = seen_low.cwiseMax(low_most);
            high = seen_high.cwiseMin(high_most);
        }
    }
    CArm grid = carm.ideal();
    grid.pixel_mm = {pixel_mm, pixel_mm};
    grid.columns = std::clamp(static_cast<int>(std::lround((high.x() - low.x()) / pixel_mm)), 2, kMostWorkingPixels);
    grid.rows = std::clamp(static_cast<int>(std::lround((high.y() - low.y()) / pixel_mm)), 2, kMostWorkingPixels);
    grid.principal_point_px = -low / pixel_mm - Vector2(0.5, 0.5);
    return grid;
}

PixelMap pixelMap(const CArm& carm, const CArm& grid, int binning) {
    PixelMap map;
    map.columns = static_cast<int>(std::ceil((grid.columns - 1) / kMapStepPx)) + 1;
    map.rows = static_cast<int>(std::ceil((grid.rows - 1) / kMapStepPx)) + 1;
    map.columns = std::max(map.columns, 2);
    map.rows = std::max(map.rows, 2);
    map.nodes.resize(static_cast<std::size_t>(map.columns * map.rows));
    for (int j = 0; j < map.rows; ++j) {
        for (int i = 0; i < map.columns; ++i) {
            const Vector3 place = grid.detectorPoint({i * kMapStepPx, j * kMapStepPx});
            const Vector2 pixel = carm.project(place);
            map.nodes[static_cast<std::size_t>(j * map.columns + i)] =
                ((pixel.array() - 0.5 * (binning - 1)) / binning).matrix().cast<float>();
        }
    }
    return map;
}

float quantile(std::vector<float>& values, double share) {
    const auto nth = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), nth, values.end());
    return *nth;
}

// Intensity noise has variance k I: the k that explains what a second difference leaves, which sees no smooth picture
// (Immerkaer 1996; the squared sum of its weights is 36).
float noiseConstant(const Image& log, const Image& intensity) {
    std::vector<float> values;
    for (int y = 1; y + 1 < log.height(); y += 2) {
        for (int x = 1; x + 1 < log.width(); x += 2) {
            if (!std::isfinite(intensity(x, y))) continue;
            const float* a = log.row(y - 1) + x;
            const float* b = log.row(y) + x;
            const float* c = log.row(y + 1) + x;
            const float h = a[-1] - 2 * a[0] + a[1] - 2 * (b[-1] - 2 * b[0] + b[1]) + c[-1] - 2 * c[0] + c[1];
            values.push_back(h * h / 36 * intensity(x, y));
        }
    }
    if (values.empty()) return 0;
    return quantile(values, 0.5) / 0.455F;  // the median of the square of a standard normal number
}

}  // namespace

Result<WorkingImage> workingImage(const Image& image, const CArm& carm, double pixel_mm, bool metal_is_bright) {
    const double finest = carm.pixel_mm.minCoeff();
    WorkingImage working;
    working.binning = std::clamp(static_cast<int>(pixel_mm / finest + 0.01), 1,
                                 std::max(1, std::min(image.width(), image.height()) / 16));
    const Image binned = blockMeans(image, working.binning);
    const double field = std::max(carm.columns * carm.pixel_mm.x(), carm.rows * carm.pixel_mm.y());
    working.carm = idealGrid(carm, std::max(working.binning * finest, kMostGrowth * field / kMostWorkingPixels));

    std::vector<float> levels(binned.pixels());
    const float high = quantile(levels, 0.999), low = quantile(levels, 0.001), middle = quantile(levels, 0.5);
    if (!(high - low > 1e-6F * std::max(std::abs(high), std::abs(low)))) {
        return noSolution("image", fmt::format("nothing but one grey value ({:.4g})", middle),
                          "an X-ray image of a corkscrew", "check the shutter, the exposure and the file");
    }
    // Bright metal: the brightest has let no photons through. Levels below zero are no photons: lifted.
    const float zero = metal_is_bright ? 0.0F : std::min(low, 0.0F);
    const float typical = metal_is_bright ? high - middle : middle - zero;
    const auto black = static_cast<float>(kDarkest) * std::max(typical, 0.02F * (high - low));

    const PixelMap map = pixelMap(carm, working.carm, working.binning);
    const int width = working.carm.columns, height = working.carm.rows;
    Image intensity(width, height);
    working.log = Image(width, height);
    working.sigma = Image(width, height);
    parallelFor(static_cast<std::size_t>(height), kRows, [&](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            for (int x = 0; x < width; ++x) {
                const Eigen::Vector2f at = map(x, y);
                const bool seen = at.x() >= -0.5F && at.y() >= -0.5F &&
                                  at.x() <= static_cast<float>(binned.width()) - 0.5F &&
                                  at.y() <= static_cast<float>(binned.height()) - 0.5F;
                const bool known = at.allFinite();
                const float level = known ? bilinear(binned, at.x(), at.y()) : middle;
                const float value = std::max(metal_is_bright ? high - level : level - zero, 0.0F) + black;
                working.log(x, y) = std::log(value);
                intensity(x, y) = seen ? value : std::numeric_limits<float>::quiet_NaN();
            }
        }
    });
    const float constant = noiseConstant(working.log, intensity);
    for (std::size_t i = 0; i < intensity.size(); ++i)
        working.sigma.pixels()[i] = std::sqrt(constant / intensity.pixels()[i]);  // NaN outside the field
    return working;
}

bool looksBright(const WorkingImage& dark) {
    double cubes = 0, squares = 0;
    int count = 0;
    const Image& log = dark.log;
    constexpr int kAway = 4;
    for (int y = kAway; y + kAway < log.height(); y += 2) {
        for (int x = kAway; x + kAway < log.width(); x += 2) {
            const double off =
                log(x, y) - 0.25 * (log(x - kAway, y) + log(x + kAway, y) + log(x, y - kAway) + log(x, y + kAway));
            if (!std::isfinite(dark.sigma(x, y))) continue;
            const double capped = std::clamp(off, -0.5, 0.5);
            cubes += capped * capped * capped;
            squares += capped * capped;
            ++count;
        }
    }
    return count > 0 && squares > 0 && cubes > 0;
}

RidgeMap ridgesOfWidth(const WorkingImage& image, double width_px, std::vector<RidgePoint>* points) {
    const int width = image.log.width(), height = image.log.height();
    // The scale that answers best to a bar of width w: w / sqrt(12) is its standard deviation (Lindeberg 1998).
    const double sigma = std::max(0.9, 0.4 * width_px);
    const Image blurred = gaussianBlurred(image.log, sigma);
    const float near = static_cast<float>(0.5 * width_px + sigma), far = near + 1.2F;
    // White noise blurred by sigma keeps 1 / (2 sqrt(pi) sigma) of its standard deviation.
    const float noise_share = kNoiseMultiple / static_cast<float>(std::max(1.0, sigma));

    struct Hessian {
        float curvature = 0, cosine = 1, sine = 0;  // larger eigenvalue; double angle of its direction
    };
    std::vector<Hessian> hessians(image.log.size());
    parallelFor(static_cast<std::size_t>(std::max(0, height - 2)), kRows, [&](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin) + 1; y < static_cast<int>(end) + 1; ++y) {
            const float* above = blurred.row(y - 1);
            const float* here = blurred.row(y);
            const float* below = blurred.row(y + 1);
            Hessian* out = hessians.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
            for (int x = 1; x + 1 < width; ++x) {
                const float xx = here[x + 1] - 2 * here[x] + here[x - 1];
                const float yy = below[x] - 2 * here[x] + above[x];
                const float xy = 0.25F * (below[x + 1] - below[x - 1] - above[x + 1] + above[x - 1]);
                const float half = 0.5F * (xx - yy), root = std::sqrt(half * half + xy * xy);
                const float inverse = root > 0 ? 1 / root : 0.0F;
                out[x] = {0.5F * (xx + yy) + root, half * inverse, xy * inverse};
            }
        }
    });

    std::array<float, kDirections> cosines{}, sines{};
    for (int k = 0; k < kDirections; ++k) {
        cosines[static_cast<std::size_t>(k)] = static_cast<float>(std::cos(2 * std::numbers::pi * k / kDirections));
        sines[static_cast<std::size_t>(k)] = static_cast<float>(std::sin(2 * std::numbers::pi * k / kDirections));
    }
    RidgeMap map(width, height);
    std::vector<std::vector<RidgePoint>> found(static_cast<std::size_t>(height));
    parallelFor(static_cast<std::size_t>(height), kRows, [&](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            const Hessian* row = hessians.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
            for (int x = 0; x < width; ++x) {
                const float noise = image.sigma(x, y);
                if (!image.sees(x, y)) continue;  // stays at chance
                Strengths& cell = map.at(x, y);
                cell.fill(0);
                const Hessian& h = row[x];
                if (!(h.curvature > 0)) continue;
                const float nx = std::sqrt(std::max(0.0F, 0.5F * (1 + h.cosine)));
                const float ny = std::copysign(std::sqrt(std::max(0.0F, 0.5F * (1 - h.cosine))), h.sine);
                const float fx = static_cast<float>(x), fy = static_cast<float>(y), here = blurred(x, y);
                const auto contrast = [&](float d) {
                    return std::min(bilinear(blurred, fx + d * nx, fy + d * ny),
                                    bilinear(blurred, fx - d * nx, fy - d * ny)) -
                           here;
                };
                const float strength = (std::max(contrast(near), contrast(far)) - noise_share * noise) / kContrast;
                if (!(strength > 0)) continue;
                const float capped = std::min(strength, 1.0F);
                // The tangent's double angle is the normal's plus pi.
                for (std::size_t k = 0; k < kDirections; ++k) {
                    const float along = -(h.cosine * cosines[k] + h.sine * sines[k]);
                    if (along > 0) cell[k] = static_cast<std::uint8_t>(capped * along * static_cast<float>(kFull));
                }
                if (!points || x < 2 || y < 2 || x + 2 >= width || y + 2 >= height) continue;
                const int sx = static_cast<int>(std::lround(nx * 1.3F)), sy = static_cast<int>(std::lround(ny * 1.3F));
                if (row[x + sx + sy * width].curvature > h.curvature ||
                    row[x - sx - sy * width].curvature >= h.curvature) {
                    continue;
                }
                found[static_cast<std::size_t>(y)].push_back({fx, fy, std::atan2(nx, -ny), capped});
            }
        }
    });
    if (points) {
        points->clear();
        for (const std::vector<RidgePoint>& row : found)
            points->insert(points->end(), row.begin(), row.end());
    }
    return map;
}

RidgeMap dilated(const RidgeMap& map) {
    const int width = map.width(), height = map.height();
    RidgeMap rows(width, height), result(width, height);
    const auto larger = [](Strengths& a, const Strengths& b) {
        for (std::size_t k = 0; k < kDirections; ++k)
            a[k] = std::max(a[k], b[k]);
    };
    parallelFor(static_cast<std::size_t>(height), kRows, [&](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            for (int x = 0; x < width; ++x) {
                Strengths cell = map.at(x, y);
                if (x > 0) larger(cell, map.at(x - 1, y));
                if (x + 1 < width) larger(cell, map.at(x + 1, y));
                rows.at(x, y) = cell;
            }
        }
    });
    parallelFor(static_cast<std::size_t>(height), kRows, [&](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            for (int x = 0; x < width; ++x) {
                Strengths cell = rows.at(x, y);
                if (y > 0) larger(cell, rows.at(x, y - 1));
                if (y + 1 < height) larger(cell, rows.at(x, y + 1));
                result.at(x, y) = cell;
            }
        }
    });
    return result;
}

}  // namespace fluorocut::corkscrew
