#include "core/imaging/carm_image.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

using namespace fluorocut;
using testing::HasSubstr;

namespace {

TEST(CArmImage, OfTheRightSizeWithNumbersIsTaken) {
    CArm carm;
    EXPECT_TRUE(requireTakenBy(carm, Image(carm.columns, carm.rows)));
}

TEST(CArmImage, ASizeThatIsNotTheCArmsIsRefusedByName) {
    CArm carm;
    const Result<void> answer = requireTakenBy(carm, Image(256, 300), "view ap, image");
    ASSERT_FALSE(answer);
    EXPECT_EQ(answer.error().where, "view ap, image");
    EXPECT_THAT(answer.error().message(), HasSubstr("256 x 300"));
    EXPECT_THAT(answer.error().message(), HasSubstr("512 x 512"));
}

TEST(CArmImage, APixelThatIsNoNumberIsRefused) {
    CArm carm;
    for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
        Image image(carm.columns, carm.rows);
        image(17, 400) = bad;
        EXPECT_FALSE(requireTakenBy(carm, image));
    }
}

}  // namespace
