#include "core/geometry/exact_sign.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/base/random.h"

namespace fluorocut {
namespace {

int sign(double x) {
    return (x > 0) - (x < 0);
}

TEST(ExactSign, AgreesWithRoundedArithmeticFarFromZero) {
    Random random(1);
    for (int trial = 0; trial < 2000; ++trial) {
        Vector3 v[3];
        for (Vector3& a : v)
            a = {random.normal(), random.normal(), random.normal()};
        const double rounded = v[0].dot(v[1].cross(v[2]));
        if (std::abs(rounded) > 1e-9) {
            EXPECT_EQ(exactTripleProductSign(v[0], v[1], v[2]), sign(rounded));
        }
    }
}

// Integers up to 2^18 have products below 2^54 that a 64-bit integer holds: the truth for triples made coplanar, then
// moved by one unit in one coordinate. Scaled by 1/3 (rounded), they test what doubles cannot hold.
TEST(ExactSign, SeesOneUnitOffAPlane) {
    Random random(2);
    const auto integer = [&] { return static_cast<double>(random.below(1 << 18)) - (1 << 17); };
    int zeros = 0;
    for (int trial = 0; trial < 2000; ++trial) {
        const Vector3 a(integer(), integer(), integer()), b(integer(), integer(), integer());
        Vector3 c = a + b;
        c[trial % 3] += trial % 2;
        const auto i = [](double x) { return static_cast<std::int64_t>(x); };
        const std::int64_t determinant = i(a.x()) * (i(b.y()) * i(c.z()) - i(b.z()) * i(c.y())) +
                                         i(a.y()) * (i(b.z()) * i(c.x()) - i(b.x()) * i(c.z())) +
                                         i(a.z()) * (i(b.x()) * i(c.y()) - i(b.y()) * i(c.x()));
        const int truth = (determinant > 0) - (determinant < 0);
        zeros += truth == 0;
        EXPECT_EQ(exactTripleProductSign(a, b, c), truth);
        EXPECT_EQ(exactTripleProductSign(b, a, c), -truth);
        EXPECT_EQ(exactTripleProductSign(b, c, a), truth);
    }
    EXPECT_GE(zeros, 1000);
}

TEST(ExactSign, SeesTheLastBitOfAProduct) {
    const double x = 1 + 0x1p-52, y = 1 - 0x1p-53;  // x * y = 1 + 2^-53 - 2^-105: rounds to 1
    EXPECT_EQ(exactProductDifferenceSign(x, y, 1, 1), 1);
    EXPECT_EQ(exactProductDifferenceSign(1, 1, x, y), -1);
    EXPECT_EQ(exactProductDifferenceSign(3, 7, 7, 3), 0);
    EXPECT_EQ(exactTripleProductSign({x, 0, 0}, {0, y, 1}, {0, 1, 1 / 3.0}), sign(y / 3 - 1));
}

}  // namespace
}  // namespace fluorocut
