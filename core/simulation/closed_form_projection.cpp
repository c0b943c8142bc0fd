#include "core/simulation/closed_form_projection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "core/base/parallel.h"

namespace fluorocut {
namespace {

constexpr std::size_t kRowsPerPiece = 4;

void requireValid(const CArm& carm, const MeshProjectionOptions& options) {
    for (const Result<void>& valid : {carm.validate(), options.validate()}) {
        if (!valid) throw std::logic_error("closed-form projection: " + valid.error().message());
    }
}

// The middle of the n-th of `samples` strips of a pixel.
double strip(int n, int samples) {
    return (n + 0.5) / samples - 0.5;
}

// Mean over samples x samples rays through a pixel of lengthOf(direction), direction from the source to the detector in
// the imager frame; NaN where the distortion has no answer.
template <class LengthOf>
double meanOverPixel(const CArm& carm, int x, int y, int samples, const LengthOf& lengthOf) {
    double sum = 0;
    for (int j = 0; j < samples; ++j)
        for (int i = 0; i < samples; ++i)
            sum += lengthOf(carm.detectorPoint({x + strip(i, samples), y + strip(j, samples)}));
    return sum / (samples * samples);
}

// The part [begin, end] of a ray origin + t * direction.
struct Span {
    double begin, end;
    double length() const { return std::max(0.0, end - begin); }

    // The part with low <= origin + t * direction <= high along one axis.
    Span clipped(double origin, double direction, double low, double high) const {
        if (direction == 0) return origin >= low && origin <= high ? *this : Span{0, 0};
        double enter = (low - origin) / direction, leave = (high - origin) / direction;
        if (enter > leave) std::swap(enter, leave);
        return {std::max(begin, enter), std::min(end, leave)};
    }
};

template <class Point>
using Quad = std::array<Point, 4>;  // in the order around it

class PlateRays {
  public:
    PlateRays(const GroovedPlate& plate, PlateFacing facing)
        : extent_(plateExtent(plate, facing)),
          pitch_(plate.pitch_mm),
          rise_(0.5 * (plate.pitch_mm - plate.groove_width_mm)),
          fall_(0.5 * (plate.pitch_mm + plate.groove_width_mm)) {}

    // Of t with origin + t * direction, t >= 0, in the plate's material.
    double measure(const Vector3& origin, const Vector3& direction) const {
        Span inside{0, std::numeric_limits<double>::infinity()};
        for (Eigen::Index axis = 0; axis < 2; ++axis)
            inside = inside.clipped(origin[axis], direction[axis], extent_.low[axis], extent_.high[axis]);
        if (!(inside.length() > 0)) return 0;
        const auto layer = [&](double a, double b) {
            return inside.clipped(origin.z(), direction.z(), std::min(a, b), std::max(a, b));
        };
        return layer(extent_.z_floor, extent_.z_back).length() +
               onLands(origin, direction, layer(extent_.z_land, extent_.z_floor));
    }

    // Mean over a pixel of the length in the plate (mm), from its middle ray and its corner rays, all from the source
    // toward the detector in the plate's frame. nullopt: they cross the plate too obliquely.
    std::optional<double> mean(const Vector3& origin, const Vector3& middle, const Quad<Vector3>& corners) const {
        const double heights[] = {extent_.z_land, extent_.z_floor, extent_.z_back};
        for (const Vector3& direction : corners) {
            const double across = direction.head<2>().norm() * std::abs(extent_.z_floor - extent_.z_land);
            if (!(across < 0.5 * pitch_ * std::abs(direction.z()))) return std::nullopt;
            for (const double z : heights) {
                if (!((z - origin.z()) * direction.z() > 0)) return std::nullopt;  // not in front of the source
            }
        }
        const auto at = [&](double z) {
            Quad<Vector2> quad;
            for (std::size_t n = 0; n < 4; ++n) {
                const double t = (z - origin.z()) / corners[n].z();
                quad[n] = origin.head<2>() + t * corners[n].head<2>();
            }
            return quad;
        };
        const Quad<Vector2> first = at(extent_.z_land), last = at(extent_.z_floor);
        const double depth = std::abs(extent_.z_floor - extent_.z_land);
        // How many planes: by how far the pixel wanders between a layer's sides, in parts of its own size.
        const double size = std::min((first[1] - first[0]).norm(), (first[3] - first[0]).norm());
        const double wander = ((last[0] + last[2]) - (first[0] + first[2])).norm() / (2 * size);
        const auto meanOver = [&](double z, double to_z, const auto& fraction) {
            const int planes = 2 + static_cast<int>(std::min(4 * wander * std::abs(to_z - z) / depth, 64.0));
            double sum = 0;
            for (int n = 0; n < planes; ++n)
                sum += fraction(at(z + (n + 0.5) / planes * (to_z - z)));
            return sum / planes;
        };
        const double on_lands =
            meanOver(extent_.z_land, extent_.z_floor, [&](const Quad<Vector2>& quad) { return landFraction(quad); });
        double below = 1;
        if (!isInside(last) || !isInside(at(extent_.z_back))) {
            below = meanOver(extent_.z_floor, extent_.z_back, [&](const Quad<Vector2>& quad) {
                return fractionInside(quad, extent_.low, extent_.high);
            });
        }
        return (depth * on_lands + std::abs(extent_.z_back - extent_.z_floor) * below) * middle.norm() /
               std::abs(middle.z());
    }

  private:
    static double area(const Vector2* corners, int count) {
        double twice = 0;
        for (int n = 0; n < count; ++n) {
            const Vector2 &a = corners[n], &b = corners[(n + 1) % count];
            twice += a.x() * b.y() - a.y() * b.x();
        }
        return 0.5 * std::abs(twice);
    }

    bool isInside(const Quad<Vector2>& quad) const {
        return std::all_of(quad.begin(), quad.end(), [&](const Vector2& corner) {
            return (corner.array() >= extent_.low.array()).all() && (corner.array() <= extent_.high.array()).all();
        });
    }

    // The part of a convex quadrangle's area inside a rectangle (Sutherland and Hodgman 1974).
    static double fractionInside(const Quad<Vector2>& quad, const Vector2& low, const Vector2& high) {
        Vector2 corners[12], cut[12];
        std::copy(quad.begin(), quad.end(), corners);
        int count = 4;
        for (const Eigen::Index axis : {0, 1}) {
            for (const double side : {-1.0, 1.0}) {
                const double limit = side < 0 ? -low[axis] : high[axis];
                int kept = 0;
                for (int n = 0; n < count; ++n) {
                    const Vector2 &a = corners[n], &b = corners[(n + 1) % count];
                    const double in_a = limit - side * a[axis], in_b = limit - side * b[axis];
                    if (in_a >= 0) cut[kept++] = a;
                    if ((in_a >= 0) != (in_b >= 0)) cut[kept++] = a + in_a / (in_a - in_b) * (b - a);
                }
                count = kept;
                std::copy(cut, cut + count, corners);
            }
        }
        return area(corners, count) / area(quad.data(), 4);
    }

    double landFraction(const Quad<Vector2>& quad) const {
        Vector2 low = quad[0], high = quad[0];
        for (const Vector2& corner : quad) {
            low = low.cwiseMin(corner);
            high = high.cwiseMax(corner);
        }
        int from[2], to[2];
        for (const Eigen::Index axis : {0, 1}) {
            const int lands = 2 * extent_.grooves[static_cast<std::size_t>(axis)];
            if (!(high[axis] > extent_.low[axis] && low[axis] < extent_.high[axis])) return 0;
            from[axis] = std::max(wallsBelow(axis, std::max(low[axis], extent_.low[axis])), 0);
            to[axis] = std::min(wallsBelow(axis, std::min(high[axis], extent_.high[axis])), lands);
        }
        if (isInside(quad) && from[0] == to[0] && from[1] == to[1]) return from[0] % 2 == 0 && from[1] % 2 == 0 ? 1 : 0;
        double sum = 0;
        for (int j = from[1] + from[1] % 2; j <= to[1]; j += 2)
            for (int i = from[0] + from[0] % 2; i <= to[0]; i += 2)
                sum += fractionInside(quad, {landBegin(0, i), landBegin(1, j)}, {landEnd(0, i), landEnd(1, j)});
        return sum;
    }
    double landBegin(Eigen::Index axis, int n) const { return n == 0 ? extent_.low[axis] : wall(axis, n - 1); }
    double landEnd(Eigen::Index axis, int n) const {
        return n == 2 * extent_.grooves[static_cast<std::size_t>(axis)] ? extent_.high[axis] : wall(axis, n);
    }

    // Groove walls below `place` along one axis, counted from the rim: odd in a groove, even on a land.
    int wallsBelow(Eigen::Index axis, double place) const {
        const double from_rim = place - extent_.low[axis];
        const double period = std::floor(from_rim / pitch_);
        const double rest = from_rim - period * pitch_;
        return 2 * static_cast<int>(period) + (rest >= rise_) + (rest >= fall_);
    }
    double wall(Eigen::Index axis, int n) const {
        const int period = n >= 0 ? n / 2 : (n - 1) / 2;
        return extent_.low[axis] + period * pitch_ + (n - 2 * period == 0 ? rise_ : fall_);
    }

    double onLands(const Vector3& origin, const Vector3& direction, const Span& span) const {
        if (!(span.length() > 0)) return 0;
        int at[2], to[2];
        for (Eigen::Index axis = 0; axis < 2; ++axis) {
            at[axis] = wallsBelow(axis, origin[axis] + span.begin * direction[axis]);
            to[axis] = wallsBelow(axis, origin[axis] + span.end * direction[axis]);
        }
        const auto onLand = [&] { return at[0] % 2 == 0 && at[1] % 2 == 0; };
        double sum = 0, begin = span.begin;
        while (at[0] != to[0] || at[1] != to[1]) {
            // The next wall along either axis; rounding may not lead back.
            double next = span.end;
            Eigen::Index crossed = at[0] != to[0] ? 0 : 1;
            for (Eigen::Index axis = 0; axis < 2; ++axis) {
                if (at[axis] == to[axis]) continue;
                const int n = at[axis] < to[axis] ? at[axis] : at[axis] - 1;
                const double t = (wall(axis, n) - origin[axis]) / direction[axis];
                if (t < next) {
                    next = t;
                    crossed = axis;
                }
            }
            next = std::clamp(next, begin, span.end);
            if (onLand()) sum += next - begin;
            begin = next;
            at[crossed] += at[crossed] < to[crossed] ? 1 : -1;
        }
        return onLand() ? sum + span.end - begin : sum;
    }

    PlateExtent extent_;
    double pitch_, rise_, fall_;  // within a period, from the rim: where a groove begins and ends
};

struct Sphere {
    Vector3 center;  // in the imager frame
    double radius;
    int x_begin, x_end, y_begin, y_end;  // pixels that may show it
};

// Smallest and largest x / z (or y / z) of a sphere in front of the source.
std::pair<double, double> slopes(double across, double depth, double radius) {
    const double middle = std::atan2(across, depth), half = std::asin(radius / std::hypot(across, depth));
    return {std::tan(middle - half), std::tan(middle + half)};
}

// Generous: pixels are sorted out one by one later.
Sphere placed(const Bead& bead, const CArm& carm, const Rigid3& imager_from_layout) {
    Sphere sphere{imager_from_layout * bead.center_mm, 0.5 * bead.diameter_mm, 0, carm.columns, 0, carm.rows};
    if (sphere.center.z() + sphere.radius <= 0) sphere.x_end = 0;  // behind the source
    if (sphere.center.z() <= sphere.radius) return sphere;         // may be seen anywhere
    const auto [left, right] = slopes(sphere.center.x(), sphere.center.z(), sphere.radius);
    const auto [top, bottom] = slopes(sphere.center.y(), sphere.center.z(), sphere.radius);
    Vector2 low = Vector2::Constant(std::numeric_limits<double>::infinity()), high = -low;
    for (const double s : {left, 0.5 * (left + right), right}) {
        for (const double t : {top, 0.5 * (top + bottom), bottom}) {
            const Vector2 pixel = carm.project({s, t, 1});
            if (!pixel.allFinite()) return sphere;  // partly outside the distortion's field
            low = low.cwiseMin(pixel);
            high = high.cwiseMax(pixel);
        }
    }
    // Between the nine points a distortion bends the box's sides by far less than a tenth of it.
    const Vector2 margin = Vector2::Constant(2) + 0.1 * (high - low);
    const auto within = [](double value, int size) { return static_cast<int>(std::clamp<double>(value, 0, size)); };
    sphere.x_begin = within(std::floor(low.x() - margin.x()), carm.columns);
    sphere.x_end = within(std::ceil(high.x() + margin.x()) + 1, carm.columns);
    sphere.y_begin = within(std::floor(low.y() - margin.y()), carm.rows);
    sphere.y_end = within(std::ceil(high.y() + margin.y()) + 1, carm.rows);
    return sphere;
}

double chord(const Sphere& sphere, const Vector3& direction) {
    const double squared = direction.squaredNorm();
    const double nearest = direction.dot(sphere.center) / squared;  // t of the point nearest to the centre
    const double half_squared =
        (sphere.radius * sphere.radius - (sphere.center - nearest * direction).squaredNorm()) / squared;
    if (std::isnan(half_squared)) return half_squared;
    if (!(half_squared > 0)) return 0;
    const double half = std::sqrt(half_squared);
    return Span{std::max(0.0, nearest - half), std::min(1.0, nearest + half)}.length() * std::sqrt(squared);
}

// Whether the sphere's outline may pass through the pixel: its middle is within a pixel's diagonal, as seen at the
// sphere's depth, of the outline.
bool nearOutline(const Sphere& sphere, const CArm& carm, const Vector3& direction) {
    const double distance =
        direction.cross(sphere.center).norm() / direction.norm();  // of the ray from the sphere's centre
    const double pixel = carm.pixel_mm.norm() * sphere.center.z() / carm.focal_length_mm;
    return !(std::abs(distance - sphere.radius) > 2 * pixel);
}

}  // namespace

Image spherePathLengths(const BeadLayout& layout, const CArm& carm, const Rigid3& imager_from_layout,
                        const MeshProjectionOptions& options) {
    requireValid(carm, options);
    std::vector<Sphere> spheres;
    for (const Bead& bead : layout.beads)
        spheres.push_back(placed(bead, carm, imager_from_layout));
    const int fine = std::max(options.samples_per_axis, kRimSamples);
    Image image(carm.columns, carm.rows);
    parallelFor(static_cast<std::size_t>(carm.rows), kRowsPerPiece, [&](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            float* row = image.row(y);
            if (carm.distortion) {  // a place that it cannot tell
                for (int x = 0; x < carm.columns; ++x)
                    if (!carm.idealPixel(Vector2(x, y)).allFinite()) row[x] = std::numeric_limits<float>::quiet_NaN();
            }
            for (const Sphere& sphere : spheres) {
                if (y < sphere.y_begin || y >= sphere.y_end) continue;
                for (int x = sphere.x_begin; x < sphere.x_end; ++x) {
                    const Vector3 middle = carm.detectorPoint(Vector2(x, y));
                    if (!middle.allFinite()) continue;
                    const int samples = nearOutline(sphere, carm, middle) ? fine : options.samples_per_axis;
                    row[x] += static_cast<float>(meanOverPixel(
                        carm, x, y, samples, [&](const Vector3& direction) { return chord(sphere, direction); }));
                }
            }
        }
    });
    return image;
}

Image platePathLengths(const GroovedPlate& plate, PlateFacing facing, const CArm& carm, const Rigid3& imager_from_plate,
                       const MeshProjectionOptions& options) {
    requireValid(carm, options);
    if (const Result<void> good = plate.validate(); !good) throw std::logic_error(good.error().message());
    const PlateRays rays(plate, facing);
    const Vector3 source = imager_from_plate.inverse().translation();
    const Matrix3 plate_from_imager = imager_from_plate.rotationMatrix().transpose();
    Image image(carm.columns, carm.rows);
    const auto sampled = [&](int x, int y) {
        return meanOverPixel(carm, x, y, options.samples_per_axis, [&](const Vector3& direction) {
            if (!direction.allFinite()) return std::numeric_limits<double>::quiet_NaN();
            return rays.measure(source, plate_from_imager * direction) * direction.norm();
        });
    };
    const auto cornerRow = [&](int y, std::vector<Vector3>& row) {
        row.clear();
        for (int x = 0; x <= carm.columns; ++x)
            row.push_back(plate_from_imager * carm.detectorPoint({x - 0.5, y - 0.5}));
    };
    parallelFor(static_cast<std::size_t>(carm.rows), 4 * kRowsPerPiece, [&](std::size_t begin, std::size_t end) {
        const bool averaged = options.samples_per_axis > 1;
        std::vector<Vector3> above, below;  // corner rays of a row of pixels
        if (averaged) cornerRow(static_cast<int>(begin), below);
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            if (averaged) {
                std::swap(above, below);
                cornerRow(y + 1, below);
            }
            for (int x = 0; x < carm.columns; ++x) {
                const auto n = static_cast<std::size_t>(x);
                std::optional<double> mean;
                if (averaged) {
                    const Quad<Vector3> corners{above[n], above[n + 1], below[n + 1], below[n]};
                    mean = rays.mean(source, 0.25 * (corners[0] + corners[1] + corners[2] + corners[3]), corners);
                }
                image(x, y) = static_cast<float>(mean ? *mean : sampled(x, y));
            }
        }
    });
    return image;
}

}  // namespace fluorocut
