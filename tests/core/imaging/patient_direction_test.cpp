#include "core/imaging/patient_direction.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

namespace fluorocut {
namespace {

TEST(PatientDirection, NamesTheAxesOfLps) {
    EXPECT_EQ(patientDirection({1, 0, 0}), "L");
    EXPECT_EQ(patientDirection({-3, 0, 0}), "R");
    EXPECT_EQ(patientDirection({0, 0.1, 0}), "P");
    EXPECT_EQ(patientDirection({0, -1, 0}), "A");
    EXPECT_EQ(patientDirection({0, 0, 1}), "H");
    EXPECT_EQ(patientDirection({0, 0, -1}), "F");
}

TEST(PatientDirection, SaysWhichWayItLeansFrom22AndAHalfDegrees) {
    const auto leaning = [](double degrees) {
        const double a = degrees * std::numbers::pi / 180;
        return patientDirection({std::cos(a), -std::sin(a), 0});
    };
    EXPECT_EQ(leaning(22), "L");
    EXPECT_EQ(leaning(23), "LA");
    EXPECT_EQ(leaning(67), "AL");
    EXPECT_EQ(leaning(68), "A");
}

TEST(PatientDirection, HasNoNameForNoDirection) {
    EXPECT_EQ(patientDirection({0, 0, 0}), "");
    EXPECT_EQ(patientDirection({std::numeric_limits<double>::quiet_NaN(), 0, 1}), "");
}

}  // namespace
}  // namespace fluorocut
