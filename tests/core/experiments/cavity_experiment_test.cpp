#include "core/experiments/cavity_experiment.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fluorocut {
namespace {

using ::testing::HasSubstr;

// The table's last columns are those of its others, to the rounding of what is printed.
TEST(CavityExperiment, PapersTableIsOfOnePiece) {
    double mm = 0, deg = 0;
    for (const PaperCavityTrial& trial : paperCavityTable()) {
        EXPECT_NEAR((trial.expected.shift_mm - trial.computed.shift_mm).norm(), trial.error_mm, 0.01);
        EXPECT_NEAR(degreesFromRadians((trial.expected.roll_pitch_yaw_rad - trial.computed.roll_pitch_yaw_rad).norm()),
                    trial.error_deg, 0.01);
        mm += trial.error_mm / kPaperCavityTrials;
        deg += trial.error_deg / kPaperCavityTrials;
    }
    EXPECT_NEAR(mm, 0.20, 0.005);
    EXPECT_NEAR(deg, 0.98, 0.005);
}

TEST(CavityExperiment, OffsetsRoundTrip) {
    const Vector3 middle(3, -2, -55);
    const CavityOffset offset{{1, -2, 3}, {0.03, -0.02, 0.05}};
    const Rigid3 motion = offset.about(middle);
    EXPECT_LT((motion * middle - middle - offset.shift_mm).norm(), 1e-12);  // it turns about the middle
    const CavityOffset back = CavityOffset::from(motion, middle);
    EXPECT_LT((back.shift_mm - offset.shift_mm).norm(), 1e-12);
    EXPECT_LT((back.roll_pitch_yaw_rad - offset.roll_pitch_yaw_rad).norm(), 1e-12);
    // Yaw alone is a turn about z.
    const Rigid3 yaw = CavityOffset{Vector3::Zero(), {0, 0, 0.1}}.about(Vector3::Zero());
    EXPECT_LT((yaw * Vector3(1, 0, 0) - Vector3(std::cos(0.1), std::sin(0.1), 0)).norm(), 1e-12);
}

TEST(CavityExperiment, RefusesOptionsOutsideTheirLimits) {
    CavityExperimentOptions options;
    options.scenes.voxel_mm = 0;
    EXPECT_THAT(runCavityExperiment(options).error().message(), HasSubstr("voxel_mm"));
    CavityExperimentOptions negative;
    negative.random_trials = -1;
    EXPECT_THAT(runCavityExperiment(negative).error().message(), HasSubstr("random_trials"));
}

TEST(CavityExperiment, FiguresCountWhatWasAnswered) {
    CavityExperiment experiment;
    CavityAnswer good;
    good.answered = good.accepted = true;
    good.error_mm = 0.1;
    good.error_deg = 0.4;
    good.yaw_error_deg = -0.3;
    good.chi_square = 5;
    good.elapsed_ms = 10;
    CavityAnswer gross = good;
    gross.error_mm = 1.5;
    gross.chi_square = 50;
    CavityAnswer none;
    none.elapsed_ms = 1;
    for (const CavityAnswer& answer : {good, gross, none})
        experiment.trials.push_back({{}, false, {answer}});
    experiment.trials.push_back({{}, true, {good}});
    const CavityFigures figures = experiment.figures(0, false);
    EXPECT_EQ(figures.trials, 3);
    EXPECT_EQ(figures.answered, 2);
    EXPECT_EQ(figures.accepted, 2);
    EXPECT_EQ(figures.gross, 1);
    EXPECT_EQ(figures.gross_accepted, 1);
    EXPECT_NEAR(figures.mm.mean, 0.8, 1e-12);
    EXPECT_NEAR(figures.yaw_deg.mean, 0.3, 1e-12);
    EXPECT_NEAR(figures.covered, 0.5, 1e-12);
    EXPECT_EQ(experiment.figures(0, true).trials, 1);
}

// One motion of the table in a coarse scene: each method keeps the promise of its kind.
TEST(CavityExperiment, OneRandomCutSlow) {
    CavityExperimentOptions options;
    options.paper_trials = false;
    options.random_trials = 1;
    options.scenes.voxel_mm = 1;
    options.scenes.pixel_mm = 0.5;
    options.estimators = {CavityEstimator::paper, CavityEstimator::full};
    const Result<CavityExperiment> done = runCavityExperiment(options);
    ASSERT_TRUE(done) << done.error().message();
    ASSERT_EQ(done->trials.size(), 1U);
    const CavityTrial& trial = done->trials[0];
    const CavityAnswer &paper = trial.answers[0], &full = trial.answers[1];
    ASSERT_TRUE(full.answered) << full.refusal;
    EXPECT_TRUE(full.accepted) << full.refusal;
    EXPECT_LT(full.error_mm, 0.2);
    EXPECT_LT(full.error_deg, 0.8);
    ASSERT_TRUE(paper.answered) << paper.refusal;
    EXPECT_FALSE(paper.accepted);  // it does not know the turn about the stem
    EXPECT_LT(paper.error_mm, 1);
    const double yaw = degreesFromRadians(trial.expected.roll_pitch_yaw_rad.z());
    EXPECT_NEAR(paper.yaw_error_deg, -yaw, 0.7);
}

}  // namespace
}  // namespace fluorocut
