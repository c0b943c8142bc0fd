#include "core/simulation/closed_form_projection.h"

#include <algorithm>
#include <cmath>
#include <limits>
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

  private:
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
    parallelFor(static_cast<std::size_t>(carm.rows), kRowsPerPiece, [&](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
            for (int x = 0; x < carm.columns; ++x) {
                image(x, y) = static_cast<float>(
                    meanOverPixel(carm, x, y, options.samples_per_axis, [&](const Vector3& direction) {
                        if (!direction.allFinite()) return std::numeric_limits<double>::quiet_NaN();
                        return rays.measure(source, plate_from_imager * direction) * direction.norm();
                    }));
            }
        }
    });
    return image;
}

}  // namespace fluorocut
