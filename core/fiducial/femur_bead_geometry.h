// Whether the beads agree with what co-registration says of how the views lie to each other. For each pair of views
// that show the femur on their own,
//
//     d = log(imager_k_from_femur femur_from_imager_j, against imager_k_from_first first_from_imager_j)
//
// is weighed with the covariances of all four poses; errors that the poses share (focal length) are counted twice,
// which errs on the side of accepting. Frames `imager` of each view and `femur`; mm, rad.
#pragma once

#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/geometry/pose.h"

namespace fluorocut::femur_beads {

struct ViewAlone {
    std::size_t number;  // from 1, as the user gave them
    std::string name;
    Rigid3 imager_from_femur;
    Matrix6 covariance;  // all of it
    Rigid3 imager_from_first;
    Matrix6 covariance_from_first;
};

// invalidInput where a pair contradicts the known geometry, with two views that fit once they are exchanged, or the one
// without which the others agree, when there is one.
Result<void> checkKnownGeometry(const std::vector<ViewAlone>& views);

}  // namespace fluorocut::femur_beads
