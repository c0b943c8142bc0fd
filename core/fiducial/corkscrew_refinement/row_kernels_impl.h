// Included by one source per instruction set (row_kernels.h). FLUOROCUT_ISA names its namespace.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include "core/fiducial/corkscrew_refinement/row_kernels.h"

namespace fluorocut::corkscrew::FLUOROCUT_ISA {
namespace {

[[gnu::always_inline]] inline float larger(float a, float b) {
    return a > b ? a : b;
}
[[gnu::always_inline]] inline float smaller(float a, float b) {
    return a < b ? a : b;
}

// exp(x) for x in [-80, 80] to 3e-7 of itself: 2^n e^r, |r| <= log(2) / 2, Taylor to r^6.
[[gnu::always_inline]] inline float exponential(float x) {
    x = smaller(larger(x, -80.0f), 80.0f);
    const float scaled = x * 1.44269504f;
    const float rounded = (scaled + 12582912.0f) - 12582912.0f;
    const float r = x - rounded * 0.693359375f + rounded * 2.12194440e-4f;
    const float e = 1 + r * (1 + r * (0.5f + r * (1.0f / 6 + r * (1.0f / 24 + r * (1.0f / 120 + r * (1.0f / 720))))));
    return e * std::bit_cast<float>((static_cast<std::int32_t>(rounded) + 127) << 23);
}

// log of a positive normal number to 1e-7: m 2^n with m in [0.7, 1.4], log m = 2 atanh((m - 1) / (m + 1)).
[[gnu::always_inline]] inline float logarithmOf(float x) {
    const std::int32_t bits = std::bit_cast<std::int32_t>(x);
    const std::int32_t exponent = (bits - 0x3f3504f3) >> 23;
    const float m = std::bit_cast<float>(bits - exponent * (1 << 23));
    const float s = (m - 1) / (m + 1), s2 = s * s;
    return static_cast<float>(exponent) * 0.69314718f +
           2 * s * (1 + s2 * (1.0f / 3 + s2 * (1.0f / 5 + s2 * (1.0f / 7 + s2 * (1.0f / 9)))));
}

struct Chord {
    float length;
    float fx, fy, fz;  // F
    float z;           // parameter of the middle of the ends that count
};

// h = sqrt(limit - c^2) over c = offset +- width, as one that transmits exp(-rate h) as their mean (Simpson's) does,
// and minus its change with c, by c.
struct HalfChord {
    float root, inverse;
};

template <bool kForce>
[[gnu::always_inline]] inline HalfChord halfChord(float offset, float limit, float width, float rate) {
    const float beyond = offset + width, before = offset - width;
    const float here = std::sqrt(larger(limit - offset * offset, 0.0f));
    const float high = std::sqrt(larger(limit - beyond * beyond, 0.0f));
    const float low = std::sqrt(larger(limit - before * before, 0.0f));
    // Relative to the middle's, for the rounding.
    const float at_high = exponential(rate * (here - high)), at_low = exponential(rate * (here - low));
    const float mean = (4 + at_high + at_low) * (1.0f / 6);
    HalfChord result{larger(here - logarithmOf(mean) / rate, 0.0f), 0};
    if constexpr (kForce) {
        const bool central = offset * offset < 0.25f * limit;  // there the limb is far
        const float slope = (at_high - at_low) / (rate * mean);
        result.inverse = (central ? 2 * width : slope) / (2 * width * (central ? larger(here, 1e-12f) : offset));
    }
    return result;
}

template <bool kSphere, bool kForce>
[[gnu::always_inline]] inline Chord chord(const PieceInView& p, float x, float y) {
    const float dx = x * p.inverse_focal, dy = y * p.inverse_focal;
    const float ex = dx * p.center[2] - p.center[0], ey = dy * p.center[2] - p.center[1];
    const float stretch = std::sqrt(1 + dx * dx + dy * dy);
    Chord result{0, 0, 0, 0, 0};
    if constexpr (kSphere) {
        const float square = stretch * stretch;
        const float along = ex * dx + ey * dy;
        const float cx = -ey, cy = ex, cz = ex * dy - ey * dx;  // E x D
        const float offset = std::sqrt(cx * cx + cy * cy + cz * cz);
        const HalfChord half = halfChord<kForce>(offset, square * p.radius_squared, p.half_sample * stretch,
                                                 2 * p.attenuation * stretch / square);
        result.length = 2 * half.root / square * stretch;
        if constexpr (kForce) {
            const float scale = 2 * stretch * half.inverse;
            result.z = -along / square;
            result.fx = scale * (ex + result.z * dx);
            result.fy = scale * (ey + result.z * dy);
            result.fz = scale * result.z;
        }
        return result;
    }
    const float da = dx * p.a[0] + dy * p.a[1] + p.a[2], db = dx * p.b[0] + dy * p.b[1] + p.b[2];
    const float ea = ex * p.a[0] + ey * p.a[1], eb = ex * p.b[0] + ey * p.b[1];
    const float square = larger(da * da + db * db, 1e-8f), inverse = 1 / square;
    const float cross = ea * db - eb * da;
    // Where the bar is seen end on, its joints cut the chord: not longer than four radii for the mean over the limb.
    const float across = std::sqrt(square);
    const float rate = 2 * p.attenuation * stretch / larger(square, 0.5f * across);
    const HalfChord half = halfChord<kForce>(cross, square * p.radius_squared, p.half_sample * across, rate);
    const float root = half.root;
    const float middle = -(ea * da + eb * db) * inverse;
    const float enter = middle - root * inverse, leave = middle + root * inverse;
    // Inside: sign (n . (E + z D) - offset) >= 0. Each plane bounds z from below or from above.
    const float rate0 = p.normal[0][0] * dx + p.normal[0][1] * dy + p.normal[0][2];
    const float rate1 = -(p.normal[1][0] * dx + p.normal[1][1] * dy + p.normal[1][2]);
    const float room0 = p.normal[0][0] * ex + p.normal[0][1] * ey - p.offset[0];
    const float room1 = -(p.normal[1][0] * ex + p.normal[1][1] * ey - p.offset[1]);
    const float steep0 = larger(rate0 < 0 ? -rate0 : rate0, 1e-7f), steep1 = larger(rate1 < 0 ? -rate1 : rate1, 1e-7f);
    const float cut0 = (rate0 < 0 ? room0 : -room0) / steep0, cut1 = (rate1 < 0 ? room1 : -room1) / steep1;
    const float low = larger(rate0 < 0 ? -1e9f : cut0, rate1 < 0 ? -1e9f : cut1);
    const float high = smaller(rate0 < 0 ? cut0 : 1e9f, rate1 < 0 ? cut1 : 1e9f);
    const float first = larger(enter, low), last = smaller(leave, high);
    result.length = root > 0 ? larger(last - first, 0.0f) * stretch : 0.0f;
    if constexpr (kForce) {
        const float scale = stretch * half.inverse;
        const float in = enter >= low && enter < high ? scale : 0.0f;
        const float out = leave <= high && leave > low ? scale : 0.0f;
        const float fa = in * (ea + enter * da) + out * (ea + leave * da);
        const float fb = in * (eb + enter * db) + out * (eb + leave * db);
        // A flat end: v . n / (D . n), which grows without limit as the end is seen from the side.
        // Entering: -n / rate with the inward normal; leaving: +n / rate. Both are against the inward normal.
        const float cuts0 = first < last && cut0 > enter && cut0 < leave ? p.flat[0] : 0.0f;
        const float cuts1 = first < last && cut1 > enter && cut1 < leave ? p.flat[1] : 0.0f;
        const float na = cuts0 * stretch / larger(steep0, 0.03f), nb = cuts1 * stretch / larger(steep1, 0.03f);
        result.fx = fa * p.a[0] + fb * p.b[0] - na * p.normal[0][0] + nb * p.normal[1][0];
        result.fy = fa * p.a[1] + fb * p.b[1] - na * p.normal[0][1] + nb * p.normal[1][1];
        result.fz = fa * p.a[2] + fb * p.b[2] - na * p.normal[0][2] + nb * p.normal[1][2];
        const float one_end = in > 0 ? enter : leave;
        const float either = in > 0 && out > 0 ? middle : one_end;
        result.z = na + nb > 0 ? 0.5f * (first + last) : either;
    }
    return result;
}

template <bool kSphere>
void lengthsOf(const PieceInView& piece, const float* __restrict x, const float* __restrict y, int count,
               float* __restrict length, float* __restrict displaced) {
    const PieceInView p = piece;
    count &= -kRowStep;
    for (int i = 0; i < count; ++i) {
        const Chord c = chord<kSphere, false>(p, x[i], y[i]);
        length[i] += c.length;
        displaced[i] -= c.length;
    }
}

void lengths(const PieceInView& piece, const float* x, const float* y, int count, float* length, float* displaced) {
    (piece.sphere ? lengthsOf<true> : lengthsOf<false>)(piece, x, y, count, length, displaced);
}

template <bool kSphere>
void forcesOf(const PieceInView& piece, const float* __restrict x, const float* __restrict y, int count, float weight,
              float* __restrict length, float* __restrict displaced, float* const* forces) {
    const PieceInView p = piece;
    count &= -kRowStep;
    float* __restrict f0 = forces[0];
    float* __restrict f1 = forces[1];
    float* __restrict f2 = forces[2];
    float* __restrict f3 = forces[3];
    float* __restrict f4 = forces[4];
    float* __restrict f5 = forces[5];
    float* __restrict f6 = forces[6];
    float* __restrict f7 = forces[7];
    float* __restrict f8 = forces[8];
#pragma GCC ivdep
    for (int i = 0; i < count; ++i) {
        const Chord c = chord<kSphere, true>(p, x[i], y[i]);
        length[i] += c.length;
        displaced[i] -= c.length;
        const float depth = p.center[2] + c.z;
        const float px = x[i] * p.inverse_focal * depth, py = y[i] * p.inverse_focal * depth;
        const float ox = px - p.center[0] + p.from_origin[0], oy = py - p.center[1] + p.from_origin[1];
        const float oz = c.z + p.from_origin[2];
        const float fx = weight * c.fx, fy = weight * c.fy, fz = weight * c.fz;
        f0[i] += fx;
        f1[i] += fy;
        f2[i] += fz;
        f3[i] += oy * fz - oz * fy;
        f4[i] += oz * fx - ox * fz;
        f5[i] += ox * fy - oy * fx;
        f6[i] += fx * px + fy * py;
        f7[i] += fx * depth;
        f8[i] += fy * depth;
    }
}

void forces(const PieceInView& piece, const float* x, const float* y, int count, float weight, float* length,
            float* displaced, float* const* planes) {
    (piece.sphere ? forcesOf<true> : forcesOf<false>)(piece, x, y, count, weight, length, displaced, planes);
}

template <bool kSphere>
void motionsOf(const PieceInView& piece, const float* __restrict x, const float* __restrict y, int count, float weight,
               const float (*velocity)[3], float* const* planes) {
    const PieceInView p = piece;
    count &= -kRowStep;
    float v[kMostMotions][3];
    for (int k = 0; k < kMostMotions; ++k)
        for (int i = 0; i < 3; ++i)
            v[k][i] = weight * velocity[k][i];
    float* __restrict m0 = planes[0];
    float* __restrict m1 = planes[1];
    float* __restrict m2 = planes[2];
    float* __restrict m3 = planes[3];
#pragma GCC ivdep
    for (int i = 0; i < count; ++i) {
        const Chord c = chord<kSphere, true>(p, x[i], y[i]);
        m0[i] += v[0][0] * c.fx + v[0][1] * c.fy + v[0][2] * c.fz;
        m1[i] += v[1][0] * c.fx + v[1][1] * c.fy + v[1][2] * c.fz;
        m2[i] += v[2][0] * c.fx + v[2][1] * c.fy + v[2][2] * c.fz;
        m3[i] += v[3][0] * c.fx + v[3][1] * c.fy + v[3][2] * c.fz;
    }
}

void motions(const PieceInView& piece, const float* x, const float* y, int count, float weight,
             const float (*velocity)[3], float* const* planes) {
    (piece.sphere ? motionsOf<true> : motionsOf<false>)(piece, x, y, count, weight, velocity, planes);
}

void transmission(const float* const* lengths_of, const float* coefficients, int parts, int count,
                  float* __restrict values) {
    for (int i = 0; i < count; ++i)
        values[i] = 0;
    for (int k = 0; k < parts; ++k) {
        const float* __restrict length = lengths_of[k];
        const float coefficient = coefficients[k];
        for (int i = 0; i < count; ++i)
            values[i] -= coefficient * length[i];
    }
    for (int i = 0; i < count; ++i)
        values[i] = exponential(values[i]);
}

void logarithm(float* __restrict values, int count, float floor) {
    for (int i = 0; i < count; ++i)
        values[i] = logarithmOf(larger(values[i], floor));
}

void blurDown(const float* const* rows, const float* weights, int radius, int count, float* __restrict out) {
    const float* __restrict here = rows[radius];
    for (int i = 0; i < count; ++i)
        out[i] = weights[0] * here[i];
    for (int n = 1; n <= radius; ++n) {
        const float* __restrict above = rows[radius - n];
        const float* __restrict below = rows[radius + n];
        const float weight = weights[n];
        for (int i = 0; i < count; ++i)
            out[i] += weight * (above[i] + below[i]);
    }
}

void blurAlong(const float* __restrict middle, const float* weights, int radius, int count, float* __restrict out) {
    for (int i = 0; i < count; ++i)
        out[i] = weights[0] * middle[i];
    for (int n = 1; n <= radius; ++n) {
        const float weight = weights[n];
        for (int i = 0; i < count; ++i)
            out[i] += weight * (middle[i - n] + middle[i + n]);
    }
}

}  // namespace

extern const RowKernels kKernels;
const RowKernels kKernels{FLUOROCUT_ISA_NAME, lengths, forces, motions, transmission, logarithm, blurDown, blurAlong};

}  // namespace fluorocut::corkscrew::FLUOROCUT_ISA
