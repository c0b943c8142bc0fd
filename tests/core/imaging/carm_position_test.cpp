#include "core/imaging/carm_position.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/units.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

CArmPosition at(double orbital_deg, double angulation_deg) {
    return {radiansFromDegrees(orbital_deg), radiansFromDegrees(angulation_deg), Vector3::Zero()};
}

TEST(CArmPosition, AnglesNameThePlaceOfTheDetector) {
    for (const double orbital : {-120.0, -30.0, 0.0, 45.0, 90.0}) {
        for (const double angulation : {-40.0, 0.0, 25.0}) {
            const Rigid3 room_from_imager = nominalImagerFromRoom(at(orbital, angulation), 650).inverse();
            const double o = radiansFromDegrees(orbital), a = radiansFromDegrees(angulation);
            const Vector3 detector(std::sin(o) * std::cos(a), -std::cos(o) * std::cos(a), std::sin(a));
            EXPECT_LT((room_from_imager.rotate(Vector3::UnitZ()) - detector).norm(), 1e-12);
            EXPECT_LT((room_from_imager.translation() + 650 * detector).norm(), 1e-9);  // the source opposite
        }
    }
}

// Supine patient, detector in front: seen from below the table, the head is up and the patient's left is on the left.
TEST(CArmPosition, ZeroAnglesShowThePatientFromBehindHeadUp) {
    const Rigid3 imager_from_room = nominalImagerFromRoom(at(0, 0), 650);
    EXPECT_LT((imager_from_room * Vector3(0, 0, 0) - Vector3(0, 0, 650)).norm(), 1e-12);
    EXPECT_LT((imager_from_room * Vector3(10, 0, 0) - Vector3(-10, 0, 650)).norm(), 1e-12);  // left
    EXPECT_LT((imager_from_room * Vector3(0, 10, 0) - Vector3(0, 0, 640)).norm(), 1e-12);    // back: toward the source
    EXPECT_LT((imager_from_room * Vector3(0, 0, 10) - Vector3(0, -10, 650)).norm(), 1e-12);  // head
}

TEST(CArmPosition, AngulationKeepsTheImageUpright) {
    // The image's x axis stays level (in the room's transverse plane) whatever the angles.
    for (const double orbital : {-70.0, 0.0, 90.0}) {
        const Rigid3 room_from_imager = nominalImagerFromRoom(at(orbital, 30), 650).inverse();
        EXPECT_NEAR(room_from_imager.rotate(Vector3::UnitX()).z(), 0, 1e-12);
        EXPECT_LT(room_from_imager.rotate(Vector3::UnitY()).z(), 0);
    }
}

TEST(CArmPosition, MovesWithItsIsocentre) {
    CArmPosition position = at(20, 10);
    position.isocentre_in_room = {30, -20, 100};
    EXPECT_LT((nominalImagerFromRoom(position, 600) * position.isocentre_in_room - Vector3(0, 0, 600)).norm(), 1e-9);
}

TEST(CArmPosition, ValidateNamesTheAngle) {
    EXPECT_OK(at(180, -90).validate());
    EXPECT_EQ(at(200, 0).validate().error().where, "orbital angle");
    EXPECT_EQ(at(0, 91).validate().error().where, "angulation");
    EXPECT_FALSE(at(NAN, 0).validate().ok());
    CArmPosition far;
    far.isocentre_in_room.x() = NAN;
    EXPECT_EQ(far.validate().error().where, "isocentre");
}

}  // namespace
}  // namespace fluorocut
