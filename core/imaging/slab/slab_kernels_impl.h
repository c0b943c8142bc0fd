// The kernels' one source. Included by slab_kernels_<isa>.cpp, each compiled with its own instruction set and defining
// FLUOROCUT_ISA, the namespace that keeps the three apart. Plain loops of 16 lanes are left to the compiler; only the
// interpolation of a row is written by hand where the instruction set has a shuffle for it.
//
// Not a header for anyone else: no include guard is wanted more than #pragma once, and no standard C++ header is
// included, so that no inline function compiled for AVX-512 can be picked by the linker for the whole program.
#pragma once

#include <immintrin.h>

#include "core/imaging/slab/slab_kernels.h"

namespace fluorocut::FLUOROCUT_ISA {

constexpr int kLanes = 16;
constexpr int kWeightOne = 1 << 14;

inline int floorToInt(double value) {
    const int truncated = static_cast<int>(value);
    return truncated - (static_cast<double>(truncated) > value ? 1 : 0);
}

void fillTable(RowTable& table, double first, double step, int begin, int end) {
    table.group_begin = begin / kLanes;
    table.group_end = (end + kLanes - 1) / kLanes;
    table.wide = (kLanes - 1) * step + 2 >= 15.5;
    const float step_f = static_cast<float>(step);
    for (int p = table.group_begin * kLanes; p < table.group_end * kLanes; p += kLanes) {
        // Voxels are counted from the first position that is wanted; those beyond the ends stay on the end's voxel,
        // with weight zero.
        const int from = p < begin ? begin : p, to = p + kLanes > end ? end - 1 : p + kLanes - 1;
        const double at = first + from * step;
        const int start = floorToInt(at);
        const float offset = static_cast<float>(at - start - (from - p) * step);
        const std::int32_t last = static_cast<std::int32_t>(offset + static_cast<float>(to - p) * step_f);
        alignas(64) std::int32_t voxel[kLanes];
        for (int lane = 0; lane < kLanes; ++lane) {
            const float position = offset + static_cast<float>(lane) * step_f;
            std::int32_t v = static_cast<std::int32_t>(position > 0 ? position : 0.0f);
            v = v < last ? v : last;
            voxel[lane] = v;
            const std::int32_t weight =
                static_cast<std::int32_t>((position - static_cast<float>(v)) * kWeightOne + 0.5f);
            const bool wanted = p + lane >= from && p + lane <= to;
            table.weight[p + lane] = wanted ? (kWeightOne - weight) | (weight << 16) : 0;
        }
#if defined(__AVX512BW__)
        table.start[p / kLanes] = start;
        for (int lane = 0; lane < kLanes; ++lane)
            table.index[p + lane] = voxel[lane] * 0x10001 + 0x10000;
#elif defined(__AVX2__)
        for (int lane = 0; lane < kLanes; ++lane) {
            const std::int32_t window = voxel[lane / 4 * 4];
            table.index[p + lane] = (voxel[lane] - window) * 0x02020202 + 0x03020100;  // bytes of two neighbours
            if (lane % 4 == 0) table.start[(p + lane) / 4] = start + window;
        }
#else
        for (int lane = 0; lane < kLanes; ++lane)
            table.start[p + lane] = start + voxel[lane];
#endif
    }
}

void interpolateRow(const std::int16_t* row, const RowTable& table, float* out, std::ptrdiff_t prefetch) {
#if defined(__AVX512BW__)
    for (int group = table.group_begin; group < table.group_end; ++group) {
        const std::int16_t* window = row + table.start[group];
        _mm_prefetch(reinterpret_cast<const char*>(window + prefetch), _MM_HINT_T0);
        const __m512i index = _mm512_load_si512(table.index + 16 * group);
        const __m512i weight = _mm512_load_si512(table.weight + 16 * group);
        const __m512i voxels =
            table.wide ? _mm512_loadu_si512(window)
                       : _mm512_castsi256_si512(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(window)));
        const __m512i pairs = _mm512_permutexvar_epi16(index, voxels);
        _mm512_store_ps(out + 16 * group, _mm512_cvtepi32_ps(_mm512_madd_epi16(pairs, weight)));
    }
#elif defined(__AVX2__)
    for (int p = table.group_begin * kLanes; p < table.group_end * kLanes; p += 8) {
        const std::int16_t* low = row + table.start[p / 4];
        const std::int16_t* high = row + table.start[p / 4 + 1];
        _mm_prefetch(reinterpret_cast<const char*>(low + prefetch), _MM_HINT_T0);
        const __m256i index = _mm256_load_si256(reinterpret_cast<const __m256i*>(table.index + p));
        const __m256i weight = _mm256_load_si256(reinterpret_cast<const __m256i*>(table.weight + p));
        const __m256i voxels =
            _mm256_inserti128_si256(_mm256_castsi128_si256(_mm_loadu_si128(reinterpret_cast<const __m128i*>(low))),
                                    _mm_loadu_si128(reinterpret_cast<const __m128i*>(high)), 1);
        const __m256i pairs = _mm256_shuffle_epi8(voxels, index);
        _mm256_store_ps(out + p, _mm256_cvtepi32_ps(_mm256_madd_epi16(pairs, weight)));
    }
#else
    for (int p = table.group_begin * kLanes; p < table.group_end * kLanes; ++p) {
        const std::int16_t* window = row + table.start[p];
        const std::int32_t weight = table.weight[p];
        out[p] = static_cast<float>(window[0] * (weight & 0xffff) + window[1] * (weight >> 16));
        if (p % kLanes == 0) _mm_prefetch(reinterpret_cast<const char*>(window + prefetch), _MM_HINT_T0);
    }
#endif
}

void accumulate(float* __restrict sum, const float* __restrict h0, const float* __restrict h1, float w0, float w1,
                int count) {
    for (int i = 0; i < count; i += kLanes) {
        for (int lane = 0; lane < kLanes; ++lane)
            sum[i + lane] += w0 * h0[i + lane] + w1 * h1[i + lane];
    }
}

void accumulateTwo(float* __restrict sum, float* __restrict sum_w, const float* __restrict h0,
                   const float* __restrict h1, float w0, float w1, float ratio, int count) {
    for (int i = 0; i < count; i += kLanes) {
        for (int lane = 0; lane < kLanes; ++lane) {
            const float value = w0 * h0[i + lane] + w1 * h1[i + lane];
            sum[i + lane] += value;
            sum_w[i + lane] += ratio * value;
        }
    }
}

void sharpen(const float* __restrict row, const float* __restrict above, const float* __restrict below, float along,
             float across, float* __restrict to, int count) {
    const float middle = 1 + 2 * along + 2 * across;
    for (int i = 0; i < count; ++i) {
        to[i] = middle * row[i] - along * (row[i - 1] + row[i + 1]) - across * (above[i] + below[i]);
    }
}

// Sixteen pixels: where they fall on the base image, with the weights of a 4 x 4 Catmull-Rom stencil.
struct Stencil {
    alignas(64) float p[kLanes], q[kLanes], inverse_d[kLanes];
    alignas(64) float length[kLanes];
    alignas(64) std::int32_t offset[kLanes];  // of the stencil's first value
    alignas(64) float wp[4][kLanes], wq[4][kLanes];
    alignas(64) float fp[kLanes], fq[kLanes];  // fractions
};

inline void catmullRom(const float* f, float (*w)[kLanes]) {
    for (int l = 0; l < kLanes; ++l) {
        const float t = f[l], t2 = t * t, t3 = t2 * t;
        w[0][l] = 0.5f * (2 * t2 - t3 - t);
        w[1][l] = 0.5f * (3 * t3 - 5 * t2 + 2);
        w[2][l] = 0.5f * (4 * t2 - 3 * t3 + t);
        w[3][l] = 0.5f * (t3 - t2);
    }
}

inline void catmullRomSlope(const float* f, float (*w)[kLanes]) {
    for (int l = 0; l < kLanes; ++l) {
        const float t = f[l], t2 = t * t;
        w[0][l] = 0.5f * (4 * t - 3 * t2 - 1);
        w[1][l] = 0.5f * (9 * t2 - 10 * t);
        w[2][l] = 0.5f * (8 * t - 9 * t2 + 1);
        w[3][l] = 0.5f * (3 * t2 - 2 * t);
    }
}

inline void locate(const WarpRow& row, const float* x, const float* y, Stencil& s) {
    for (int l = 0; l < kLanes; ++l) {
        const float d = row.m + x[l] * row.m_x + y[l] * row.m_y;
        const float inverse = 1.0f / d;
        const float p = (row.a + x[l] * row.a_x + y[l] * row.a_y) * inverse;
        const float q = (row.b + x[l] * row.b_x + y[l] * row.b_y) * inverse;
        s.inverse_d[l] = inverse;
        s.p[l] = p;
        s.q[l] = q;
        s.length[l] = __builtin_sqrtf(row.length_m + row.length_p * p * p + row.length_q * q * q);
        float at_p = p + row.p_offset, at_q = q + row.q_offset;
        at_p = at_p > 1 ? at_p : 1.0f;  // also for NaN
        at_q = at_q > 1 ? at_q : 1.0f;
        at_p = at_p < row.p_max ? at_p : row.p_max;
        at_q = at_q < row.q_max ? at_q : row.q_max;
        const std::int32_t ip = static_cast<std::int32_t>(at_p), iq = static_cast<std::int32_t>(at_q);
        s.fp[l] = at_p - static_cast<float>(ip);
        s.fq[l] = at_q - static_cast<float>(iq);
        s.offset[l] = (iq - 1) * static_cast<std::int32_t>(row.stride) + ip - 1;
    }
    catmullRom(s.fp, s.wp);
    catmullRom(s.fq, s.wq);
}

inline __m128 combineRows(const float* at, std::ptrdiff_t stride, float w0, float w1, float w2, float w3) {
    const __m128 a = _mm_add_ps(_mm_mul_ps(_mm_loadu_ps(at), _mm_set1_ps(w0)),
                                _mm_mul_ps(_mm_loadu_ps(at + stride), _mm_set1_ps(w1)));
    const __m128 b = _mm_add_ps(_mm_mul_ps(_mm_loadu_ps(at + 2 * stride), _mm_set1_ps(w2)),
                                _mm_mul_ps(_mm_loadu_ps(at + 3 * stride), _mm_set1_ps(w3)));
    return _mm_add_ps(a, b);
}

// Rows of four taps per lane -> four arrays of 16 lanes.
inline void transposeTaps(const __m128* taps, float (*out)[kLanes]) {
    for (int g = 0; g < kLanes; g += 4) {
        __m128 r0 = taps[g], r1 = taps[g + 1], r2 = taps[g + 2], r3 = taps[g + 3];
        _MM_TRANSPOSE4_PS(r0, r1, r2, r3);
        _mm_store_ps(out[0] + g, r0);
        _mm_store_ps(out[1] + g, r1);
        _mm_store_ps(out[2] + g, r2);
        _mm_store_ps(out[3] + g, r3);
    }
}

inline void combineTaps(const __m128* taps, const float (*w)[kLanes], float* out) {
    alignas(64) float t[4][kLanes];
    transposeTaps(taps, t);
    for (int l = 0; l < kLanes; ++l)
        out[l] = t[0][l] * w[0][l] + t[1][l] * w[1][l] + t[2][l] * w[2][l] + t[3][l] * w[3][l];
}

// Cubic interpolation and sharpening swing below zero beside an edge; a line integral of mu does not.
inline float nonNegative(float value) {
    return value > 0 ? value : 0;
}

// Copies up to 16 coordinates, padding with the last.
inline void loadLanes(const float* from, int count, float* to) {
    for (int l = 0; l < kLanes; ++l)
        to[l] = from ? from[l < count ? l : count - 1] : 0.0f;
}

void warp(const WarpRow& row, float weight, float* out) {
    Stencil s;
    alignas(64) float x[kLanes], y[kLanes], value[kLanes];
    __m128 taps[kLanes];
    for (int begin = 0; begin < row.count; begin += kLanes) {
        const int count = row.count - begin < kLanes ? row.count - begin : kLanes;
        loadLanes(row.x + begin, count, x);
        loadLanes(row.y ? row.y + begin : nullptr, count, y);
        locate(row, x, y, s);
        for (int l = 0; l < kLanes; ++l) {
            taps[l] = combineRows(row.base + s.offset[l], row.stride, s.wq[0][l], s.wq[1][l], s.wq[2][l], s.wq[3][l]);
        }
        combineTaps(taps, s.wp, value);
        for (int l = 0; l < kLanes; ++l)
            value[l] = weight * s.length[l] * nonNegative(value[l]);
        if (count == kLanes) {
            for (int l = 0; l < kLanes; ++l)
                out[begin + l] += value[l];
        } else {
            for (int l = 0; l < count; ++l)
                out[begin + l] += value[l];
        }
    }
}

void warpGradient(const WarpRow& row, const GradientParameter* parameters, float weight, float* out,
                  float* const* gradient) {
    Stencil s;
    alignas(64) float x[kLanes], y[kLanes];
    alignas(64) float b[kLanes], b_p[kLanes], b_q[kLanes], w_p[kLanes], w_q[kLanes], derivative[kLanes];
    alignas(64) float slope_p[4][kLanes], slope_q[4][kLanes];
    __m128 taps[kLanes], slopes[kLanes];
    for (int begin = 0; begin < row.count; begin += kLanes) {
        const int count = row.count - begin < kLanes ? row.count - begin : kLanes;
        loadLanes(row.x + begin, count, x);
        loadLanes(row.y ? row.y + begin : nullptr, count, y);
        locate(row, x, y, s);
        catmullRomSlope(s.fp, slope_p);
        catmullRomSlope(s.fq, slope_q);
        for (int l = 0; l < kLanes; ++l) {
            const float* at = row.base + s.offset[l];
            taps[l] = combineRows(at, row.stride, s.wq[0][l], s.wq[1][l], s.wq[2][l], s.wq[3][l]);
            slopes[l] = combineRows(at, row.stride, slope_q[0][l], slope_q[1][l], slope_q[2][l], slope_q[3][l]);
        }
        combineTaps(taps, s.wp, b);
        combineTaps(taps, slope_p, b_p);
        combineTaps(slopes, s.wp, b_q);
        for (int l = 0; l < kLanes; ++l) {
            const float* at = row.base_w + s.offset[l];
            taps[l] = combineRows(at, row.stride, s.wq[0][l], s.wq[1][l], s.wq[2][l], s.wq[3][l]);
            slopes[l] = combineRows(at, row.stride, slope_q[0][l], slope_q[1][l], slope_q[2][l], slope_q[3][l]);
        }
        combineTaps(taps, slope_p, w_p);
        combineTaps(slopes, s.wp, w_q);
        for (int l = 0; l < count; ++l)
            out[begin + l] += weight * s.length[l] * nonNegative(b[l]);
        for (int k = 0; k < 6; ++k) {
            const GradientParameter& d = parameters[k];
            for (int l = 0; l < kLanes; ++l) {
                const float p = s.p[l], q = s.q[l];
                const float change_m = d.dm + d.dm_x * x[l] + d.dm_y * y[l];
                const float change_p = (d.da + d.da_x * x[l] + d.da_y * y[l] - p * change_m) * s.inverse_d[l];
                const float change_q = (d.db + d.db_x * x[l] + d.db_y * y[l] - q * change_m) * s.inverse_d[l];
                const float change_length = (row.length_p * p * change_p + row.length_q * q * change_q) / s.length[l];
                const float shift_p = d.ga + d.ga_p * p, shift_q = d.gb + d.gb_q * q;
                const float change_base =
                    b_p[l] * (shift_p + change_p) + b_q[l] * (shift_q + change_q) + w_p[l] * shift_p + w_q[l] * shift_q;
                derivative[l] = weight * (s.length[l] * change_base + b[l] * change_length);
            }
            for (int l = 0; l < count; ++l)
                gradient[k][begin + l] += derivative[l];
        }
    }
}

extern const SlabKernels kKernels;
const SlabKernels kKernels = {FLUOROCUT_ISA_NAME, fillTable, interpolateRow, accumulate,
                              accumulateTwo,      sharpen,   warp,           warpGradient};

}  // namespace fluorocut::FLUOROCUT_ISA
