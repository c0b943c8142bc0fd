// The fast projector of volume_projector.h: slice by slice onto a base plane, then one warp to the detector.
//
// In index coordinates, with main axis m and the source at S, the ray through the point (A, B) of the base plane m =
// k_b meets slice k at
//     a_k = S_a + (A - S_a) s_k,    b_k = S_b + (B - S_b) s_k,    s_k = (k - S_m) / (k_b - S_m),
// a scale and a shift of the whole slice. So the base image
//     B(A, B) = sum over k of slice_k(a_k, b_k),    bilinear in each slice,
// is made with one table of column weights and one row weight per line, sharpened a little against the blur of the
// interpolation (Condat, Blu, Unser 2005 call this quasi-interpolation), and
//     image(pixel) = mu per unit * length of the ray per slice * B(A(pixel), B(pixel)).
//
// Derivatives. Moving the source moves every slice's picture by (1 - s_k) as much. Because d/dA of slice_k(a_k) is
// s_k slice_k', the sums with weight (1 - s_k) that this needs are A- and B-derivatives of one more base image,
//     W(A, B) = sum over k of (1 - s_k) / s_k slice_k(a_k, b_k):
//     dB = B_A (g_a + dA) + B_B (g_b + dB) + W_A g_a + W_B g_b,
//     g_a = dS_a - alpha dS_m,  g_b = dS_b - beta dS_m,  dA = (k_b - S_m) dalpha,  dB = (k_b - S_m) dbeta,
// where alpha = D_a / D_m and beta = D_b / D_m are the slopes of the ray D. Six derivatives for two base images; g + d
// is how far the ray moves in the base plane, so that turning about a point near it cancels nothing large.
#pragma once

#include <array>

#include "core/image/image.h"
#include "core/imaging/projection_geometry.h"
#include "core/imaging/slab/slab_kernels.h"
#include "core/imaging/slab/slab_volume.h"

namespace fluorocut {

// How the view's geometry changes with one pose parameter: index coordinates.
struct GeometryChange {
    Vector3 source;       // d(source)
    Vector3 corner;       // d(detector point of pixel (0,0) - source)
    Vector3 step_column;  // d(step_column)
    Vector3 step_row;
};

// The axis (in index coordinates) along which the central ray crosses most slices.
int nearestAxis(const ProjectionGeometry& geometry);

// Whether every ray of the view is within 75 degrees of the main axis and all that is not air lies before the detector.
// Otherwise the slab projector cannot serve and the exact one must.
bool slabCanProject(const SlabVolume& volume, const ProjectionGeometry& geometry, int main_axis);

// scale_per_hu: attenuation per mm of HU + 1000 = 1. `binning`: the geometry is that of the full image, the result has
// columns / binning x rows / binning pixels.
Image projectSlab(const SlabVolume& volume, const ProjectionGeometry& geometry, int main_axis, double scale_per_hu,
                  int binning, const SlabKernels& kernels);

Image projectSlabWithGradient(const SlabVolume& volume, const ProjectionGeometry& geometry, int main_axis,
                              double scale_per_hu, int binning, const std::array<GeometryChange, 6>& changes,
                              const SlabKernels& kernels, std::array<Image, 6>& gradient);

}  // namespace fluorocut
