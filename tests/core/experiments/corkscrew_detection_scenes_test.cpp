// Detection of the corkscrew, without a starting guess, over random scenes of an operation.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "core/experiments/corkscrew_scenes.h"
#include "core/fiducial/corkscrew_detection.h"
#include "core/io/resources.h"

namespace fluorocut {
namespace {

CorkscrewSceneOptions operationOf(const char* layout, std::uint64_t seed) {
    CorkscrewSceneOptions options;
    options.layout = readCorkscrew(findResource("fiducials", layout).value()).value();
    options.clutter = CorkscrewClutter::surgery();
    options.most_pitch_rad = std::numbers::pi;  // any in-plane angle, either way round
    options.seed = seed;
    return options;
}

// What a shape fit converges from (corkscrew_refinement.h: 5 degrees, 10 mm of depth), with a margin.
bool near(const Rigid3& a, const Rigid3& b) {
    const Vector3 off = a.translation() - b.translation();
    return a.rotation().angularDistance(b.rotation()) < 4 * std::numbers::pi / 180 && off.head<2>().norm() < 2 &&
           std::abs(off.z()) < 0.03 * b.translation().z();
}

bool holds(const CorkscrewDetection& detection, const Rigid3& truth) {
    return std::any_of(detection.candidates.begin(), detection.candidates.end(),
                       [&](const CorkscrewCandidate& one) { return near(one.imager_from_corkscrew, truth); });
}

struct Tally {
    int scenes = 0, found = 0, polarity = 0;
    std::string missed;
};

Tally tallyOf(const CorkscrewSceneOptions& options, int scenes) {
    const auto prepared = CorkscrewScenes::prepare(options);
    if (!prepared) throw std::runtime_error(prepared.error().message());
    Tally tally;
    for (int i = 0; i < scenes; ++i) {
        const auto scene = prepared->scene(static_cast<std::uint64_t>(i));
        if (!scene) throw std::runtime_error(scene.error().message());
        const auto detection = detectCorkscrew(scene->image, scene->carm, scene->layout);
        ++tally.scenes;
        if (detection && detection->metal_is_bright == scene->inverted) ++tally.polarity;
        if (detection && holds(*detection, scene->imager_from_corkscrew))
            ++tally.found;
        else
            tally.missed += fmt::format(" {}", i);
    }
    return tally;
}

// A handful of each kind; a share is only told by the test below.
TEST(CorkscrewDetectionScenes, AreSolvedOfEveryKindSlow) {
    CorkscrewSceneOptions inverted = operationOf("corkscrew", 101);
    inverted.inverted = 1;
    const Tally bright = tallyOf(inverted, 6);
    EXPECT_EQ(bright.found, bright.scenes) << bright.missed;
    EXPECT_EQ(bright.polarity, bright.scenes);

    CorkscrewSceneOptions bent = operationOf("corkscrew", 102);
    bent.imager.bent = true;
    bent.imagers = 2;
    const Tally in_bent = tallyOf(bent, 6);
    EXPECT_GE(in_bent.found, in_bent.scenes - 1)
        << in_bent.missed;  // scene 2, at 58 degrees of roll, is one that fails

    CorkscrewSceneOptions fine = operationOf("corkscrew", 103);
    fine.imager.size_px = 1024;
    fine.imager.pixel_mm = 0.16;
    const Tally in_fine = tallyOf(fine, 4);
    EXPECT_EQ(in_fine.found, in_fine.scenes) << in_fine.missed;

    const Tally paper = tallyOf(operationOf("corkscrew-paper", 104), 6);
    EXPECT_EQ(paper.found, paper.scenes) << paper.missed;
}

TEST(CorkscrewDetectionScenes, AreSolvedInNinetyNineOfAHundredSlow) {
    CorkscrewSceneOptions options = operationOf("corkscrew", 21);
    options.imager.bent = true;
    options.imagers = 3;
    const Tally tally = tallyOf(options, 300);
    EXPECT_GE(tally.found, 0.99 * tally.scenes) << "of " << tally.scenes << ", missed" << tally.missed;
    EXPECT_GE(tally.polarity, tally.found);
}

}  // namespace
}  // namespace fluorocut
