// The inner loops of the predicted image, over samples that lie in one row of a strip. One source for several
// instruction sets, chosen at run time; float32, in coordinates about the piece so that rounding stays below 1e-4 mm.
//
// A ray through the place q of the detector plane runs along D = (q / f, 1), z being its parameter. About a point C of
// the piece's axis it is E + z' D with E = (q z_C / f - C_xy, 0), z' = z - z_C.
//   bar     (a, b unit vectors across its axis)  entry and exit where |(E + z' D) . (a, b)| = r, cut by two planes
//   sphere  where |E + z' D| = r
// How a length changes when the solid moves with velocity v is the difference of v . n / (D . n) between the two ends
// of the chord; in a bar D . n is -+ sqrt(disc) / r. So the motion's effect is F . v with F = |D| sum of the ends'
// offsets from the axis / sqrt(disc); a flat end adds its outward normal / |D . n|, a joint nothing. 1 / sqrt(disc) is
// cut off where a sample's width does, keeping its integral.
#pragma once

namespace fluorocut::corkscrew {

struct PieceInView {
    bool sphere = false;
    float inverse_focal = 0;
    float center[3];       // C, imager
    float from_origin[3];  // C - origin of the corkscrew, imager
    float a[3], b[3];      // unit, across the axis
    float radius_squared = 0;
    float normal[2][3], offset[2];  // planes: inside is normal[0] . (E + z' D) >= offset[0], normal[1] ... <= offset[1]
    float flat[2] = {0, 0};         // 1: that plane is an end of the solid, 0: a joint
    float attenuation = 1;          // per mm
    float half_sample = 0;          // half the width of a sample at the piece, mm
};

constexpr int kRowStep = 8;  // counts of lengths, forces and motions are multiples of it
constexpr int kMostMotions = 4;
constexpr int kForces = 9;  // F (3), (x - origin) x F (3), F_x x + F_y y, F_x z, F_y z

struct RowKernels {
    const char* name;
    // length += chord, displaced -= chord.
    void (*lengths)(const PieceInView& piece, const float* x, const float* y, int count, float* length,
                    float* displaced);
    // forces[k] += weight * chord's derivative; and lengths as above.
    void (*forces)(const PieceInView& piece, const float* x, const float* y, int count, float weight, float* length,
                   float* displaced, float* const* forces);
    // planes[k] += weight * F . velocity[k], of kMostMotions.
    void (*motions)(const PieceInView& piece, const float* x, const float* y, int count, float weight,
                    const float (*velocity)[3], float* const* planes);
    // values[i] = exp(-sum of coefficient[k] lengths[k][i])
    void (*transmission)(const float* const* lengths, const float* coefficients, int parts, int count, float* values);
    // values[i] = log(max(values[i], floor))
    void (*logarithm)(float* values, int count, float floor);
    // out[i] = sum over -radius <= n <= radius of weights[|n|] * rows[n + radius][i], or * middle[i + n].
    void (*blurDown)(const float* const* rows, const float* weights, int radius, int count, float* out);
    void (*blurAlong)(const float* middle, const float* weights, int radius, int count, float* out);
};

const RowKernels& rowKernels();
int rowKernelSets(const RowKernels* sets[2]);  // all that this machine can run

}  // namespace fluorocut::corkscrew
