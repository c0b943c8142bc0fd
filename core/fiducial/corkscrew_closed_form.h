// The paper's closed form of the corkscrew's pose (equations 6 and 7), by weak perspective: a baseline for the tables
// and a rough value. Never a result: ours is corkscrew_pose.h.
//
//     R = Rz(pitch) Ry(roll) Rx(twist)                                                            (6)
//     T_x / T_x' = T_y / T_y' = (f - T_z) / f = k,    k = l cos(roll) / l'                        (7)
//
// pitch: of the shaft's line in the image. |roll| = asin(minor / major axis of the rings' ellipses): the text has the
// names exchanged. k: distance l between rings over its image l', here the slope of all rings' places along the line
// against their x (two rings: the paper's ratio). T': the image of the corkscrew's origin. f - T_z is the distance from
// the source, our z. Twist, and the sign of roll, by a Hough transform of the helix: of all twists and both signs, the
// one whose helix, drawn as (6) and k have it, passes nearest to most of the points seen of it.
//
// Weak perspective takes every part of the corkscrew as equally far and the rays as parallel. With perfect features, at
// (25, -20) mm of 700 and up to 45 degrees of roll, that costs up to 2.7 degrees of roll, 2.2 of pitch, 0.8 mm in the
// plane and 0.6 mm of depth. The middle between the rings is then seen up to 0.6 mm off the origin's place, for which
// the helix turns by up to 11 degrees of twist.
//
// Places: mm in the ideal detector plane, relative to the principal point.
#pragma once

#include <vector>

#include "core/base/result.h"
#include "core/fiducial/corkscrew_layout.h"
#include "core/image/image.h"
#include "core/imaging/carm.h"

namespace fluorocut {

struct CorkscrewFeatures {
    Vector2 line_point_mm = Vector2::Zero();    // on the shaft's middle line
    Vector2 line_direction = Vector2::UnitX();  // of unit length, toward the corkscrew's +x
    std::vector<double> ring_places_mm;         // along the line from line_point_mm; NaN: not seen. As the layout's
    double major_mm = 0, minor_mm = 0;          // half axes that the rings' ellipses share, of the first ring's radius
    std::vector<Vector2> helix_mm;              // points of its middle line, in no order
};

// What the paper measures: a straight line through the shaft, ellipses of common axes along it, the helix between them.
// `near`: a pose within a few degrees and mm (a candidate of corkscrew_detection.h); it says which wire is which and
// which way the axis points. `image`: metal dark. noSolution: too little of it is seen.
Result<CorkscrewFeatures> measureCorkscrewFeatures(const Image& image, const CArm& carm, const CorkscrewLayout& layout,
                                                   const Rigid3& near);

// imager_from_corkscrew. noSolution: fewer than two rings or too few points of the helix.
Result<Rigid3> closedFormCorkscrewPose(const CorkscrewFeatures& features, const CorkscrewLayout& layout,
                                       double focal_length_mm);

}  // namespace fluorocut
