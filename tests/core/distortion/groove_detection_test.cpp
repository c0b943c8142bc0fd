#include "core/distortion/groove_detection.h"

#include <gmock/gmock.h>

#include "tests/core/distortion/groove_truth.h"
#include "tests/core/distortion/plate_images.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::BentField;
using test::compareWithTruth;
using test::GrooveTruth;
using test::PlateImageOptions;
using test::renderPlate;
using testing::HasSubstr;

Result<GrooveDetection> detect(const Image& image, const GroovedPlate& plate = {}) {
    return detectGrooves(image, plate, {}, Progress::none());
}

TEST(GrooveDetection, FindsEveryGrooveOfABentFieldAndSaysHowWell) {
    Random random(11);
    const BentField field = BentField::random(512, 0.32, random);
    PlateImageOptions options;
    const auto found = detect(renderPlate(field, options, 1).image);
    ASSERT_OK(found);
    const GrooveTruth truth = compareWithTruth(found->points, field, options.plate.pitch_mm);
    EXPECT_LT(truth.worst_label_error, 0.05);  // pitches; 0.1 px of noise is 0.005
    EXPECT_EQ(found->along_y.found, static_cast<int>(found->points.along_y.size()));
    EXPECT_EQ(found->along_x.found, static_cast<int>(found->points.along_x.size()));
    EXPECT_EQ(found->along_y.found, found->along_y.expected);  // nothing hides any
    EXPECT_GT(found->coverage, 0.95);
    EXPECT_TRUE(found->warnings.empty());
    EXPECT_NEAR(found->contrast, options.contrast, 0.002);
    // A pixel's noise: 2000 photons in the middle, 2320 at the rim.
    EXPECT_NEAR(found->noise, 1 / std::sqrt(2150), 0.001);
    EXPECT_NEAR(found->pitch_px, 6.35 / 0.32, 0.1);
    // 800 points: the scatter of their root mean square is 2.5 %.
    EXPECT_NEAR(test::rootMeanSquare(truth.normalized), 1, 0.08);
}

}  // namespace
}  // namespace fluorocut
