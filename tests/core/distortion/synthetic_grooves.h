// A distorted image of a plate in closed form, and groove points as a detector would hand them over: with noise, false
// points and holes.
#pragma once

#include <cmath>

#include <Eigen/LU>

#include "core/base/random.h"
#include "core/distortion/groove_points.h"

namespace fluorocut::test {

// Plate mm from pixels: pincushion of 5 to 8 px and a vortex with an S-shaped term of 2 to 5 px (at 512 pixels), the
// lattice anywhere and turned. Smooth, but a polynomial of no degree (tanh).
struct BentPlate {
    int size = 512;  // columns and rows
    double pixel_mm = 0.32;
    double pincushion_px = 7, s_shape_px = 4;
    double plate_turn_rad = 0;
    Vector2 axis_px = Vector2::Zero();  // of the distortion, from the middle
    Vector2 lattice_mm = Vector2::Zero();

    static BentPlate random(int size, double pixel_mm, Random& random) {
        BentPlate plate;
        plate.size = size;
        plate.pixel_mm = pixel_mm;
        const double k = size / 512.0;
        plate.pincushion_px = k * random.uniform(5, 8);
        plate.s_shape_px = k * random.uniform(2, 5);
        plate.plate_turn_rad = random.uniform(0, 0.05);
        plate.axis_px = k * Vector2(random.uniform(-8, 8), random.uniform(-8, 8));
        plate.lattice_mm = Vector2(random.uniform(-2, 2), random.uniform(-2, 2));
        return plate;
    }

    Vector2 middle() const { return Vector2::Constant(0.5 * (size - 1)); }

    // The detector's mm, not normalised at the middle.
    Vector2 bent(const Vector2& pixel) const {
        const double field = 0.5 * size;
        const Vector2 at = pixel - middle() - axis_px;
        const double r2 = at.squaredNorm() / (field * field), r = std::sqrt(r2);
        const double radial = 1 - pincushion_px / field * (r2 - 0.15 * r2 * r2);
        const double turn = s_shape_px / field * std::tanh(1.6 * r) * r;
        Vector2 result = radial * (Eigen::Rotation2Dd(turn) * at);
        result.x() += 0.4 * s_shape_px * std::tanh(2.2 * at.y() / field);
        return pixel_mm * result;
    }
    Vector2 plateFromPixel(const Vector2& pixel) const {
        return Eigen::Rotation2Dd(plate_turn_rad) * bent(pixel) + lattice_mm;
    }
    Eigen::Matrix2d jacobian(const Vector2& pixel) const {
        constexpr double h = 1e-4;
        Eigen::Matrix2d j;
        for (int axis = 0; axis < 2; ++axis) {
            const Vector2 step = h * Vector2::Unit(axis);
            j.col(axis) = (plateFromPixel(pixel + step) - plateFromPixel(pixel - step)) / (2 * h);
        }
        return j;
    }
    Vector2 pixelFromPlate(const Vector2& plate_mm) const {
        Vector2 pixel = middle();
        for (int i = 0; i < 30; ++i)
            pixel -= jacobian(pixel).inverse() * (plateFromPixel(pixel) - plate_mm);
        return pixel;
    }
};

struct GrooveNoise {
    double sigma_mm = 0.034;
    double outliers = 0;      // share of false points, off by up to half a pitch
    double hidden_block = 0;  // share of the field under one round clamp
    double field = 0.485;     // radius of the round field over the image's width; above 0.71 the whole image
};

// One point for each piece of groove between two crossings. A plate has what BentPlate has.
template <class Plate>
GroovePoints groovePoints(const Plate& plate, const GrooveNoise& noise, Random& random) {
    GroovePoints points;
    points.columns = points.rows = plate.size;
    points.pitch_mm = 6.35;
    const double radius = noise.field * plate.size;
    const double hidden = radius * std::sqrt(noise.hidden_block);
    const double angle = random.uniform(0, 7), away = radius * random.uniform(0, 0.7);
    const Vector2 clamp = plate.middle() + away * Vector2(std::cos(angle), std::sin(angle));
    for (const int axis : {0, 1}) {
        for (int groove = -25; groove <= 25; ++groove) {
            for (int piece = -25; piece <= 25; ++piece) {
                Vector2 at(groove * points.pitch_mm, (piece + 0.5) * points.pitch_mm);
                if (axis == 1) std::swap(at.x(), at.y());
                if (at.norm() > 0.85 * plate.size * plate.pixel_mm) continue;
                GroovePoint point;
                point.pixel = plate.pixelFromPlate(at);
                const bool seen = (point.pixel - plate.middle()).norm() < radius && point.pixel.minCoeff() > 2 &&
                                  point.pixel.maxCoeff() < plate.size - 3 && (point.pixel - clamp).norm() > hidden;
                if (!seen) continue;
                point.index = groove;
                point.across = plate.jacobian(point.pixel).row(axis).normalized().transpose();
                point.sigma_px = noise.sigma_mm / plate.pixel_mm;
                if (point.sigma_px == 0) point.sigma_px = 0.01;
                double off = noise.sigma_mm * random.normal();
                if (random.uniform() < noise.outliers) off = random.uniform(-0.5, 0.5) * points.pitch_mm;
                point.pixel += off / plate.pixel_mm * point.across;
                (axis == 0 ? points.along_y : points.along_x).push_back(point);
            }
        }
    }
    return points;
}

}  // namespace fluorocut::test
