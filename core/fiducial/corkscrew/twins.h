// Twins of a pose: other poses in which the corkscrew's centre lines project almost onto the same lines. They are where
// an estimate can be wrong without its picture showing it at a glance:
//
//   roll         out of the image plane to the other side (the paper tells the two apart by the helix alone)
//   axis         the other way round; for a symmetric layout not to be told apart by anything
//   twist        another phase of the helix
//
// Worked out from the geometry alone, no image needed.
#pragma once

#include <string>
#include <vector>

#include "core/fiducial/corkscrew_layout.h"
#include "core/imaging/carm.h"

namespace fluorocut::corkscrew {

struct Twin {
    Rigid3 imager_from_corkscrew;
    double overlap = 0;  // 0 to 1: share of its lines that lie on the pose's lines
    bool other_roll = false;
    bool other_axis = false;

    // "with its axis the other way round", "rolled to the other side", "twisted by another angle".
    std::string inWords() const;
};

// The twins that overlap by `least_overlap` or more, the most alike first; at most one twist of each kind. `pose`
// itself and what is within 4 degrees of it are not among them.
std::vector<Twin> twins(const CArm& carm, const CorkscrewLayout& layout, const Rigid3& pose,
                        double least_overlap = 0.5);

}  // namespace fluorocut::corkscrew
