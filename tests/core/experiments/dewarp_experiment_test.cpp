// The paper's dewarp test with its accuracy goals. Noise: 500 to 2000 photons per pixel, grooves of 5 to 8 % contrast,
// scatter, glare, detector blur; seeds as stated.
#include "core/experiments/dewarp_experiment.h"

#include <cstdio>

#include <gmock/gmock.h>

#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

void show(const char* title, const DewarpExperimentResult& result) {
    std::printf("%s: %d trials, %d refused, %d wrong, %.0f ms to find, %.0f ms to fit\n", title, result.trials,
                result.refused, result.wrong, result.detect_ms, result.fit_ms);
    for (const DewarpModelFigures& m : result.models) {
        std::printf("  %-18s beads %.4f %.4f (max %.3f %.3f)  map %.4f %.4f (95 %% %.3f %.3f)  %d fits, %.2f\n",
                    m.model.c_str(), m.beads_centre.mean, m.beads_margin.mean, m.beads_centre.largest,
                    m.beads_margin.largest, m.map_centre.mean, m.map_margin.mean, m.map_centre.percentile_95,
                    m.map_margin.percentile_95, m.fits, m.coverage);
    }
}

TEST(DewarpExperimentSlow, ClearImagesMeetTheGoals) {
    DewarpExperimentOptions options;
    options.trials = 8;
    options.seed = 1;

    const auto result = runDewarpExperiment(options);
    ASSERT_OK(result);
    show("clear, 0.32 mm", *result);
    EXPECT_EQ(result->wrong, 0);
    EXPECT_EQ(result->refused, 0);
    EXPECT_LE(result->models[0].beads_centre.mean, 0.02);
    EXPECT_LE(result->models[0].beads_margin.mean, 0.03);
}

TEST(DewarpExperimentSlow, ImagesWithObjectsMeetTheGoals) {
    DewarpExperimentOptions options;
    options.trials = 8;
    options.seed = 2;

    options.objects = true;
    const auto result = runDewarpExperiment(options);
    ASSERT_OK(result);
    show("objects, 0.32 mm", *result);
    EXPECT_EQ(result->wrong, 0);
    EXPECT_LE(result->refused, 0);
    EXPECT_LE(result->models[0].beads_centre.mean, 0.03);
    EXPECT_LE(result->models[0].beads_margin.mean, 0.05);
}

}  // namespace
}  // namespace fluorocut
