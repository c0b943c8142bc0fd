#include "core/imaging/carm_position.h"

#include <cmath>

#include <fmt/format.h>

#include "core/base/units.h"

namespace fluorocut {

Result<void> CArmPosition::validate() const {
    const double limit = radiansFromDegrees(180);
    if (!(std::abs(orbital_rad) <= limit)) {
        return invalidOption("orbital angle", fmt::format("{} degrees", degreesFromRadians(orbital_rad)),
                             "-180 to 180 degrees");
    }
    if (!(std::abs(angulation_rad) <= limit / 2)) {
        return invalidOption("angulation", fmt::format("{} degrees", degreesFromRadians(angulation_rad)),
                             "-90 to 90 degrees");
    }
    if (!(isocentre_in_room.allFinite() && isocentre_in_room.cwiseAbs().maxCoeff() <= 2000)) {
        return invalidOption(
            "isocentre",
            fmt::format("({}, {}, {}) mm", isocentre_in_room.x(), isocentre_in_room.y(), isocentre_in_room.z()),
            "coordinates of at most 2000 mm");
    }
    return {};
}

Rigid3 nominalImagerFromRoom(const CArmPosition& position, double source_to_isocentre_mm) {
    // At zero angles, as columns: the imager's x, y and z axes in the room.
    Matrix3 zero;
    zero << -1, 0, 0,  //
        0, 0, -1,      //
        0, -1, 0;
    const Eigen::Quaterniond turn = Eigen::AngleAxisd(position.orbital_rad, Vector3::UnitZ()) *
                                    Eigen::AngleAxisd(-position.angulation_rad, Vector3::UnitX());
    const Matrix3 room_from_imager = turn * zero;
    const Vector3 source_in_room = position.isocentre_in_room - source_to_isocentre_mm * room_from_imager.col(2);
    return Rigid3(room_from_imager, source_in_room).inverse();
}

}  // namespace fluorocut
