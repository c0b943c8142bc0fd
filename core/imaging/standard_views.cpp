#include "core/imaging/standard_views.h"

#include <stdexcept>

namespace fluorocut {

Rigid3 standardView(StandardView view, const Vector3& target_in_femur, double source_to_target_mm) {
    if (!(source_to_target_mm > 0)) throw std::logic_error("standardView: the distance is not positive");
    Matrix3 rotation;  // rows: the imager's x, y and z in the femur's frame
    if (view == StandardView::ap) {
        rotation << 1, 0, 0, 0, 0, -1, 0, 1, 0;
    } else {
        rotation << 0, -1, 0, 0, 0, -1, 1, 0, 0;
    }
    return {rotation, Vector3(0, 0, source_to_target_mm) - rotation * target_in_femur};
}

CArm standardCArm() {
    CArm carm;
    carm.name = "standard 27 cm flat panel";
    carm.columns = carm.rows = 1024;
    carm.pixel_mm = {0.26, 0.26};
    carm.principal_point_px = {511.5, 511.5};
    carm.focal_length_mm = 1000;
    return carm;
}

}  // namespace fluorocut
