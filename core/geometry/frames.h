// The closed list of coordinate frames. All are right-handed, in millimetres.
//
//                       X-ray source
//                            o------> x  (along image columns)
//                           /|        imager
//                          / | y (down the rows)
//                         /  v
//                        /  z
//                       v        femur: DICOM LPS of the CT: +x to the patient's left,
//            _________________          +y to the back, +z to the head
//           /    detector    /   corkscrew: x along the shaft, origin at its middle, phase zero on +y
//          /________________/    cavity: z along the stem, proximal positive
//                                cutter: origin at the tip's centre, z along the spindle, out of the bone
//
//  femur      patient coordinates of the CT (DICOM LPS); without a CT, the frame of the beads or of the first view
//  imager     origin at the X-ray source, +z toward the detector, x along columns, y down the rows; one per view
//  corkscrew  x along the shaft as in equation 6 of the paper, origin at the middle, helix phase zero on +y
//  robot      the robot's base
//  flange     the robot's last link
//  cutter     origin at the centre of the cutter's tip, z along the spindle, out of the bone
//  cavity     the planned implant or cavity: origin at its reference point, z along the stem, proximal positive
//  plate      the grooved distortion plate
//  phantom    any other calibration or test object
#pragma once

#include <optional>
#include <string_view>

namespace fluorocut {

enum class Frame { femur, imager, corkscrew, robot, flange, cutter, cavity, plate, phantom };

std::string_view name(Frame frame);
std::optional<Frame> frameFromName(std::string_view name);

}  // namespace fluorocut
