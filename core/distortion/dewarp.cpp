#include "core/distortion/dewarp.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "core/base/parallel.h"
#include "core/distortion/spline_filter.h"

namespace fluorocut {
namespace {

constexpr int kCell = 16;          // pixels between the nodes of a table
constexpr double kRimPitches = 2;  // how far beyond the support a picture is shown
constexpr std::size_t kRowsAtOnce = 16;

// A smooth function of the pixels of an image, tabulated at every kCell-th pixel of every kCell-th row and interpolated
// by Catmull-Rom cubics: error about h^3 / 24 of the third derivative, 2e-5 px for the bends of an intensifier.
class Table {
  public:
    Table() = default;
    Table(int columns, int rows)
        : across_((columns - 1) / kCell + 4),
          down_((rows - 1) / kCell + 4),
          columns_(columns),
          values_(static_cast<std::size_t>(across_ * down_)) {
        for (int phase = 0; phase < kCell; ++phase)
            phases_[static_cast<std::size_t>(phase)] = weights(static_cast<float>(phase) / kCell);
    }

    int across() const { return across_; }
    int down() const { return down_; }
    // Node (i, j) belongs to the pixel (i - 1, j - 1) * kCell.
    static Vector2 pixelOfNode(int i, int j) { return kCell * Vector2(i - 1, j - 1); }
    float& node(int i, int j) { return values_[static_cast<std::size_t>(j * across_ + i)]; }
    float node(int i, int j) const { return values_[static_cast<std::size_t>(j * across_ + i)]; }

    // The values along row y.
    void row(int y, std::vector<float>& nodes, float* values) const {
        const std::array<float, 4>& down = phases_[static_cast<std::size_t>(y % kCell)];
        const float* first = &values_[static_cast<std::size_t>(y / kCell * across_)];
        nodes.resize(static_cast<std::size_t>(across_));
        for (int i = 0; i < across_; ++i) {
            nodes[static_cast<std::size_t>(i)] = down[0] * first[i] + down[1] * first[i + across_] +
                                                 down[2] * first[i + 2 * across_] + down[3] * first[i + 3 * across_];
        }
        for (int x = 0; x < columns_; x += kCell) {
            const float* n = &nodes[static_cast<std::size_t>(x / kCell)];
            const int end = std::min(kCell, columns_ - x);
            for (int p = 0; p < end; ++p) {
                const std::array<float, 4>& w = phases_[static_cast<std::size_t>(p)];
                values[x + p] = w[0] * n[0] + w[1] * n[1] + w[2] * n[2] + w[3] * n[3];
            }
        }
    }

  private:
    static std::array<float, 4> weights(float t) {
        return {t * (-0.5F + t * (1 - 0.5F * t)), 1 + t * t * (-2.5F + 1.5F * t), t * (0.5F + t * (2 - 1.5F * t)),
                t * t * (-0.5F + 0.5F * t)};
    }

    int across_ = 0, down_ = 0, columns_ = 0;
    std::vector<float> values_;
    std::array<std::array<float, 4>, kCell> phases_{};
};

// u with idealPixel(u, v).x = x: where the first pass finds the pixel x of row v.
double rowPixel(const DistortionMap& map, double x, double v, double start) {
    double u = start;
    for (int iteration = 0; iteration < 20; ++iteration) {
        const Vector2 pixel(u, v);
        const double step = (map.idealPixel(pixel).x() - x) * map.pixelMm() / map.detectorJacobian(pixel)(0, 0);
        u -= step;
        if (!(std::abs(step) > 1e-5)) break;
    }
    return u;
}

// Copies with the border mirrored `pad` pixels outward: no test for the border in the loops.
Image padded(const Image& image, int pad) {
    Image result(image.width() + 2 * pad, image.height() + 2 * pad);
    const auto mirrored = [](int at, int count) {
        if (count == 1) return 0;
        const int period = 2 * (count - 1), phase = ((at % period) + period) % period;
        return phase < count ? phase : period - phase;
    };
    parallelFor(static_cast<std::size_t>(result.height()), 64, [&](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            const float* from = image.row(mirrored(y - pad, image.height()));
            float* to = result.row(y);
            std::copy(from, from + image.width(), to + pad);
            for (int x = 1; x <= pad; ++x) {
                to[pad - x] = from[mirrored(-x, image.width())];
                to[pad + image.width() - 1 + x] = from[mirrored(image.width() - 1 + x, image.width())];
            }
        }
    });
    return result;
}

}  // namespace

struct Dewarper::Implementation {
    Resampling method;
    int columns, rows;
    Table shift_u, shift_v;  // distorted pixel - straight pixel, at straight pixels
    Table row_shift;         // u - x at (x, v): for the first of two passes
    Mask answered;
    std::size_t without_answer = 0;

    Implementation(const DistortionMap& map, Resampling how)
        : method(how),
          columns(map.columns()),
          rows(map.rows()),
          shift_u(columns, rows),
          shift_v(columns, rows),
          answered(columns, rows) {
        if (method == Resampling::twoPass) row_shift = Table(columns, rows);
        Table depth(columns, rows);  // px inside the region that has answers
        const double rim = kRimPitches * map.parts().pitch_mm / map.pixelMm();
        const Support& support = map.parts().support;
        parallelFor(static_cast<std::size_t>(shift_u.down()), 1, [&](std::size_t begin, std::size_t end) {
            for (int j = static_cast<int>(begin); j < static_cast<int>(end); ++j) {
                double start = 0;
                Vector2 shift = Vector2::Zero();
                for (int i = 0; i < shift_u.across(); ++i) {
                    const Vector2 straight = Table::pixelOfNode(i, j);
                    const Vector2 detector = (straight - map.middle()) * map.pixelMm();
                    const Vector2 pixel = map.pixelFromDetector(detector, straight + shift, 1e-5 * map.pixelMm());
                    shift = pixel - straight;
                    shift_u.node(i, j) = static_cast<float>(shift.x());
                    shift_v.node(i, j) = static_cast<float>(shift.y());
                    depth.node(i, j) = static_cast<float>(support.depth(pixel) + rim);
                    if (method == Resampling::twoPass) {
                        start = rowPixel(map, straight.x(), straight.y(), straight.x() + start) - straight.x();
                        row_shift.node(i, j) = static_cast<float>(start);
                    }
                }
            }
        });
        std::vector<std::size_t> lost(static_cast<std::size_t>(rows));
        parallelFor(static_cast<std::size_t>(rows), kRowsAtOnce, [&](std::size_t begin, std::size_t end) {
            Row row(columns);
            std::vector<float> inside(static_cast<std::size_t>(columns));
            for (std::size_t y = begin; y < end; ++y) {
                lookUp(static_cast<int>(y), row);
                depth.row(static_cast<int>(y), row.nodes, inside.data());
                std::uint8_t* mask = answered.row(static_cast<int>(y));
                std::size_t count = 0;
                for (int x = 0; x < columns; ++x) {
                    const auto at = static_cast<std::size_t>(x);
                    // Half a pixel beyond the centres of the outermost is the edge of the picture. NaN has no answer.
                    const bool has = inside[at] >= 0 && row.u[at] >= -0.5F && row.v[at] >= -0.5F &&
                                     row.u[at] <= static_cast<float>(columns) - 0.5F &&
                                     row.v[at] <= static_cast<float>(rows) - 0.5F;
                    mask[x] = has;
                    count += !has;
                }
                lost[y] = count;
            }
        });
        for (const std::size_t count : lost)
            without_answer += count;
    }

    // Where the pixels of a row look.
    struct Row {
        explicit Row(int count) : u(static_cast<std::size_t>(count)), v(u) {}
        std::vector<float> u, v, nodes;
    };
    void lookUp(int y, Row& row) const {
        shift_u.row(y, row.nodes, row.u.data());
        shift_v.row(y, row.nodes, row.v.data());
        for (std::size_t x = 0; x < row.u.size(); ++x) {
            row.u[x] += static_cast<float>(x);
            row.v[x] += static_cast<float>(y);
        }
    }

    template <class Body>
    Image forRows(const Body& body) const {
        Image result(columns, rows);
        parallelFor(static_cast<std::size_t>(rows), kRowsAtOnce, [&](std::size_t begin, std::size_t end) {
            Row row(columns);
            for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
                body(y, row, answered.row(y), result.row(y));
            }
        });
        return result;
    }

    static constexpr int kPad = 3;

    Image bspline(const Image& distorted) const {
        Image coefficients = distorted;
        splineFilterColumns(coefficients);
        splineFilterRows(coefficients);
        coefficients = padded(coefficients, kPad);
        return forRows([&](int y, Row& row, const std::uint8_t* mask, float* to) {
            lookUp(y, row);
            for (int x = 0; x < columns; ++x) {
                if (!mask[x]) continue;
                const float u = row.u[static_cast<std::size_t>(x)] + kPad,
                            v = row.v[static_cast<std::size_t>(x)] + kPad;
                const int column = static_cast<int>(u), line = static_cast<int>(v);
                const std::array<float, 4> wu = splineWeights(u - static_cast<float>(column));
                const std::array<float, 4> wv = splineWeights(v - static_cast<float>(line));
                using Four = Eigen::Array4f;
                const float* from = coefficients.row(line - 1) + column - 1;
                const std::ptrdiff_t stride = coefficients.width();
                const Four sum = wv[0] * Four::Map(from) + wv[1] * Four::Map(from + stride) +
                                 wv[2] * Four::Map(from + 2 * stride) + wv[3] * Four::Map(from + 3 * stride);
                to[x] = (sum * Four::Map(wu.data())).sum();
            }
        });
    }

    Image linear(const Image& distorted) const {
        return forRows([&](int y, Row& row, const std::uint8_t* mask, float* to) {
            lookUp(y, row);
            for (int x = 0; x < columns; ++x) {
                if (!mask[x]) continue;
                const float u = std::clamp(row.u[static_cast<std::size_t>(x)], 0.0F, static_cast<float>(columns - 1));
                const float v = std::clamp(row.v[static_cast<std::size_t>(x)], 0.0F, static_cast<float>(rows - 1));
                const int column = static_cast<int>(u), line = static_cast<int>(v);
                const int right = std::min(column + 1, columns - 1), below = std::min(line + 1, rows - 1);
                const float s = u - static_cast<float>(column), t = v - static_cast<float>(line);
                to[x] = (1 - t) * ((1 - s) * distorted(column, line) + s * distorted(right, line)) +
                        t * ((1 - s) * distorted(column, below) + s * distorted(right, below));
            }
        });
    }

    Image twoPass(const Image& distorted) const {
        Image coefficients = distorted;
        splineFilterRows(coefficients);
        coefficients = padded(coefficients, kPad);
        // I(x, v): each row on its own. All pixels, answered or not: the second pass's splines run through them.
        Image between(columns, rows);
        parallelFor(static_cast<std::size_t>(rows), kRowsAtOnce, [&](std::size_t begin, std::size_t end) {
            std::vector<float> nodes, shift(static_cast<std::size_t>(columns));
            for (int v = static_cast<int>(begin); v < static_cast<int>(end); ++v) {
                row_shift.row(v, nodes, shift.data());
                const float* from = coefficients.row(v + kPad);
                for (int x = 0; x < columns; ++x) {
                    const float u = static_cast<float>(x) + shift[static_cast<std::size_t>(x)];
                    // In this order a shift that is no number lands at the border.
                    const float inside = std::max(-0.5F, std::min(u, static_cast<float>(columns) - 0.5F)) + kPad;
                    const int column = static_cast<int>(inside);
                    const std::array<float, 4> w = splineWeights(inside - static_cast<float>(column));
                    const float* c = from + column - 1;
                    between(x, v) = w[0] * c[0] + w[1] * c[1] + w[2] * c[2] + w[3] * c[3];
                }
            }
        });
        splineFilterColumns(between);
        between = padded(between, kPad);
        // (x, y): each column on its own.
        return forRows([&](int y, Row& row, const std::uint8_t* mask, float* to) {
            lookUp(y, row);
            const std::ptrdiff_t stride = between.width();
            for (int x = 0; x < columns; ++x) {
                if (!mask[x]) continue;
                const float v = row.v[static_cast<std::size_t>(x)] + kPad;
                const int line = static_cast<int>(v);
                const std::array<float, 4> w = splineWeights(v - static_cast<float>(line));
                const float* c = between.row(line - 1) + x + kPad;
                to[x] = w[0] * c[0] + w[1] * c[stride] + w[2] * c[2 * stride] + w[3] * c[3 * stride];
            }
        });
    }
};

Dewarper::Dewarper(const DistortionMap& map, std::optional<Resampling> method)
    : implementation_(std::make_unique<const Implementation>(
          map, method.value_or(map.model().name() == "bernstein" ? Resampling::twoPass : Resampling::bspline))) {}
Dewarper::~Dewarper() = default;
Dewarper::Dewarper(Dewarper&&) noexcept = default;
Dewarper& Dewarper::operator=(Dewarper&&) noexcept = default;

Result<Image> Dewarper::dewarped(const Image& distorted) const {
    const Implementation& all = *implementation_;
    if (distorted.width() != all.columns || distorted.height() != all.rows) {
        return invalidInput("image", fmt::format("{} x {} pixels", distorted.width(), distorted.height()),
                            fmt::format("{} x {}, as its distortion map has", all.columns, all.rows));
    }
    switch (all.method) {
        case Resampling::bspline:
            return all.bspline(distorted);
        case Resampling::twoPass:
            return all.twoPass(distorted);
        case Resampling::linear:
            return all.linear(distorted);
    }
    throw std::logic_error("Dewarper: unknown method");
}

Resampling Dewarper::method() const {
    return implementation_->method;
}

const Mask& Dewarper::answered() const {
    return implementation_->answered;
}

std::size_t Dewarper::pixelsWithoutAnswer() const {
    return implementation_->without_answer;
}

Vector2 Dewarper::distortedPixel(int x, int y) const {
    Implementation::Row row(implementation_->columns);
    implementation_->lookUp(y, row);
    return {row.u[static_cast<std::size_t>(x)], row.v[static_cast<std::size_t>(x)]};
}

CArm straightened(const DistortionMap& map, const CArm& carm) {
    // ideal_px = middle + detector_mm / p, and the C-arm's mm are counted from its principal point c: distortionOf().
    CArm straight = carm.ideal();
    straight.pixel_mm = Vector2::Constant(map.pixelMm());
    straight.principal_point_px =
        map.middle() + (carm.principal_point_px - map.middle()).cwiseProduct(carm.pixel_mm) / map.pixelMm();
    return straight;
}

}  // namespace fluorocut
