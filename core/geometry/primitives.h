// Closed, outward-oriented meshes of simple shapes: what simulated objects are made of and what tests measure. Every
// one is watertight and manifold. mm, in the shape's own frame. Sizes that are no shape throw std::logic_error.
//
// Curved surfaces (but makeTube's) are inscribed: the vertices lie on the shape. A regular prism of n sides has n/(2
// pi) sin(2 pi/n) of the cylinder's volume.
#pragma once

#include <vector>

#include "core/geometry/triangle_mesh.h"

namespace fluorocut {

// Edges along the axes, the middle at the origin; 12 triangles.
TriangleMesh makeBox(const Vector3& size_mm);

// About the origin: an icosahedron, each triangle split in four `subdivisions` times (20 * 4^n triangles).
TriangleMesh makeSphere(double radius_mm, int subdivisions);
TriangleMesh makeEllipsoid(const Vector3& radii_mm, int subdivisions);

// One cross-section of a loft, in a plane of constant z: |x - cx|^p / a^p + |y - cy|^p / b^p = 1. p = 2 is an ellipse,
// larger values square it. Both half widths zero: a point (at the ends only).
struct LoftSection {
    double z_mm = 0;
    Vector2 center_mm = Vector2::Zero();
    Vector2 half_width_mm = Vector2::Ones();
    double exponent = 2;
};

// The point of a section's border in the direction `angle_rad` from its centre (which need not be evenly spaced along
// the border).
Vector2 superellipsePoint(const Vector2& half_width_mm, double exponent, double angle_rad);

// Rings of equally many points joined by straight faces: each counter-clockwise seen from where the next one lies. An
// end may be a single point, otherwise it is closed by a fan about its corners' mean.
TriangleMesh makeSkin(const std::vector<std::vector<Vector3>>& rings);

// Sections (z increasing) joined by straight faces, with flat ends.
TriangleMesh makeLoft(const std::vector<LoftSection>& sections, int segments);

// Along z, the middle at the origin. A frustum with one radius zero is a cone.
TriangleMesh makeCylinder(double radius_mm, double length_mm, int segments);
TriangleMesh makeFrustum(double radius_low_mm, double radius_high_mm, double length_mm, int segments);

// One place along a tube's middle line. `up` turns the cross-section: anything not along the tangent.
struct TubePoint {
    Vector3 center_mm = Vector3::Zero();
    Vector3 tangent = Vector3::UnitX();
    Vector3 up = Vector3::UnitZ();
};

// A round wire along a line. Its cross-sections, across the tangents, are regular polygons of the circle's area (not
// inscribed: so the wire holds as much metal as it should). Closed: the last place joins the first; otherwise the ends
// are flat.
TriangleMesh makeTube(const std::vector<TubePoint>& line, double radius_mm, int segments, bool closed);

// A shape like that of a hip stem: tapered, rounded at the tip, squared in section, its medial flank (+x) flaring
// toward the top. Frame as `cavity`: z along the stem, proximal positive; the top is at z = 0 and the tip at z =
// -length.
struct StemShape {
    double length_mm = 118;
    Vector2 tip_width_mm{10, 9};   // along x (medial-lateral) and y (anterior-posterior), just above the rounding
    Vector2 top_width_mm{25, 15};  // at the top
    double exponent = 3;           // of the cross-sections
    int sections = 60;
    int segments = 64;
};
TriangleMesh makeStem(const StemShape& shape = {});

}  // namespace fluorocut
