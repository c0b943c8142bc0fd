// The two views every hip is looked at from, as poses imager_from_femur (DICOM LPS: x to the left, y to the back, z to
// the head, mm).
//
//   ap       The beam goes from front to back. Head up, the patient's left on the right of the picture.
//   lateral  The C-arm turned by 90 degrees about the patient's long axis: the beam goes from right to left. Head up,
//            the patient's front on the right of the picture.
#pragma once

#include "core/geometry/rigid3.h"
#include "core/imaging/carm.h"

namespace fluorocut {

enum class StandardView { ap, lateral };

// The pose that sees `target_in_femur` on the imager's axis (the principal point), at `source_to_target_mm` from the
// source. Throws std::logic_error unless that distance is positive.
Rigid3 standardView(StandardView view, const Vector3& target_in_femur, double source_to_target_mm);

// A flat-panel C-arm, 1000 mm from source to detector with a field of 27 cm, for those who have no file of their own.
CArm standardCArm();
// Where an object stands in it: as near to the detector as a patient allows.
inline constexpr double kStandardObjectDepthMm = 700;

}  // namespace fluorocut
