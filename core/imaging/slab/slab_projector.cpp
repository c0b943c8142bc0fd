#include "core/imaging/slab/slab_projector.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <vector>

#include "core/base/parallel.h"

namespace fluorocut {
namespace {

constexpr double kFinestStep = 0.5;     // of the base image, in voxels
constexpr double kCoarsestScale = 1.4;  // the farthest slice is sampled at most this much coarser than the base plane
constexpr int kTileRows = 32;
// Linear interpolation between voxels blurs each slice by a kernel of variance 1/6 voxel^2, which -1/12 of the second
// difference would undo for smooth content. Where voxels hold a shape's edge (whole voxels or partial volumes), less is
// best: 1/32 is no worse than an exact ray tracer through voxel boxes on spheres and cylinder shells of both kinds, and
// still halves the error on smooth blobs.
constexpr double kSharpening = 1.0 / 32;
constexpr double kLeastCosine = 0.25881904510252074;  // cos 75 degrees

template <class T>
class AlignedArray {
  public:
    explicit AlignedArray(std::size_t count)
        : data_(static_cast<T*>(std::aligned_alloc(64, (count * sizeof(T) + 63) / 64 * 64)), &std::free) {
        if (!data_) throw std::bad_alloc();
    }
    T* get() const { return data_.get(); }

  private:
    std::unique_ptr<T, decltype(&std::free)> data_;
};

// The four corners of the image in ideal pixel coordinates (of the box around all of them for a distorted imager).
std::array<Vector2, 4> corners(const ProjectionGeometry& g) {
    Vector2 low(0, 0), high(g.columns - 1, g.rows - 1);
    if (g.ideal_pixels) {
        low = g.ideal_pixels->low;
        high = g.ideal_pixels->high;
    }
    return {Vector2(low.x(), low.y()), Vector2(high.x(), low.y()), Vector2(low.x(), high.y()),
            Vector2(high.x(), high.y())};
}

// The slices in front of the source, and the base plane they are gathered on.
struct BasePlane {
    const SlabOrientation* o = nullptr;
    Vector3 source;       // (a, b, m) order: column axis, row axis, main axis
    double level = 0;     // k_b
    double distance = 0;  // k_b - S_m, signed
    int slice_first = 0, slice_last = -1;
    double step_a = kFinestStep, step_b = kFinestStep;  // voxels
    double a0 = 0, b0 = 0;                              // index coordinates of base value (0, 0)
    int width = 0, height = 0;
    std::ptrdiff_t stride = 0;

    bool empty() const { return slice_first > slice_last || width <= 0 || height <= 0; }
    double scale(int slice) const { return (slice - source.z()) / distance; }
    // Trapezoidal rule; the interval in which the source lies counts with its part in front of the source.
    double weight(int slice) const { return std::min(1.0, 0.5 + std::abs(slice - source.z())); }
};

Vector3 reorder(const SlabOrientation& o, const Vector3& v) {
    return {v[o.column_axis], v[o.row_axis], v[o.main_axis]};
}

BasePlane planBase(const SlabVolume& volume, const ProjectionGeometry& g, int main_axis, int binning) {
    const SlabOrientation& o = volume.orientation(main_axis);
    BasePlane base;
    base.o = &o;
    base.source = reorder(o, g.source);
    const double forward = g.central[main_axis] > g.source[main_axis] ? 1 : -1;
    const double s_m = base.source.z();
    base.slice_first = o.slice_first;
    base.slice_last = o.slice_last;
    if (forward > 0) base.slice_first = std::max(base.slice_first, static_cast<int>(std::floor(s_m)) + 1);
    if (forward < 0) base.slice_last = std::min(base.slice_last, static_cast<int>(std::ceil(s_m)) - 1);
    if (base.slice_first > base.slice_last) return base;

    const double far = forward > 0 ? base.slice_last - s_m : s_m - base.slice_first;
    const double near = forward > 0 ? base.slice_first - s_m : s_m - base.slice_last;
    base.distance = forward * std::max(0.5 * (near + far), far / kCoarsestScale);
    base.level = s_m + base.distance;

    // What the detector sees of the base plane.
    double a_low = 1e30, a_high = -1e30, b_low = 1e30, b_high = -1e30;
    for (const Vector2& corner : corners(g)) {
        const Vector3 ray = reorder(o, g.detectorPoint(corner.x(), corner.y()) - g.source);
        const Vector3 at = base.source + ray * (base.distance / ray.z());
        a_low = std::min(a_low, at.x());
        a_high = std::max(a_high, at.x());
        b_low = std::min(b_low, at.y());
        b_high = std::max(b_high, at.y());
    }
    // A binned image needs no finer base than its own samples, two per pixel and axis.
    if (binning > 1) {
        const double pixels_a = std::max(1.0, static_cast<double>(g.columns)),
                     pixels_b = std::max(1.0, static_cast<double>(g.rows));
        const double spacing = 0.5 * binning * std::min((a_high - a_low) / pixels_a, (b_high - b_low) / pixels_b);
        base.step_a = base.step_b = std::clamp(0.75 * spacing, kFinestStep, 1.0);
    }
    // Nothing is seen beyond the shadow of what is not air.
    double shadow_a_low = 1e30, shadow_a_high = -1e30, shadow_b_low = 1e30, shadow_b_high = -1e30;
    for (int k = base.slice_first; k <= base.slice_last; ++k) {
        const SlabOrientation::Extent& extent = o.extents[static_cast<std::size_t>(k)];
        if (extent.empty()) continue;
        const double inverse = 1 / base.scale(k);
        shadow_a_low = std::min(shadow_a_low, base.source.x() + (extent.column_first - 1 - base.source.x()) * inverse);
        shadow_a_high = std::max(shadow_a_high, base.source.x() + (extent.column_last + 1 - base.source.x()) * inverse);
        shadow_b_low = std::min(shadow_b_low, base.source.y() + (extent.row_first - 1 - base.source.y()) * inverse);
        shadow_b_high = std::max(shadow_b_high, base.source.y() + (extent.row_last + 1 - base.source.y()) * inverse);
    }
    a_low = std::max(a_low, shadow_a_low);
    a_high = std::min(a_high, shadow_a_high);
    b_low = std::max(b_low, shadow_b_low);
    b_high = std::min(b_high, shadow_b_high);
    if (!(a_low <= a_high && b_low <= b_high)) return base;

    // The grid's points stay where they are in the volume when the view moves a little: whole multiples of the step
    // away from the source's foot, with a margin of two for the cubic.
    base.a0 = (std::floor(a_low / base.step_a) - 2) * base.step_a;
    base.b0 = (std::floor(b_low / base.step_b) - 2) * base.step_b;
    base.width = static_cast<int>(std::ceil((a_high - base.a0) / base.step_a)) + 4;
    base.height = static_cast<int>(std::ceil((b_high - base.b0) / base.step_b)) + 4;
    base.stride = (base.width + 31) / 32 * 32;
    return base;
}

// Adds every slice to the base image (and, when wanted, to W), tile by tile.
void fillBase(const BasePlane& base, const SlabKernels& kernels, float* image, float* image_w) {
    const SlabOrientation& o = *base.o;
    const auto tiles = static_cast<std::size_t>((base.height + kTileRows - 1) / kTileRows);
    const auto capacity = static_cast<std::size_t>(base.stride + 64);
    const std::ptrdiff_t prefetch = 2 * o.slice_stride;
    parallelFor(tiles, 1, [&](std::size_t tile_begin, std::size_t tile_end) {
        const AlignedArray<std::int32_t> start(capacity), index(capacity), weight(capacity);
        const AlignedArray<float> rows(2 * capacity);
        RowTable table{start.get(), index.get(), weight.get(), 0, 0, false};
        for (std::size_t tile = tile_begin; tile < tile_end; ++tile) {
            const int q_begin = static_cast<int>(tile) * kTileRows;
            const int q_end = std::min(q_begin + kTileRows, base.height);
            std::fill(image + base.stride * q_begin, image + base.stride * q_end, 0.0f);
            if (image_w) std::fill(image_w + base.stride * q_begin, image_w + base.stride * q_end, 0.0f);
            for (int k = base.slice_first; k <= base.slice_last; ++k) {
                const SlabOrientation::Extent& extent = o.extents[static_cast<std::size_t>(k)];
                if (extent.empty()) continue;
                const double s = base.scale(k);
                const double a_first = base.source.x() + (base.a0 - base.source.x()) * s, a_step = base.step_a * s;
                const double b_first = base.source.y() + (base.b0 - base.source.y()) * s, b_step = base.step_b * s;
                // Only base points whose bilinear stencil touches something: strictly between first - 1 and last + 1.
                const auto from = [](double low, double first, double step) {
                    return static_cast<int>(std::clamp(std::ceil((low - first) / step + 1e-9), -1.0, 1e6));
                };
                const auto to = [](double high, double first, double step) {
                    return static_cast<int>(std::clamp(std::floor((high - first) / step - 1e-9), -1.0, 1e6)) + 1;
                };
                const int q0 = std::max(q_begin, from(extent.row_first - 1, b_first, b_step));
                const int q1 = std::min(q_end, to(extent.row_last + 1, b_first, b_step));
                const int p0 = std::max(0, from(extent.column_first - 1, a_first, a_step));
                const int p1 = std::min(base.width, to(extent.column_last + 1, a_first, a_step));
                if (q0 >= q1 || p0 >= p1) continue;
                kernels.fillTable(table, a_first, a_step, p0, p1);

                const int written = table.group_begin * 16, count = (table.group_end - table.group_begin) * 16;
                float* h0 = rows.get();
                float* h1 = rows.get() + capacity / 16 * 16;
                int row0 = -1000000, row1 = -1000000;
                const auto interpolate = [&](int row, float* into) {
                    if (row < extent.row_first || row > extent.row_last) {
                        std::fill(into + written, into + written + count, 0.0f);
                    } else {
                        kernels.interpolateRow(o.first + o.slice_stride * k + o.row_stride * row, table, into,
                                               prefetch);
                    }
                };
                const double slice_weight = base.weight(k);
                const float ratio = static_cast<float>((1 - s) / s);
                for (int q = q0; q < q1; ++q) {
                    const double b = b_first + q * b_step;
                    const int row = static_cast<int>(std::floor(b));
                    if (row != row0) {
                        if (row == row1) {
                            std::swap(h0, h1);
                        } else {
                            interpolate(row, h0);
                        }
                        interpolate(row + 1, h1);
                        row0 = row;
                        row1 = row + 1;
                    }
                    const float w1 = static_cast<float>((b - row) * slice_weight);
                    const float w0 = static_cast<float>((1 - (b - row)) * slice_weight);
                    float* sum = image + base.stride * q + written;
                    if (image_w) {
                        kernels.accumulateTwo(sum, image_w + base.stride * q + written, h0 + written, h1 + written, w0,
                                              w1, ratio, count);
                    } else {
                        kernels.accumulate(sum, h0 + written, h1 + written, w0, w1, count);
                    }
                }
            }
        }
    });
}

// Both images have a margin, which stays zero.
void sharpenBase(const BasePlane& base, const SlabKernels& kernels, const float* from, float* to) {
    const auto along = static_cast<float>(kSharpening / (base.step_a * base.step_a));
    const auto across = static_cast<float>(kSharpening / (base.step_b * base.step_b));
    parallelFor(static_cast<std::size_t>(base.height), kTileRows, [&](std::size_t begin, std::size_t end) {
        for (auto q = static_cast<std::ptrdiff_t>(begin); q < static_cast<std::ptrdiff_t>(end); ++q) {
            const float* row = from + base.stride * q;
            float* out = to + base.stride * q;
            if (q == 0 || q + 1 == base.height) {
                std::fill(out, out + base.stride, 0.0f);
                continue;
            }
            out[0] = out[base.stride - 1] = 0;
            kernels.sharpen(row + 1, row + 1 - base.stride, row + 1 + base.stride, along, across, out + 1,
                            static_cast<int>(base.stride) - 2);
        }
    });
}

// Everything of a WarpRow that does not change from row to row.
WarpRow warpConstants(const BasePlane& base, const ProjectionGeometry& g, double scale, const float* image,
                      const float* image_w) {
    const SlabOrientation& o = *base.o;
    const Vector3 column = reorder(o, g.step_column), row = reorder(o, g.step_row), spacing = reorder(o, g.spacing_mm);
    const double per_a = base.distance / base.step_a, per_b = base.distance / base.step_b;
    const auto f = [](double v) { return static_cast<float>(v); };
    WarpRow w{};
    w.m_x = f(column.z());
    w.m_y = f(row.z());
    w.a_x = f(column.x() * per_a);
    w.a_y = f(row.x() * per_a);
    w.b_x = f(column.y() * per_b);
    w.b_y = f(row.y() * per_b);
    w.p_offset = f((base.source.x() - base.a0) / base.step_a);
    w.q_offset = f((base.source.y() - base.b0) / base.step_b);
    w.length_m = f(std::pow(spacing.z() * scale, 2));
    w.length_p = f(std::pow(spacing.x() * scale / per_a, 2));
    w.length_q = f(std::pow(spacing.y() * scale / per_b, 2));
    w.base = image;
    w.base_w = image_w;
    w.stride = base.stride;
    w.p_max = f(base.width - 3);
    w.q_max = f(base.height - 3);
    return w;
}

void setRow(WarpRow& w, const BasePlane& base, const ProjectionGeometry& g, double y) {
    const Vector3 ray = reorder(*base.o, g.detectorPoint(0, y) - g.source);
    w.m = static_cast<float>(ray.z());
    w.a = static_cast<float>(ray.x() * base.distance / base.step_a);
    w.b = static_cast<float>(ray.y() * base.distance / base.step_b);
}

std::array<GradientParameter, 6> gradientConstants(const BasePlane& base, const std::array<GeometryChange, 6>& changes,
                                                   double y) {
    const double per_a = base.distance / base.step_a, per_b = base.distance / base.step_b;
    std::array<GradientParameter, 6> result;
    for (std::size_t k = 0; k < 6; ++k) {
        const Vector3 source = reorder(*base.o, changes[k].source);
        const Vector3 corner = reorder(*base.o, changes[k].corner + y * changes[k].step_row);
        const Vector3 column = reorder(*base.o, changes[k].step_column), row = reorder(*base.o, changes[k].step_row);
        const auto f = [](double v) { return static_cast<float>(v); };
        result[k] = {f(source.x() / base.step_a),
                     f(-source.z() / base.distance),
                     f(source.y() / base.step_b),
                     f(-source.z() / base.distance),
                     f(corner.z()),
                     f(column.z()),
                     f(row.z()),
                     f(corner.x() * per_a),
                     f(column.x() * per_a),
                     f(row.x() * per_a),
                     f(corner.y() * per_b),
                     f(column.y() * per_b),
                     f(row.y() * per_b)};
    }
    return result;
}

// Where the samples of an image row lie: the pixel's mean is taken at two points per axis whose variance is that of the
// binning's pixel centres (for 2-fold binning they are the pixel centres).
struct Samples {
    std::vector<double> offset;
    explicit Samples(int binning) {
        const double half = std::sqrt((binning * binning - 1) / 12.0);
        if (binning == 1) {
            offset = {0};
        } else {
            offset = {-half, half};
        }
    }
};

template <class WarpOneRow>
void warpAll(const BasePlane& base, const ProjectionGeometry& g, double scale, int binning, const float* image,
             const float* image_w, const WarpOneRow& warp_row) {
    const int columns = g.columns / binning, rows = g.rows / binning;
    const WarpRow constants = warpConstants(base, g, scale, image, image_w);
    const Samples samples(binning);
    const double middle = 0.5 * (binning - 1);
    const float weight = 1.0f / static_cast<float>(samples.offset.size() * samples.offset.size());
    std::vector<std::vector<float>> x(samples.offset.size(), std::vector<float>(static_cast<std::size_t>(columns)));
    for (std::size_t s = 0; s < samples.offset.size(); ++s) {
        for (int i = 0; i < columns; ++i) {
            x[s][static_cast<std::size_t>(i)] = static_cast<float>(i * binning + middle + samples.offset[s]);
        }
    }
    parallelFor(static_cast<std::size_t>(rows), 8, [&](std::size_t begin, std::size_t end) {
        WarpRow w = constants;
        w.count = columns;
        std::vector<float> distorted_x, distorted_y;
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            for (const double offset_y : samples.offset) {
                const double at_y = y * binning + middle + offset_y;
                setRow(w, base, g, at_y);
                for (std::size_t s = 0; s < samples.offset.size(); ++s) {
                    w.x = x[s].data();
                    w.y = nullptr;
                    if (g.ideal_pixels) {
                        distorted_x.resize(static_cast<std::size_t>(columns));
                        distorted_y.resize(static_cast<std::size_t>(columns));
                        for (int i = 0; i < columns; ++i) {
                            const Eigen::Vector2f ideal = g.idealPixel(i, y);
                            distorted_x[static_cast<std::size_t>(i)] = ideal.x();
                            distorted_y[static_cast<std::size_t>(i)] = static_cast<float>(ideal.y() - at_y);
                        }
                        w.x = distorted_x.data();
                        w.y = distorted_y.data();
                    }
                    warp_row(w, y, at_y, weight);
                }
            }
        }
    });
}

}  // namespace

int nearestAxis(const ProjectionGeometry& geometry) {
    Eigen::Index axis = 0;
    (geometry.central - geometry.source).cwiseAbs().maxCoeff(&axis);
    return static_cast<int>(axis);
}

bool slabCanProject(const SlabVolume& volume, const ProjectionGeometry& g, int main_axis) {
    const double forward = g.central[main_axis] > g.source[main_axis] ? 1 : -1;
    for (const Vector2& corner : corners(g)) {
        const Vector3 ray = g.detectorPoint(corner.x(), corner.y()) - g.source;
        if (!(forward * ray[main_axis] > kLeastCosine * ray.norm())) return false;
    }
    // A ray ends at the detector, the sum over slices does not: the box of what is not air must lie before its plane.
    const Vector3 toward_source =
        g.step_column.cross(g.step_row) * (g.step_column.cross(g.step_row).dot(g.source - g.corner) > 0 ? 1 : -1);
    const auto [low, high] = volume.occupied();
    for (int c = 0; c < 8; ++c) {
        const Vector3 box_corner(c & 1 ? high.x() : low.x(), c & 2 ? high.y() : low.y(), c & 4 ? high.z() : low.z());
        if (!(toward_source.dot(box_corner - g.corner) >= 0)) return false;
    }
    return true;
}

Image projectSlab(const SlabVolume& volume, const ProjectionGeometry& g, int main_axis, double scale_per_hu,
                  int binning, const SlabKernels& kernels) {
    Image result(g.columns / binning, g.rows / binning);
    const BasePlane base = planBase(volume, g, main_axis, binning);
    if (base.empty()) return result;
    const std::size_t size = static_cast<std::size_t>(base.stride) * static_cast<std::size_t>(base.height);
    const AlignedArray<float> gathered(size), image(size);
    fillBase(base, kernels, gathered.get(), nullptr);
    sharpenBase(base, kernels, gathered.get(), image.get());
    const double scale = scale_per_hu * volume.huPerUnit() / (1 << 14);
    warpAll(base, g, scale, binning, image.get(), nullptr,
            [&](const WarpRow& w, int y, double, float weight) { kernels.warp(w, weight, result.row(y)); });
    return result;
}

Image projectSlabWithGradient(const SlabVolume& volume, const ProjectionGeometry& g, int main_axis, double scale_per_hu,
                              int binning, const std::array<GeometryChange, 6>& changes, const SlabKernels& kernels,
                              std::array<Image, 6>& gradient) {
    Image result(g.columns / binning, g.rows / binning);
    for (Image& derivative : gradient)
        derivative = Image(result.width(), result.height());
    const BasePlane base = planBase(volume, g, main_axis, binning);
    if (base.empty()) return result;
    const std::size_t size = static_cast<std::size_t>(base.stride) * static_cast<std::size_t>(base.height);
    const AlignedArray<float> gathered(size), gathered_w(size), image(size), image_w(size);
    fillBase(base, kernels, gathered.get(), gathered_w.get());
    sharpenBase(base, kernels, gathered.get(), image.get());
    sharpenBase(base, kernels, gathered_w.get(), image_w.get());
    const double scale = scale_per_hu * volume.huPerUnit() / (1 << 14);
    warpAll(base, g, scale, binning, image.get(), image_w.get(),
            [&](const WarpRow& w, int y, double at_y, float weight) {
                const std::array<GradientParameter, 6> parameters = gradientConstants(base, changes, at_y);
                std::array<float*, 6> rows;
                for (std::size_t k = 0; k < 6; ++k)
                    rows[k] = gradient[k].row(y);
                kernels.warpGradient(w, parameters.data(), weight, result.row(y), rows.data());
            });
    return result;
}

}  // namespace fluorocut
