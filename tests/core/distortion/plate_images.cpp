#include "tests/core/distortion/plate_images.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/base/parallel.h"
#include "core/image/blur.h"

namespace fluorocut::test {
namespace {

double distanceToNearestMultiple(double x, double step) {
    return std::abs(x - step * std::round(x / step));
}

// How much of the plate is cut away at distance `d` from a groove's middle line: a box of the groove's width whose
// edges slope over `edge`. Sampling with edge >= the samples' spacing leaves no staircase and shifts nothing.
double grooveProfile(double d, double width, double edge) {
    return std::clamp(0.5 + (0.5 * width - d) / edge, 0.0, 1.0);
}

struct Objects {
    double shaft_angle, shaft_offset_mm, clamp_angle, clamp_offset_mm, clamp_end_mm;
    std::vector<std::array<double, 3>> screws;  // x, y, radius, mm
    Image texture;                              // unit variance, about 1.5 mm grain

    Objects(Random& random, int size, double pixel_mm)
        : shaft_angle(random.uniform(0, std::numbers::pi)),
          shaft_offset_mm(random.uniform(-25, 25)),
          clamp_angle(random.uniform(0, 2 * std::numbers::pi)),
          clamp_offset_mm(random.uniform(-30, 30)),
          clamp_end_mm(random.uniform(-50, -20)) {
        for (int n = 0; n < 3; ++n)
            screws.push_back({random.uniform(-60, 60), random.uniform(-60, 60), random.uniform(2, 4)});
        Image white(size, size);
        for (float& pixel : white.pixels())
            pixel = static_cast<float>(random.normal());
        texture = gaussianBlurred(white, 1.5 / pixel_mm);
        double squares = 0;
        for (const float pixel : texture.pixels())
            squares += static_cast<double>(pixel) * static_cast<double>(pixel);
        const double scale = std::sqrt(static_cast<double>(texture.size()) / squares);
        for (float& pixel : texture.pixels())
            pixel *= static_cast<float>(scale);
    }

    bool metal(double x, double y) const {
        const double along = x * std::cos(clamp_angle) + y * std::sin(clamp_angle);
        const double across = -x * std::sin(clamp_angle) + y * std::cos(clamp_angle) - clamp_offset_mm;
        if (std::abs(across) < 8 && along > clamp_end_mm) return true;
        if (std::hypot(along - 10, across - 15) < 15) return true;
        return std::any_of(screws.begin(), screws.end(),
                           [&](const auto& screw) { return std::hypot(x - screw[0], y - screw[1]) < screw[2]; });
    }

    // Line integral of the attenuation, without the metal.
    double tissue(double x, double y, double grain) const {
        const double d = x * std::sin(shaft_angle) - y * std::cos(shaft_angle) + shaft_offset_mm;
        const double along = x * std::cos(shaft_angle) + y * std::sin(shaft_angle);
        const double half_width = 55 + 10 * std::sin(along / 40);
        const auto chord = [](double radius, double distance) {
            return std::sqrt(std::max(0.0, radius * radius - distance * distance));
        };
        return 0.5 * chord(1, d / half_width) + 0.08 * (chord(17, d) - chord(10.5, d)) +
               (0.02 + (std::abs(d) < 17 ? 0.03 : 0)) * grain;
    }
};

}  // namespace

BentField BentField::random(int size_px, double pixel_mm, Random& random) {
    BentField field;
    field.size_px = size_px;
    field.pixel_mm = pixel_mm;
    field.pincushion_px = random.uniform(5, 8);
    field.s_shape_px = random.uniform(2, 5);
    field.offset_px = {random.uniform(-8, 8), random.uniform(-8, 8)};
    field.rotation_rad = random.uniform(-std::numbers::pi, std::numbers::pi);
    field.mirrored = random.below(2) == 1;
    field.shift_mm = {random.uniform(-4, 4), random.uniform(-4, 4)};
    return field;
}

BentField BentField::straight(int size_px, double pixel_mm) {
    BentField field;
    field.size_px = size_px;
    field.pixel_mm = pixel_mm;
    field.pincushion_px = field.s_shape_px = 0;
    return field;
}

Vector2 BentField::operator()(const Vector2& pixel) const {
    const double middle = 0.5 * (size_px - 1), scale = size_px / 512.0, radius = 0.5 * size_px;
    const Vector2 from_center = pixel - Vector2(middle, middle) - scale * offset_px;
    const double r2 = from_center.squaredNorm() / (radius * radius), r = std::sqrt(r2);
    const double shrink = 1 - scale * pincushion_px / radius * (r2 - 0.15 * r2 * r2);
    const double s_shape = scale * s_shape_px;
    const double turn = s_shape / radius * std::tanh(1.6 * r) * r;
    Vector2 ideal = shrink * (Eigen::Rotation2Dd(turn) * from_center);
    ideal.x() += 0.4 * s_shape * std::tanh(2.2 * ideal.y() / radius);
    ideal = pixel_mm * (Eigen::Rotation2Dd(rotation_rad) * ideal);
    if (mirrored) ideal.x() = -ideal.x();
    return ideal + shift_mm;
}

PlateImage renderPlate(const BentField& field, const PlateImageOptions& options, std::uint64_t seed) {
    const int size = field.size_px, samples = options.samples;
    const double middle = 0.5 * (size - 1), scale = size / 512.0;
    const double pitch = options.plate.pitch_mm, width = options.plate.groove_width_mm;
    const double sample_mm = field.pixel_mm / samples;
    const Random root(seed);
    Random objects_random = root.fork(1);
    const std::optional<Objects> objects =
        options.objects ? std::optional<Objects>(std::in_place, objects_random, size, field.pixel_mm) : std::nullopt;

    const auto grooves = [&](const Vector2& plate) {
        const double pitch_y = pitch * options.pitch_ratio;
        if (options.plate.grooves) {  // the plate ends half a pitch beyond its last groove
            const auto [along_y, along_x] = *options.plate.grooves;
            const Vector2 from_corner =
                plate + 0.5 * Vector2((along_y - 1) / 2 * 2 + 1, (along_x - 1) / 2 * 2 + 1) * pitch;
            if (from_corner.x() < 0 || from_corner.y() < 0 || from_corner.x() > along_y * pitch ||
                from_corner.y() > along_x * pitch) {
                return 0.0;
            }
        }
        const double gx = options.grooves_along_y ? grooveProfile(distanceToNearestMultiple(plate.x(), pitch), width,
                                                                  std::max(options.edge_mm.x(), sample_mm))
                                                  : 0;
        const double gy = options.grooves_along_x ? grooveProfile(distanceToNearestMultiple(plate.y(), pitch_y), width,
                                                                  std::max(options.edge_mm.y(), sample_mm))
                                                  : 0;
        return gx + gy - gx * gy;
    };

    PlateImage result{Image(size, size), Mask(size, size)};
    Image fine(size * samples, size * samples);
    parallelFor(static_cast<std::size_t>(size), 16, [&](std::size_t begin, std::size_t end) {
        for (int v = static_cast<int>(begin); v < static_cast<int>(end); ++v) {
            for (int u = 0; u < size; ++u) {
                // Within a pixel the field is straight: its curvature there is below 1e-4 px.
                const Vector2 center = field(Vector2(u, v));
                const Vector2 along_u = field(Vector2(u + 0.5, v)) - field(Vector2(u - 0.5, v));
                const Vector2 along_v = field(Vector2(u, v + 0.5)) - field(Vector2(u, v - 0.5));
                const double grain = objects ? static_cast<double>(objects->texture(u, v)) : 0;
                for (int b = 0; b < samples; ++b) {
                    for (int a = 0; a < samples; ++a) {
                        const double du = (a + 0.5) / samples - 0.5, dv = (b + 0.5) / samples - 0.5;
                        const double x = (u + du - middle) * field.pixel_mm, y = (v + dv - middle) * field.pixel_mm;
                        double line_integral = 0.15 * (std::cos(x / 70) * std::cos(y / 85) - 1);
                        if (objects) {
                            line_integral += objects->tissue(x, y, grain);
                        }
                        if (std::abs(x) < 0.5 * options.bar_mm || (objects && objects->metal(x, y))) {
                            line_integral += 2.5;
                            result.hidden(u, v) = 1;
                        }
                        if (options.plate_present)
                            line_integral -= options.contrast * grooves(center + du * along_u + dv * along_v);
                        fine(u * samples + a, v * samples + b) = static_cast<float>(std::exp(-line_integral));
                    }
                }
            }
        }
    });
    fine = gaussianBlurred(fine, options.blur_px * scale * samples);

    const double photons = options.photons * (objects ? std::exp(0.35) : 1);  // the automatic exposure's answer
    for (int v = 0; v < size; ++v) {
        Random random = root.fork(1000 + static_cast<std::uint64_t>(v));
        for (int u = 0; u < size; ++u) {
            double sum = 0;
            for (int b = 0; b < samples; ++b)
                for (int a = 0; a < samples; ++a)
                    sum += static_cast<double>(fine(u * samples + a, v * samples + b));
            const bool outside =
                options.field_radius > 0 && std::hypot(u - middle, v - middle) > options.field_radius * size;
            if (outside) result.hidden(u, v) = 1;
            const double counted =
                outside ? 0 : static_cast<double>(random.poisson(photons * sum / (samples * samples)));
            result.image(u, v) = static_cast<float>(counted + options.offset);
        }
    }
    if (options.bits) {
        std::vector<float> sorted = result.image.pixels();
        const auto brightest = sorted.end() - 1 - static_cast<std::ptrdiff_t>(sorted.size() / 1000);
        std::nth_element(sorted.begin(), brightest, sorted.end());
        const float most = static_cast<float>((1 << *options.bits) - 1), gain = most / *brightest;
        for (float& pixel : result.image.pixels())
            pixel = std::min(most, std::round(gain * pixel));
    }
    if (options.inverted) {
        const float most = *std::max_element(result.image.pixels().begin(), result.image.pixels().end());
        for (float& pixel : result.image.pixels())
            pixel = most - pixel;
    }
    return result;
}

}  // namespace fluorocut::test
