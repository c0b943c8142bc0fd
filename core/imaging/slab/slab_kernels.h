// The inner loops of the slab projector, compiled three times: for the x86-64 baseline, for AVX2 and for AVX-512.
// `slabKernels()` picks the best that this processor runs.
//
// The loops see raw memory only, so that the files which are compiled for a newer processor share no inline function
// with the rest of the program.
#pragma once

#include <cstddef>
#include <cstdint>

namespace fluorocut {

// Linear interpolation of one row of int16 voxels at `count` positions first + p * step, the same for every row of a
// slice. Arrays are in the layout that the kernel which filled them wants; sizes are for `capacity` positions.
struct RowTable {
    std::int32_t* start;   // [capacity] first voxel of a window that some positions share
    std::int32_t* index;   // [capacity] where a position's two voxels are in the window, packed for a shuffle
    std::int32_t* weight;  // [capacity] their weights, 2^14 = 1, two int16; zero for positions outside [begin, end)
    int group_begin;       // positions [16 group_begin, 16 group_end) are written
    int group_end;
    bool wide;  // AVX-512: windows of 32 voxels instead of 16
};

// Position of ideal pixel (x, y) on the base image and the length of a ray per slice:
//     d = m + x m_x + y m_y,  p = (a + x a_x + y a_y) / d,  q = (b + x b_x + y b_y) / d
//     base position (p + p_offset, q + q_offset),  length = sqrt(length_m + length_p p^2 + length_q q^2)
struct WarpRow {
    float m, m_x, m_y;
    float a, a_x, a_y;
    float b, b_x, b_y;
    float p_offset, q_offset;
    float length_m, length_p, length_q;
    const float* base;    // row-major base image
    const float* base_w;  // gradient only: the second base image
    std::ptrdiff_t stride;
    float p_max, q_max;  // positions are clamped to [1, p_max] x [1, q_max]: the base image is zero at its margin
    const float* x;      // [count] ideal pixel coordinates along this row
    const float* y;      // [count] offset from the row's own y, or null for none
    int count;
};

// For one pose parameter, see slab_projector.h:
//     d(image) = length (B_p (g_a + dp) + B_q (g_b + dq) + W_p g_a + W_q g_b) + B d(length)
struct GradientParameter {
    float ga, ga_p;        // g_a = ga + ga_p p
    float gb, gb_q;        // g_b = gb + gb_q q
    float dm, dm_x, dm_y;  // change of d
    float da, da_x, da_y;  // change of the numerator of p
    float db, db_x, db_y;
};

struct SlabKernels {
    const char* name;
    // Positions outside [begin, end) get weight zero. `first` and `step` in voxels; 0 <= step <= 1.9.
    void (*fillTable)(RowTable& table, double first, double step, int begin, int end);
    void (*interpolateRow)(const std::int16_t* row, const RowTable& table, float* out, std::ptrdiff_t prefetch);
    // sum[i] += w0 h0[i] + w1 h1[i]
    void (*accumulate)(float* sum, const float* h0, const float* h1, float w0, float w1, int count);
    // ... and sum_w[i] += ratio (w0 h0[i] + w1 h1[i])
    void (*accumulateTwo)(float* sum, float* sum_w, const float* h0, const float* h1, float w0, float w1, float ratio,
                          int count);
    // to[i] = row[i] - along (row[i-1] - 2 row[i] + row[i+1]) - across (above[i] - 2 row[i] + below[i])
    void (*sharpen)(const float* row, const float* above, const float* below, float along, float across, float* to,
                    int count);
    // out[i] += weight * length * base(position), Catmull-Rom
    void (*warp)(const WarpRow& row, float weight, float* out);
    void (*warpGradient)(const WarpRow& row, const GradientParameter* parameters, float weight, float* out,
                         float* const* gradient);
};

const SlabKernels& slabKernels();

// Every set this processor runs, worst first (for tests).
int slabKernelSets(const SlabKernels* sets[3]);

}  // namespace fluorocut
