// The part of an image that a cavity's shadow lies in, and what a fit to its pixels needs of it.
#pragma once

#include <optional>

#include <Eigen/Core>

#include "core/geometry/triangle_mesh.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"

namespace fluorocut::cavity {

inline constexpr int kDegree = 4;  // of what is slow over a region
inline constexpr int kSlow = (kDegree + 1) * (kDegree + 2) / 2;

// The image's pixels around the cavity's shadow.
struct Region {
    int x = 0, y = 0, width = 0, height = 0;
    double px_per_mm = 0;  // of what lies as deep as the cavity
};

// With `margin_mm` around it at the cavity, of whole blocks of `block_px`; nothing when it is too small or not in front
// of the source.
std::optional<Region> regionOf(const CArm& carm, const TriangleMesh& mesh, const Rigid3& imager_from_cavity,
                               double margin_mm, int block_px);

// Logarithm of the means of binning x binning pixels; levels far below the brightest are taken as 1e-4 of it.
Image logOf(const Image& image, const Region& region, int binning);

// Polynomials of total degree kDegree, as products of Legendre's, over a region: pixels (row by row) x kSlow.
Eigen::MatrixXf slowBasis(int width, int height);

// 1/2 of the Laplacian: the derivative of a blur by its variance.
Image halfLaplacian(const Image& image);

}  // namespace fluorocut::cavity
