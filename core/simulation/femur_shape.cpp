#include "core/simulation/femur_shape.h"

#include <limits>

#include <fmt/format.h>

#include "core/simulation/implicit.h"

namespace fluorocut {

using namespace implicit;

// Adjusted on the surface of one real left femur (adult, head of 45.8 mm, offset 49 mm), then rounded. With dimensions
// and pose fitted, that surface lies 0.9 mm rms from this one (95 % within 1.8 mm, worst 4.6); another real femur,
// which had no part in it, 1.7 mm rms (median 1.0, 95 % within 3.1, worst 9.5).
const FemurProportions kTypicalFemur{
    .shaft = {{{-200, 0.0, -1.0, 14.5, 14.0},
               {-60, 0.0, -1.0, 14.0, 12.6},
               {-30, -0.7, -0.2, 15.0, 13.3},
               {-15, -0.4, 0.2, 14.9, 13.0},
               {0, 0.9, 0.6, 15.2, 12.4},
               {15, 1.3, -1.4, 17.3, 14.2},
               {30, 1.8, -7.6, 19.9, 15.2},
               {45, 2.7, -5.7, 15.7, 14.2}}},
    .shaft_top = 42.8,
    .shaft_top_blend = 14,
    .neck_in_plane = {23.6, 13.7, 14.9},
    .neck_across = {10.7, 11.1, 16.4},
    .neck_base_shift = -7.3,
    .neck_forward = 4.5,
    .greater = {11.9, -2.7, 35.2, 10.0, 15.4, 21.0, 0.41, -0.17},
    .horn = {5.8, 0.0, 52.1, 5.4, 13.3, 9.5, 0.25, -0.35},
    .lesser = {-15.0, 12.6, -0.6, 15.8, 8.0, 12.2, -0.48, 0.22},
    .fossa = {-8.9, 5.6, 45.3, 8.1, 9.3, 10.2, 0.05, -0.01},
    .crest = {3.8, 10.8, 32.6, -11.5, 11.2, 5.6, 6.4, 5.2},
    .front_line = {-20.4, -11.3, 15.2, 3.4, -19.9, 43.3, 5.7, 7.5},
    .neck_blend = 15.5,
    .head_blend = 7,
    .greater_blend = 10,
    .lesser_blend = 7.7,
    .bar_blend = 11.8,
    .fossa_blend = 6.5,
};

namespace {

constexpr double kTableFirst = -260, kTableStep = 0.5;
constexpr int kTableCount = 720;

Matrix3 blobAxes(const FemurProportions::Blob& blob) {
    return (Eigen::AngleAxisd(blob.yaw, Vector3::UnitZ()) * Eigen::AngleAxisd(blob.tilt, Vector3::UnitY()))
        .toRotationMatrix()
        .transpose();
}

double blob(const Vector3& q, const FemurProportions::Blob& b, const Matrix3& axes) {
    return ellipsoid(q, {b.x, b.y, b.z}, {b.half_x, b.half_y, b.half_z}, axes);
}

double bar(const Vector3& q, const FemurProportions::Bar& b) {
    return roundCone(q, {b.ax, b.ay, b.az}, {b.bx, b.by, b.bz}, b.ra, b.rb);
}

// Cubic Hermite interpolation with finite-difference slopes, constant beyond the ends.
template <class Value>
double interpolate(const std::array<FemurProportions::Section, FemurProportions::kShaftKnots>& knots, double z,
                   const Value& value) {
    const int last = FemurProportions::kShaftKnots - 1;
    const auto at = [&](int i) -> const FemurProportions::Section& { return knots[static_cast<std::size_t>(i)]; };
    if (z <= at(0).z) return value(at(0));
    if (z >= at(last).z) return value(at(last));
    int i = 0;
    while (z > at(i + 1).z)
        ++i;
    const auto slope = [&](int n) {
        if (n == 0 || n == last) return 0.0;
        return (value(at(n + 1)) - value(at(n - 1))) / (at(n + 1).z - at(n - 1).z);
    };
    const double h = at(i + 1).z - at(i).z, t = (z - at(i).z) / h;
    const double t2 = t * t, t3 = t2 * t;
    return (2 * t3 - 3 * t2 + 1) * value(at(i)) + (t3 - 2 * t2 + t) * h * slope(i) +
           (3 * t2 - 2 * t3) * value(at(i + 1)) + (t3 - t2) * h * slope(i + 1);
}

}  // namespace

FemurShape::FemurShape(const FemurDimensions& dimensions, const FemurProportions& proportions)
    : dimensions_(dimensions),
      parts_(proportions),
      scale_(dimensions.head_diameter_mm / 46),
      radius_(0.5 * dimensions.head_diameter_mm) {
    // The neck's axis runs in the plane turned forward by the anteversion, at the neck-shaft angle from the distal
    // shaft.
    const double medial = std::sin(dimensions.neck_shaft_angle_rad), up = -std::cos(dimensions.neck_shaft_angle_rad);
    const Vector3 outward(-std::cos(dimensions.anteversion_rad), -std::sin(dimensions.anteversion_rad), 0);
    neck_ = medial * outward + Vector3(0, 0, up);
    neck_length_ = dimensions.femoral_offset_mm / medial;
    neck_base_ = Vector3(0, -scale_ * parts_.neck_forward, dimensions.neck_base_mm);
    head_ = neck_base_ + neck_length_ * neck_;
    neck_side_ = (Vector3::UnitZ() - up * neck_).normalized();
    neck_across_ = neck_.cross(neck_side_);
    bow_ = scale_ / (2 * dimensions.bow_radius_mm);

    greater_axes_ = blobAxes(parts_.greater);
    horn_axes_ = blobAxes(parts_.horn);
    lesser_axes_ = blobAxes(parts_.lesser);
    fossa_axes_ = blobAxes(parts_.fossa);
    for (int n = 0; n < kTableCount; ++n) {
        const double z = kTableFirst + n * kTableStep;
        using S = FemurProportions::Section;
        table_.push_back({interpolate(parts_.shaft, z, [](const S& s) { return s.x; }),
                          interpolate(parts_.shaft, z, [](const S& s) { return s.y; }),
                          interpolate(parts_.shaft, z, [](const S& s) { return s.half_x; }),
                          interpolate(parts_.shaft, z, [](const S& s) { return s.half_y; })});
    }
}

FemurShape::Section FemurShape::section(double z) const {
    const double at = std::clamp((z - kTableFirst) / kTableStep, 0.0, kTableCount - 1.001);
    const auto i = static_cast<std::size_t>(at);
    const double t = at - static_cast<double>(i);
    const Section &a = table_[i], &b = table_[i + 1];
    const double bow = z < 0 ? bow_ * z * z : 0;
    return {a.x + t * (b.x - a.x), a.y + t * (b.y - a.y) + bow, a.half_x + t * (b.half_x - a.half_x),
            a.half_y + t * (b.half_y - a.half_y)};
}

Vector3 FemurShape::shaftAxis(double z) const {
    const Section s = section(z / scale_);
    return {scale_ * s.x, scale_ * s.y, z};
}

double FemurShape::shaft(const Vector3& q) const {
    const Section s = section(q.z());
    double f = ellipse(q.x() - s.x, q.y() - s.y, s.half_x, s.half_y);
    // Linea aspera: a rounded ridge along the back, strongest in the middle third.
    const double strength = smoothStep(-15, -70, q.z());
    if (strength > 0) {
        const double ridge = std::hypot(q.x() - s.x + 1.5, q.y() - s.y - s.half_y + 1.2) - 2.6;
        f = smoothUnion(f, ridge + 4 * (1 - strength), 5);
    }
    return smoothIntersection(f, q.z() - parts_.shaft_top, parts_.shaft_top_blend);
}

double FemurShape::neck(const Vector3& q) const {
    const Vector3 d = q - neck_base_ / scale_;
    const double length = neck_length_ / scale_;
    const double u = d.dot(neck_) / length;
    const double t = std::clamp(u, 0.0, 1.0);
    // Quadratic through base, middle, head.
    const double b = (1 - t) * (1 - 2 * t), m = 4 * t * (1 - t), h = t * (2 * t - 1);
    const double half_side = b * parts_.neck_in_plane[0] + m * parts_.neck_in_plane[1] + h * parts_.neck_in_plane[2];
    const double half_across = b * parts_.neck_across[0] + m * parts_.neck_across[1] + h * parts_.neck_across[2];
    const double shift = parts_.neck_base_shift * (t < 0.5 ? (1 - 2 * t) * (1 - 2 * t) : 0);
    const double f = ellipse(d.dot(neck_side_) - shift, d.dot(neck_across_), half_side, half_across);
    return smoothIntersection(f, std::max(u - 1, -u) * length, 6);
}

double FemurShape::body(const Vector3& q) const {
    double f = smoothUnion(shaft(q), neck(q), parts_.neck_blend);
    f = smoothUnion(f, blob(q, parts_.greater, greater_axes_), parts_.greater_blend);
    f = smoothUnion(f, blob(q, parts_.horn, horn_axes_), parts_.greater_blend);
    f = smoothUnion(f, bar(q, parts_.crest), parts_.bar_blend);
    f = smoothUnion(f, bar(q, parts_.front_line), parts_.bar_blend);
    f = smoothSubtraction(f, blob(q, parts_.fossa, fossa_axes_), parts_.fossa_blend);
    f = smoothUnion(f, sphere(q, head_ / scale_, radius_ / scale_), parts_.head_blend);
    // Fovea: a shallow pit where the ligament of the head enters, a little below and behind the pole.
    const Vector3 pit = head_ / scale_ + 25.5 * (neck_ - 0.25 * neck_side_ + 0.1 * neck_across_).normalized();
    return smoothSubtraction(f, sphere(q, pit, 5.0), 2);
}

FemurShape::Walls FemurShape::walls(const Vector3& p) const {
    const Vector3 q = p / scale_;
    const double main = body(q);
    const double knob = blob(q, parts_.lesser, lesser_axes_);
    const double outer = smoothUnion(main, knob, parts_.lesser_blend);
    // Under the knob the shaft's cortex is thin, a septum (the calcar femorale) rather than a wall.
    const double under = smoothStep(3, -3, knob);
    double inner = scale_ * main + cortex(p) * (1 - 0.6 * under);
    if (outer < main - 1e-6) {
        const double shell = 1.2;
        inner = std::min(inner, scale_ * std::max(outer + shell, 0.6 - main));
    }
    return {scale_ * outer, inner};
}

double FemurShape::cortex(const Vector3& p) const {
    const Vector3 q = p / scale_;
    // Thick shaft, thinning from 45 mm below the lesser trochanter to the flare, thin shell above.
    const double z = q.z();
    double t = cortex_flare_ + (cortex_isthmus_ - cortex_flare_) * smoothStep(flareLevel() / scale_, -45, z);
    const double shell = 1.0 * scale_;
    t += (shell - t) * smoothStep(flareLevel() / scale_ + 2, 42, z);
    // The front is thinner than the sides (Noble 1988: canal 12.3 mm wide, 16.9 mm deep at the isthmus).
    const Section s = section(z);
    const double front = std::clamp(-(q.y() - s.y) / s.half_y, 0.0, 1.0);
    t *= 1 - 0.22 * front * front;
    // Calcar: the lower wall of the neck is a continuation of the medial cortex.
    const Vector3 d = q - neck_base_ / scale_;
    const double u = d.dot(neck_) * scale_ / neck_length_;
    const double below = -d.dot(neck_side_);
    const double calcar = smoothStep(4, 11, below) * smoothStep(0.95, 0.35, u) * smoothStep(-0.1, 0.15, u);
    t += calcar * std::max(0.0, 2.6 * scale_ - t);
    // Subchondral bone of the head.
    const double in_head = smoothStep(3, -3, (q - head_ / scale_).norm() - radius_ / scale_);
    return t + in_head * std::min(0.0, shell - t);
}

double FemurShape::width(double z, bool canal) const {
    // Rows 2 mm apart: the extreme of a smooth outline is flat, half a row off costs less than 0.04 mm.
    double low = std::numeric_limits<double>::infinity(), high = -low;
    constexpr double kStep = 1;
    for (double y = -36 * scale_; y <= 36 * scale_; y += 2) {
        double before = 1;
        for (double x = -70 * scale_; x <= 50 * scale_; x += kStep) {
            const Vector3 p(x, y, z);
            // The canal is that of the shaft: the lesser trochanter is no part of it.
            const double f = canal ? scale_ * body(p / scale_) + cortex(p) : outer(p);
            if ((f < 0) != (before < 0)) {
                const double crossing = x - kStep * f / (f - before);
                low = std::min(low, crossing);
                high = std::max(high, crossing);
            }
            before = f;
        }
    }
    return high > low ? high - low : 0;
}

Result<void> FemurShape::fitCanal(Exact exact) {
    // The canal narrows as the cortex grows: bisection. `unit` turns a width into the option's value.
    const auto solve = [&](double& cortex_mm, double z, double target, bool is_exact, double thickest,
                           const char* field, double unit) -> Result<void> {
        double low = 0.8, high = thickest;
        cortex_mm = low;
        const double widest = canalWidth(z);
        cortex_mm = high;
        const double narrowest = canalWidth(z);
        if (is_exact && !(target <= widest && target >= narrowest)) {
            return invalidOption(field, fmt::format("{:.2f}", target / unit),
                                 fmt::format("{:.2f} to {:.2f} for this bone", narrowest / unit, widest / unit));
        }
        for (int step = 0; step < 12; ++step) {
            cortex_mm = 0.5 * (low + high);
            (canalWidth(z) > target ? low : high) = cortex_mm;
        }
        return {};
    };
    const double isthmus = dimensions_.isthmus_canal_mm;
    if (auto ok = solve(cortex_isthmus_, isthmusLevel(), isthmus, exact.isthmus, 11, "isthmus_canal_mm", 1); !ok) {
        return ok;
    }
    // Unasked, the flare's wall stays a wall: with a low neck the level lies in the neck, and is wide.
    return solve(cortex_flare_, flareLevel(), isthmus * dimensions_.canal_flare_index, exact.flare,
                 exact.flare ? 11 : 5, "canal_flare_index", isthmus);
}

Vector3 FemurShape::extremePoint(const Vector3& direction, const Vector3& start) const {
    Vector3 p = start;
    const double h = 0.05;
    for (int step = 0; step < 400; ++step) {
        const Vector3 gradient = Vector3(outer(p + h * Vector3::UnitX()) - outer(p - h * Vector3::UnitX()),
                                         outer(p + h * Vector3::UnitY()) - outer(p - h * Vector3::UnitY()),
                                         outer(p + h * Vector3::UnitZ()) - outer(p - h * Vector3::UnitZ())) /
                                 (2 * h);
        const Vector3 normal = gradient.normalized();
        p -= outer(p) / std::max(gradient.norm(), 0.3) * normal;
        p += (step < 300 ? 0.4 : 0.1) * (direction - direction.dot(normal) * normal);
    }
    return p;
}

}  // namespace fluorocut
