// Moving an implant by hand, in a view or by its own axes: from a pose and what the hand does to the next pose. Every
// function is exact and keeps whatever it does not name.
//
// In a view the hand moves in the image plane and turns about the view's axis (imager z), so that depths stay as they
// are; a point at depth z below pixel p lies at  z / f * detectorPoint(p),  distortion taken out. Frames: `femur` (the
// view's world) from `cavity` (the implant, core/planning/implant.h); mm, rad.
#pragma once

#include <optional>
#include <string>

#include "core/geometry/triangle_mesh.h"
#include "core/imaging/rays.h"
#include "core/planning/bone_walls.h"
#include "core/planning/implant.h"
#include "core/planning/implant_family.h"

namespace fluorocut {

// Where a stem is held, in its own frame.
struct StemGrip {
    Vector3 shoulder = Vector3::Zero();  // the reference point at the resection
    Vector3 tip = Vector3::Zero();       // on the axis

    Vector3 middle() const { return 0.5 * (shoulder + tip); }
    double length() const { return (shoulder - tip).norm(); }
};
// Of a mesh in the frame `cavity`: its lowest level and the resection's, both on the axis.
StemGrip gripOf(const TriangleMesh& mesh, double resection_z_mm = 0);

// What of the mesh lies under a pixel: midway between where the pixel's ray first enters it and last leaves it, in the
// mesh's frame. Nothing: the ray passes by.
std::optional<Vector3> underPixel(const View& view, const TriangleMesh& mesh, const Rigid3& femur_from_mesh,
                                  const Vector2& pixel);

// ---- in a view. Nothing: no such pose (a point behind the source, a pixel outside the distortion's map) ----

// Moved parallel to the image plane so that the point `held` (implant's frame) is seen at `to_px`, at its own depth.
std::optional<Rigid3> dragged(const View& view, const Rigid3& femur_from_implant, const Vector3& held,
                              const Vector2& to_px);
// Moved by mm in the image plane at the implant's own depth: x along columns, y down the rows.
Rigid3 shifted(const View& view, const Rigid3& femur_from_implant, const Vector2& by_mm);
// Turned about the view's axis through `pivot` (implant's frame); positive as seen in the image from x to y: clockwise.
Rigid3 turned(const View& view, const Rigid3& femur_from_implant, const Vector3& pivot, double angle_rad);
// The angle for turned() with which `handle`, turning about `pivot`, comes to lie toward `to_px`: at its own depth, on
// the line from the pivot to the pixel's ray. In (-pi, pi].
std::optional<double> turnToward(const View& view, const Rigid3& femur_from_implant, const Vector3& pivot,
                                 const Vector3& handle, const Vector2& to_px);
// Tilted about the axis in the image plane across the stem, through `pivot`: positive brings the tip nearer to the
// detector. A stem that points along the view's axis tilts about the image's x.
Rigid3 tilted(const View& view, const Rigid3& femur_from_implant, const Vector3& pivot, double angle_rad);

// ---- by the implant's own axes ----

// About its stem's axis (z) through `pivot`: positive from x toward y.
Rigid3 rolled(const Rigid3& femur_from_implant, const Vector3& pivot, double angle_rad);

// Onto a canal's axis by the least turn: the stem's z along it, `reference` (on the stem's axis) on it, at the level at
// which it was.
Rigid3 snappedTo(const AxisLine& canal, const Rigid3& femur_from_implant, const Vector3& reference);

// ---- another size of the same stem ----

enum class KeptPoint { resection, entry };
// The point that another size leaves where it is, in the implant's frame: the middle of the resection on the stem's
// axis; or the entry, the stem's lateral border in the resection's plane, along which it is driven in.
Vector3 keptPoint(const Implant& implant, KeptPoint kept);
// The pose of `next` with the same axes and the kept point where it was.
Rigid3 resized(const Rigid3& femur_from_implant, const Implant& now, const Implant& next, KeptPoint kept);

// `steps` sizes larger in the family (negative: smaller); nothing beyond its ends or for a size that it does not have.
std::optional<std::string> neighbourSize(const ImplantFamily& family, const std::string& size, int steps);

}  // namespace fluorocut
