#include "core/planning/femur_study.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/planning/implant_file.h"
#include "core/simulation/femur_phantom.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

TEST(FemurStudy, SlowKnowsShaftWallsAndWhatAStemMakesOfThem) {
    FemurOptions options;
    options.voxel_mm = 1.2;
    options.pelvis = options.soft_tissue = false;
    const auto femur = generateFemur(options);
    ASSERT_OK(femur);
    const auto study = studyFemur(femur->ct);
    ASSERT_OK(study);
    EXPECT_EQ(study->seat.side, Side::left);
    EXPECT_LT((study->seat.point - study->shaft.axis.proximal).norm(), 1e-12);
    // The walls reach above the seat, and the canal's axis runs up along the shaft's.
    EXPECT_GT((study->walls.levels.back().center - study->seat.point).dot(study->seat.axis), 3);
    EXPECT_GT(study->canal.direction.dot(study->seat.axis), std::cos(0.03));  // the bow is in both
    EXPECT_GT(study->canal.sigma_mm, 0);

    const auto sizes = loadSizes("straight");
    ASSERT_OK(sizes);
    ASSERT_GT(sizes->size(), 3u);
    const auto proposal = proposeStem(*sizes, study->walls, study->seat);
    ASSERT_OK(proposal);
    for (const Implant& implant : *sizes) {
        if (implant.size != proposal->size) continue;
        // The same numbers as the proposal says of its own pose.
        const auto in_bone = stemInBone(implant, proposal->femur_from_cavity, *study, 10);
        ASSERT_OK(in_bone);
        ASSERT_EQ(in_bone->fill.size(), proposal->fill.size());
        EXPECT_NEAR(in_bone->fill[3].area, proposal->fill[3].area, 1e-12);
        EXPECT_NEAR(in_bone->least_wall.thickness_mm, proposal->least_wall.thickness_mm, 1e-12);
        // 4 mm to the side it cuts deeper.
        const Rigid3 aside = Rigid3::fromTranslation({4, 0, 0}) * proposal->femur_from_cavity;
        const auto worse = stemInBone(implant, aside, *study, 10);
        ASSERT_OK(worse);
        EXPECT_TRUE(worse->least_cut.cut);
        EXPECT_LT(worse->least_wall.thickness_mm, in_bone->least_wall.thickness_mm - 1);
    }
}

TEST(FemurStudy, SaysWhyThereIsNone) {
    const Volume air(VolumeGrid{{40, 40, 60}, Vector3(2, 2, 2)}, -1000.0F);
    const auto study = studyFemur(air);
    ASSERT_FALSE(study.ok());
    EXPECT_EQ(study.error().code, ErrorCode::noSolution);
}

TEST(FemurStudy, AFamilysSizesComeInOrder) {
    const auto sizes = loadSizes("straight", {"ignored", Side::right, 28, 4});
    ASSERT_OK(sizes);
    for (std::size_t i = 0; i < sizes->size(); ++i) {
        EXPECT_EQ((*sizes)[i].side, Side::right);
        EXPECT_EQ((*sizes)[i].head_radius_mm, 14);
        if (i == 0) continue;
        EXPECT_GT((*sizes)[i].stem_length_mm, (*sizes)[i - 1].stem_length_mm);
    }
    EXPECT_FALSE(loadSizes("no such family").ok());
}

}  // namespace
}  // namespace fluorocut
