// Where a C-arm is asked to stand: the angles on its scales, and what they mean nominally.
//
// Frame `room`: origin at the nominal isocentre, axes along those of a patient lying supine: x to the patient's left, y
// to the back (down), z to the head. Angles as DICOM's positioner (PS3.3 C.8.7.5), which name the place of the
// detector:
//
//     detector = (sin(orbital) cos(angulation), -cos(orbital) cos(angulation), sin(angulation))   seen from isocentre
//
//   orbital     positioner primary angle: 0 with the detector in front of the patient (the beam rises through the
//               table), positive toward the patient's left (LAO); +90 degrees is a lateral view
//   angulation  positioner secondary angle: positive toward the head (cranial)
//
// The picture is the imager frame's (core/geometry/frames.h): as seen from the source along the beam. At zero angles x
// runs to the patient's right and y to the feet.
#pragma once

#include "core/base/result.h"
#include "core/geometry/rigid3.h"

namespace fluorocut {

struct CArmPosition {
    double orbital_rad = 0;
    double angulation_rad = 0;
    Vector3 isocentre_in_room = Vector3::Zero();  // mm: the C moved along the table, up, or sideways

    // Names the field, the value and the limit.
    Result<void> validate() const;

    friend bool operator==(const CArmPosition&, const CArmPosition&) = default;
};

// Where the imager then is, if the C-arm does exactly what its scales say.
Rigid3 nominalImagerFromRoom(const CArmPosition& position, double source_to_isocentre_mm);

}  // namespace fluorocut
