#include "core/imaging/mesh_projector.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "core/base/parallel.h"
#include "core/geometry/exact_sign.h"

namespace fluorocut {
namespace {

// Coordinates here: x and y of the imager frame are scaled by f / p_x and f / p_y, so that a point (x, y, z) is seen at
// the ideal pixel (x / z + c_x, y / z + c_y) and the ray through an ideal pixel has the direction (u - c_x, v - c_y,
// 1). A point z * direction of a ray has the depth z in mm.

constexpr double kSlack = 1e-6;                 // px: bounds are widened by it, far more than they are rounded
constexpr int kNarrowFrom = 6;                  // px: wider triangles have each row's span worked out
constexpr std::size_t kBandSamples = 8192;      // rays of one piece of parallel work
constexpr std::size_t kStripSamples = 1 << 22;  // rays held in memory at a time

std::size_t at(std::int32_t i) {
    return static_cast<std::size_t>(i);
}

// Which side of the plane through the source, a and b the ray through (dx, dy) passes; never 0 unless a, b and the
// source are in line (then no face with this edge is hit anyway).
int edgeSide(double dx, double dy, const Vector3& a, const Vector3& b) {
    if (const int side = exactTripleProductSign({dx, dy, 1}, a, b)) return side;
    if (const int side = exactProductDifferenceSign(a.y(), b.z(), a.z(), b.y())) return side;  // moved by e along u
    return exactProductDifferenceSign(a.z(), b.x(), a.x(), b.z());                             // moved by e^2 along v
}

struct Face {
    std::array<Vector3, 3> corners;
    std::array<Vector3, 3> edges;  // side * (corner i x corner i + 1): a ray hits when it is positive on all three
    double error = 0;              // bound of the rounding error of direction . edges[i]
    Vector3 normal;
    double normal_dot_corner = 0;
    double z_low = 0, z_high = 0;
    int side = 0;  // 1: rays leave the solid here, -1: they enter, 0: the face's plane holds the source

    // `reach` bounds |dx| and |dy|.
    Face(const Vector3& a, const Vector3& b, const Vector3& c, const Vector2& reach, double detector_z)
        : corners{a, b, c} {
        const Vector3 largest = a.cwiseAbs().cwiseMax(b.cwiseAbs()).cwiseMax(c.cwiseAbs());
        const double planes = kTripleProductError * largest.prod();
        edges = {a.cross(b), b.cross(c), c.cross(a)};
        const double determinant = edges[0].dot(c);
        side = determinant > planes ? 1 : determinant < -planes ? -1 : exactTripleProductSign(a, b, c);
        for (Vector3& edge : edges)
            edge *= side;
        error = kTripleProductError * std::max({reach.x() * largest.y() * largest.z(),
                                                reach.y() * largest.x() * largest.z(), largest.x() * largest.y()});
        normal = (b - a).cross(c - a);
        normal_dot_corner = normal.dot(a);
        const auto [low, high] = std::minmax({a.z(), b.z(), c.z()});
        z_low = std::clamp(low, 0.0, detector_z);
        z_high = std::clamp(high, 0.0, detector_z);
    }

    double edge(std::size_t i, double dx, double dy) const {
        return edges[i].x() * dx + edges[i].y() * dy + edges[i].z();
    }

    bool hit(double dx, double dy) const {
        const double least = std::min({edge(0, dx, dy), edge(1, dx, dy), edge(2, dx, dy)});
        if (least > error) return true;
        if (least < -error) return false;
        for (std::size_t i = 0; i < 3; ++i) {
            if (edgeSide(dx, dy, corners[i], corners[(i + 1) % 3]) != side) return false;
        }
        return true;
    }

    // Depth at which the ray crosses, cut to source and detector. Where the face is seen on edge rounding may do
    // anything to the quotient: it is kept within the face.
    double depth(double dx, double dy) const {
        const double z = normal_dot_corner / (normal.x() * dx + normal.y() * dy + normal.z());
        return z >= z_low ? std::min(z, z_high) : z_low;
    }
};

struct Bounds {
    double u_low, u_high, v_low, v_high;  // ideal pixels relative to the principal point: of dx and dy
};

// The rays of an undistorted image, row by row.
class RegularRays {
  public:
    explicit RegularRays(const CArm& carm)
        : columns_(carm.columns), rows_(carm.rows), center_(carm.principal_point_px) {}

    int rows() const { return rows_; }
    std::size_t firstSlot(int row) const { return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_); }
    std::size_t pixelOfSlot(std::size_t slot) const { return slot; }
    Vector2 direction(std::size_t slot) const {
        return Vector2(static_cast<double>(slot % static_cast<std::size_t>(columns_)),
                       static_cast<double>(slot / static_cast<std::size_t>(columns_))) -
               center_;
    }
    Vector2 reach() const {
        return Vector2(std::max(std::abs(center_.x()), std::abs(columns_ - center_.x())),
                       std::max(std::abs(center_.y()), std::abs(rows_ - center_.y())));
    }

    // Rows [first, second) whose rays may lie inside the bounds.
    std::pair<int, int> rowRange(const Bounds& bounds) const {
        if (first(bounds.u_low, center_.x(), columns_) > last(bounds.u_high, center_.x(), columns_)) return {0, 0};
        return {first(bounds.v_low, center_.y(), rows_), last(bounds.v_high, center_.y(), rows_) + 1};
    }

    template <class Use>
    void visitRow(int row, const Bounds& bounds, const Face& face, Use&& use) const {
        const double dy = row - center_.y();
        double low = bounds.u_low, high = bounds.u_high;
        if (high - low > kNarrowFrom) {
            for (std::size_t i = 0; i < 3; ++i) {
                const double slope = face.edges[i].x();
                if (!(std::abs(slope) * kSlack > 4 * face.error)) continue;  // rounding may move the crossing further
                const double crossing = -face.edge(i, 0, dy) / slope;
                if (slope > 0) low = std::max(low, crossing - kSlack);
                if (slope < 0) high = std::min(high, crossing + kSlack);
            }
        }
        const int end = last(high, center_.x(), columns_);
        for (int u = first(low, center_.x(), columns_); u <= end; ++u) {
            const double dx = u - center_.x();
            if (face.hit(dx, dy)) use(firstSlot(row) + static_cast<std::size_t>(u), face.depth(dx, dy));
        }
    }

  private:
    static int first(double low, double center, int size) {
        return static_cast<int>(std::clamp<double>(std::ceil(low + center - kSlack), 0, size));
    }
    static int last(double high, double center, int size) {
        return static_cast<int>(std::clamp<double>(std::floor(high + center + kSlack), -1, size - 1));
    }

    int columns_, rows_;
    Vector2 center_;
};

// The rays of a distorted image, sorted into a grid of cells in the ideal image so that those near a face are found
// quickly.
class ScatteredRays {
  public:
    explicit ScatteredRays(const CArm& carm) : columns_(carm.columns), rows_(carm.rows) {
        const std::size_t pixels = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);
        std::vector<Vector2> directions(pixels);
        parallelFor(static_cast<std::size_t>(rows_), 8, [&](std::size_t begin, std::size_t end) {
            const auto columns = static_cast<std::size_t>(columns_);
            for (std::size_t y = begin; y < end; ++y) {
                const std::span<Vector2> row(&directions[y * columns], columns);
                carm.idealRow(static_cast<int>(y), row);
                for (Vector2& direction : row)
                    direction -= carm.principal_point_px;
            }
        });
        Vector2 low = Vector2::Constant(std::numeric_limits<double>::infinity()), high = -low;
        for (const Vector2& d : directions) {
            if (!d.allFinite()) continue;
            low = low.cwiseMin(d);
            high = high.cwiseMax(d);
            reach_ = reach_.cwiseMax(d.cwiseAbs());
        }
        low_ = low;
        cell_ = ((high - low).array() / Eigen::Array2d(columns_, rows_)).max(kSlack).matrix();
        first_.assign(pixels + 1, 0);
        const auto cellOf = [&](const Vector2& d) {
            return static_cast<std::size_t>(cell(d.y(), 1)) * static_cast<std::size_t>(columns_) +
                   static_cast<std::size_t>(cell(d.x(), 0));
        };
        for (const Vector2& d : directions) {
            if (d.allFinite()) ++first_[cellOf(d) + 1];
        }
        for (std::size_t c = 1; c < first_.size(); ++c)
            first_[c] += first_[c - 1];
        rays_.resize(first_.back());
        std::vector<std::size_t> fill(first_.begin(), first_.end() - 1);
        for (std::size_t p = 0; p < pixels; ++p) {
            if (directions[p].allFinite()) rays_[fill[cellOf(directions[p])]++] = {directions[p], p};
        }
    }

    int rows() const { return rows_; }
    std::size_t firstSlot(int row) const {
        return first_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_)];
    }
    std::size_t pixelOfSlot(std::size_t slot) const { return rays_[slot].pixel; }
    const Vector2& direction(std::size_t slot) const { return rays_[slot].direction; }
    const Vector2& reach() const { return reach_; }

    std::pair<int, int> rowRange(const Bounds& bounds) const {
        if (rays_.empty() || !(bounds.u_high >= low_.x() - kSlack && bounds.v_high >= low_.y() - kSlack)) return {0, 0};
        return {cell(bounds.v_low - kSlack, 1), cell(bounds.v_high + kSlack, 1) + 1};
    }

    template <class Use>
    void visitRow(int row, const Bounds& bounds, const Face& face, Use&& use) const {
        const std::size_t start = static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_);
        const std::size_t end = first_[start + static_cast<std::size_t>(cell(bounds.u_high + kSlack, 0)) + 1];
        for (std::size_t slot = first_[start + static_cast<std::size_t>(cell(bounds.u_low - kSlack, 0))]; slot < end;
             ++slot) {
            const Vector2& d = rays_[slot].direction;
            if (face.hit(d.x(), d.y())) use(slot, face.depth(d.x(), d.y()));
        }
    }

  private:
    struct Ray {
        Vector2 direction;
        std::size_t pixel;
    };

  public:
    static constexpr std::size_t kBytesPerPixel = sizeof(Ray) + sizeof(std::size_t);

  private:
    int cell(double value, int axis) const {
        return static_cast<int>(
            std::clamp<double>(std::floor((value - low_[axis]) / cell_[axis]), 0, (axis == 0 ? columns_ : rows_) - 1));
    }

    int columns_, rows_;
    Vector2 low_, cell_;
    Vector2 reach_ = Vector2::Zero();
    std::vector<std::size_t> first_;  // rays of each cell, row by row
    std::vector<Ray> rays_;
};

// Path lengths of all rays, at their pixels of `lengths`, which is filled beforehand.
template <class Rays>
void projectFaces(const Rays& rays, const CArm& carm, const std::vector<Triangle>& triangles,
                  const std::vector<Vector3>& vertices, float* lengths) {
    // Where each triangle may be seen. One that reaches behind the source may be seen anywhere.
    constexpr double kAnywhere = std::numeric_limits<double>::infinity();
    std::vector<Bounds> bounds(triangles.size());
    std::vector<std::pair<int, int>> row_range(triangles.size());
    parallelFor(triangles.size(), 4096, [&](std::size_t begin, std::size_t end) {
        for (std::size_t f = begin; f < end; ++f) {
            const Vector3 *a = &vertices[at(triangles[f][0])], *b = &vertices[at(triangles[f][1])],
                          *c = &vertices[at(triangles[f][2])];
            const double z_low = std::min({a->z(), b->z(), c->z()}), z_high = std::max({a->z(), b->z(), c->z()});
            Bounds& box = bounds[f];
            if (!(z_high > 0)) continue;
            if (z_low > 0) {
                const auto [u_low, u_high] = std::minmax({a->x() / a->z(), b->x() / b->z(), c->x() / c->z()});
                const auto [v_low, v_high] = std::minmax({a->y() / a->z(), b->y() / b->z(), c->y() / c->z()});
                box = {u_low, u_high, v_low, v_high};
            } else {
                box = {-kAnywhere, kAnywhere, -kAnywhere, kAnywhere};
            }
            row_range[f] = rays.rowRange(box);
        }
    });

    // Bands of rows, each with its triangles in their order.
    const std::size_t slots = rays.firstSlot(rays.rows());
    const auto rows_per_band = static_cast<int>(std::clamp<std::size_t>(
        kBandSamples * static_cast<std::size_t>(rays.rows()) / std::max<std::size_t>(slots, 1), 1, 1 << 14));
    const auto band_count = static_cast<std::size_t>((rays.rows() + rows_per_band - 1) / rows_per_band);
    const auto bandsOf = [&](std::size_t f) {
        const auto [begin, end] = row_range[f];
        return begin < end ? std::pair(begin / rows_per_band, (end - 1) / rows_per_band) : std::pair(0, -1);
    };
    std::vector<std::size_t> first(band_count + 1, 0);
    for (std::size_t f = 0; f < triangles.size(); ++f) {
        const auto [low, high] = bandsOf(f);
        for (int band = low; band <= high; ++band)
            ++first[static_cast<std::size_t>(band) + 1];
    }
    for (std::size_t band = 1; band < first.size(); ++band)
        first[band] += first[band - 1];
    std::vector<std::uint32_t> in_band(first.back());
    std::vector<std::size_t> fill(first.begin(), first.end() - 1);
    for (std::size_t f = 0; f < triangles.size(); ++f) {
        const auto [low, high] = bandsOf(f);
        for (int band = low; band <= high; ++band)
            in_band[fill[static_cast<std::size_t>(band)]++] = static_cast<std::uint32_t>(f);
    }

    const Vector2 tangent = carm.pixel_mm / carm.focal_length_mm;
    parallelFor(band_count, 1, [&](std::size_t begin, std::size_t end) {
        std::vector<double> depths;
        for (std::size_t band = begin; band < end; ++band) {
            if (first[band] == first[band + 1]) continue;
            const int row_begin = static_cast<int>(band) * rows_per_band;
            const int row_end = std::min(row_begin + rows_per_band, rays.rows());
            const std::size_t slot_begin = rays.firstSlot(row_begin);
            depths.assign(rays.firstSlot(row_end) - slot_begin, 0);
            for (std::size_t n = first[band]; n < first[band + 1]; ++n) {
                const std::size_t f = in_band[n];
                const Face face(vertices[at(triangles[f][0])], vertices[at(triangles[f][1])],
                                vertices[at(triangles[f][2])], rays.reach(), carm.focal_length_mm);
                if (face.side == 0) continue;
                const int last_row = std::min(row_range[f].second, row_end);
                for (int row = std::max(row_range[f].first, row_begin); row < last_row; ++row) {
                    rays.visitRow(row, bounds[f], face,
                                  [&](std::size_t slot, double z) { depths[slot - slot_begin] += face.side * z; });
                }
            }
            for (std::size_t i = 0; i < depths.size(); ++i) {
                if (depths[i] == 0) continue;
                const Vector2 slope = rays.direction(slot_begin + i).cwiseProduct(tangent);
                const double length = depths[i] * std::sqrt(1 + slope.squaredNorm());
                // A ray that grazes an edge enters and leaves at one depth, but for rounding.
                lengths[rays.pixelOfSlot(slot_begin + i)] = std::abs(length) < 1e-9 ? 0 : static_cast<float>(length);
            }
        }
    });
}

CArm withFinerPixels(CArm carm, int factor) {
    carm.columns *= factor;
    carm.rows *= factor;
    carm.pixel_mm /= factor;
    carm.principal_point_px = ((carm.principal_point_px.array() + 0.5) * factor - 0.5).matrix();
    return carm;
}

// One ray through the centre of every pixel.
Image projectCenters(const CArm& carm, const Rigid3& imager_from_mesh, const TriangleMesh& mesh) {
    const Vector3 scale(carm.focal_length_mm / carm.pixel_mm.x(), carm.focal_length_mm / carm.pixel_mm.y(), 1);
    const Matrix3 rotation = scale.asDiagonal() * imager_from_mesh.rotationMatrix();
    const Vector3 translation = scale.cwiseProduct(imager_from_mesh.translation());
    std::vector<Vector3> vertices(mesh.vertices.size());
    parallelFor(vertices.size(), 8192, [&](std::size_t begin, std::size_t end) {
        for (std::size_t v = begin; v < end; ++v)
            vertices[v] = rotation * mesh.vertices[v] + translation;
    });
    if (!carm.distortion) {
        Image image(carm.columns, carm.rows);
        projectFaces(RegularRays(carm), carm, mesh.triangles, vertices, image.pixels().data());
        return image;
    }
    const std::size_t pixels = static_cast<std::size_t>(carm.columns) * static_cast<std::size_t>(carm.rows);
    const auto known =
        carm.distortion->cache().get<ScatteredRays>(carm.pixelGrid(), pixels * ScatteredRays::kBytesPerPixel,
                                                    [&] { return std::make_shared<const ScatteredRays>(carm); });
    const ScatteredRays& rays = *known;
    Image image(carm.columns, carm.rows, std::numeric_limits<float>::quiet_NaN());
    for (std::size_t slot = 0; slot < rays.firstSlot(rays.rows()); ++slot)
        image.pixels()[rays.pixelOfSlot(slot)] = 0;
    projectFaces(rays, carm, mesh.triangles, vertices, image.pixels().data());
    return image;
}

}  // namespace

Result<void> MeshProjectionOptions::validate() const {
    if (samples_per_axis >= 1 && samples_per_axis <= 16) return {};
    return invalidOption("samples_per_axis", fmt::format("{}", samples_per_axis), "1 to 16");
}

MeshProjector::MeshProjector(TriangleMesh mesh, const MeshProperties& properties)
    : mesh_(std::move(mesh)), properties_(properties) {}

Result<MeshProjector> MeshProjector::prepare(TriangleMesh mesh, const std::string& where) {
    const MeshProperties properties = meshProperties(mesh);
    if (const Result<void> solid = requireSolid(properties, where); !solid) return solid.error();
    return MeshProjector(std::move(mesh), properties);
}

Image MeshProjector::project(const CArm& carm, const Rigid3& imager_from_mesh,
                             const MeshProjectionOptions& options) const {
    for (const Result<void>& valid : {carm.validate(), options.validate()}) {
        if (!valid) throw std::logic_error("MeshProjector: " + valid.error().message());
    }
    const int samples = options.samples_per_axis;
    const std::size_t samples_per_row =
        static_cast<std::size_t>(carm.columns) * static_cast<std::size_t>(samples * samples);
    const int strip_rows = static_cast<int>(std::max<std::size_t>(kStripSamples / samples_per_row, 1));
    if (samples == 1 && carm.rows <= strip_rows) return projectCenters(carm, imager_from_mesh, mesh_);

    Image image(carm.columns, carm.rows);
    for (int top = 0; top < carm.rows; top += strip_rows) {
        const int rows = std::min(strip_rows, carm.rows - top);
        const Image fine =
            projectCenters(withFinerPixels(carm.cropped(0, top, carm.columns, rows), samples), imager_from_mesh, mesh_);
        parallelFor(static_cast<std::size_t>(rows), 16, [&](std::size_t begin, std::size_t end) {
            for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
                for (int x = 0; x < carm.columns; ++x) {
                    double sum = 0;
                    for (int j = 0; j < samples; ++j) {
                        const float* row = fine.row(y * samples + j) + x * samples;
                        for (int i = 0; i < samples; ++i)
                            sum += row[i];
                    }
                    image(x, top + y) = static_cast<float>(sum / (samples * samples));
                }
            }
        });
    }
    return image;
}

}  // namespace fluorocut
