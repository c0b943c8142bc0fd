// What stands around a picture and at the head of its row, out of the case: which way is which, the scale and its
// plane, angles, focal length, and how well the view's pose is known.
#pragma once

#include <QString>

#include "ui/session/case_state.h"
#include "ui/spreadsheet/overlays.h"
#include "ui/spreadsheet/view_marks.h"

namespace fluorocut::ui {

// "LAO 30°, CRA 5°": the angles of the C-arm's scales (core/imaging/carm_position.h); "AP" at zero.
QString anglesText(const CArmPosition& position);
// "Registered, 0.31 mm rms", or why not.
QString registrationText(const TakenImage& taken);
// Where the bone lies and how it is turned as seen from the source, for a tooltip; empty without a pose.
QString poseText(const TakenImage& taken);

// Letters need the pose. The scale holds in the plane parallel to the detector through the implant, without one
// through the middle of the bone (canal, beads or CT), without a pose in the detector.
ViewMarks marksOf(const CaseState& state, std::size_t view, const Picture& picture);

}  // namespace fluorocut::ui
