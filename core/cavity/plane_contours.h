// Closed curves in an image and how one is laid upon another: what the paper's method works with. Pixels; a contour's
// last point joins its first.
//
//   isoContours    marching squares (the two-dimensional marching cubes: Lorensen and Cline 1987), linear between
//                  pixels; a square with two opposite corners above is parted by its mean
//   snake          energy of bending and stretching against an image force, solved as Kass, Witkin, Terzopoulos (1988)
//                  did: implicit in the contour, explicit in the image
//   rigidFit       by first and second moments, then by iterated closest points (Besl and McKay 1992), of points to
//                  segments
#pragma once

#include <optional>
#include <vector>

#include "core/geometry/rigid3.h"
#include "core/image/image.h"

namespace fluorocut::cavity {

using Contour = std::vector<Vector2>;

double signedArea(const Contour& contour);  // positive: x turns toward y
double length(const Contour& contour);
Contour resampled(const Contour& contour, double step_px);

// Of everything that is not below `level`; beyond the border all is. The area of an outer border is negative, that of a
// hole's positive.
std::vector<Contour> isoContours(const Image& image, float level);

struct SnakeOptions {
    double stretch = 0.02, bend = 0.5;  // against a force of 1
    double step = 0.5;                  // px, at a force of 1
    int iterations = 120;
};
// Moves toward where `edge` (any scale: the force is its gradient, the largest one along the contour being 1) is
// greatest.
Contour snake(const Contour& start, const Image& edge, const SnakeOptions& options = {});

// A turn and shift in the image: to = turn * from + shift.
struct PlaneRigid {
    double angle_rad = 0;
    Vector2 shift_px = Vector2::Zero();

    Vector2 operator*(const Vector2& from) const { return Eigen::Rotation2Dd(angle_rad) * from + shift_px; }
};

// Where points (at least two, not all the same) come to lie by least squares.
PlaneRigid bestRigid(const Contour& from, const Contour& to);

// Of the nearest point on the contour's segments.
Vector2 nearestOn(const Contour& contour, const Vector2& point);
// Root mean square distance of a contour's points from another contour.
double distanceTo(const Contour& from, const Contour& to);

struct ContourFit {
    PlaneRigid to_from;
    double rms_px = 0;  // that is left
    int iterations = 0;
};
// Lays `from` upon `to`. Nothing when one of them has no extent. The principal axes' directions, which moments know up
// to half a turn, are taken nearest to no turn at all.
PlaneRigid momentFit(const Contour& from, const Contour& to);
std::optional<ContourFit> rigidFit(const Contour& from, const Contour& to);

}  // namespace fluorocut::cavity
