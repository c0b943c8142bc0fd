#include "core/registration/frame_graph.h"

#include <stdexcept>

#include <gmock/gmock.h>

#include "core/registration/chain.h"
#include "tests/core/registration/chain_scene.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

const FrameNode kRobot{Frame::robot, ""}, kFemur{Frame::femur, ""};

FrameNode of(Frame frame, const std::string& view) {
    return {frame, view};
}

// The chain's measurements as edges.
FrameGraph graphOf(const ChainProblem& problem) {
    FrameGraph graph;
    for (const ChainView& view : problem.views) {
        const FrameNode flange = of(Frame::flange, view.name), corkscrew = of(Frame::corkscrew, view.name),
                        imager = of(Frame::imager, view.name);
        graph.add({kRobot, flange, view.robot_from_flange, "robot " + view.name, "2026-03-01T09:30:00Z", "", ""});
        graph.add({flange, corkscrew, problem.flange_from_corkscrew, "hand-eye", "", "hand-eye", ""});
        graph.add({imager, corkscrew, view.imager_from_corkscrew.pose, "corkscrew " + view.name, "", "", ""});
        graph.add({imager, kFemur, view.imager_from_femur.pose, "beads " + view.name, "", "", ""});
    }
    return graph;
}

ChainProblem withoutShared(ChainProblem problem) {
    problem.parameters.clear();
    for (ChainView& view : problem.views) {
        for (PoseMeasurement* one : {&view.imager_from_corkscrew, &view.imager_from_femur}) {
            one->parameters.clear();
            one->sensitivity.resize(6, 0);
        }
    }
    return problem;
}

TEST(FrameGraph, FindsTheChainAndItsCovariance) {
    test::ChainScene scene;
    scene.orbital_deg = {0};
    const ChainProblem problem = withoutShared(scene.problem(nullptr));
    const FrameGraph graph = graphOf(problem);
    const auto found = graph.find(kRobot, kFemur);
    ASSERT_OK(found);
    const auto chain = solveChain(problem);
    ASSERT_OK(chain);
    const Vector6 off = found->pose.target_from_source.deltaFrom(chain->robot_from_femur.target_from_source);
    EXPECT_LT(off.norm(), 1e-9);
    EXPECT_LT((*found->pose.covariance - *chain->robot_from_femur.covariance).norm(),
              1e-8 * chain->robot_from_femur.covariance->norm());
    EXPECT_THAT(found->steps, SizeIs(4));
    EXPECT_EQ(found->text,
              "robot <- flange of v1 (robot v1, 2026-03-01T09:30:00Z) <- corkscrew of v1 (hand-eye) <- imager of v1 "
              "(corkscrew v1) <- femur (beads v1)");
    const auto back = graph.find(kFemur, kRobot);
    ASSERT_OK(back);
    EXPECT_LT((*back->pose.covariance - *found->pose.inverse().covariance).norm(),
              1e-8 * back->pose.covariance->norm());

    const auto shares = graph.budget(*found, {0, 0, -100});
    double sum = 0;
    Matrix3 covariance = Matrix3::Zero();
    for (const StepShare& share : shares) {
        sum += share.share;
        covariance += share.covariance_mm2;
    }
    EXPECT_NEAR(sum, 1, 1e-12);
    EXPECT_LT((covariance - pointCovariance(found->pose, {0, 0, -100})).norm(), 1e-9);
}

TEST(FrameGraph, TakesTheBetterOfTwoPaths) {
    const test::ChainScene scene;
    ChainProblem problem = withoutShared(scene.problem(nullptr));
    *problem.views[0].imager_from_femur.pose.covariance *= 100;
    FrameGraph graph = graphOf(problem);
    auto found = graph.find(kRobot, kFemur);
    ASSERT_OK(found);
    EXPECT_THAT(found->text, HasSubstr("beads v2"));
    // What is stale is not used while there is another way; and not at all unless it is allowed.
    EXPECT_EQ(graph.markStale(of(Frame::imager, "v2"), "the C-arm was moved"), 2);
    found = graph.find(kRobot, kFemur);
    ASSERT_OK(found);
    EXPECT_THAT(found->text, HasSubstr("beads v1"));
    EXPECT_THAT(found->stale, IsEmpty());
    graph.markStale(kFemur, "the patient moved");
    found = graph.find(kRobot, kFemur);
    ASSERT_FALSE(found);
    EXPECT_THAT(found.error().message(), HasSubstr("stale: the patient moved"));
    found = graph.find(kRobot, kFemur, true);
    ASSERT_OK(found);
    EXPECT_THAT(found->stale, ElementsAre("corkscrew v2: the C-arm was moved", "beads v2: the patient moved"));
    EXPECT_FALSE(graph.find(kRobot, of(Frame::plate, "")));
}

TEST(FrameGraph, LoopsThatDoNotCloseAreToldWithTheirGap) {
    test::ChainScene scene;
    Random random(5);
    ChainProblem problem = withoutShared(scene.problem(nullptr));
    FrameGraph good = graphOf(problem);
    ASSERT_THAT(good.loops(), SizeIs(1));
    EXPECT_LT(good.loops()[0].gap_mm, 1e-9);
    EXPECT_GT(good.loops()[0].probability, 0.999);
    problem.views[1].robot_from_flange.target_from_source =
        Rigid3::fromTranslation({0, 3, 0}) * problem.views[1].robot_from_flange.target_from_source;
    const auto loops = graphOf(problem).loops();
    ASSERT_THAT(loops, SizeIs(1));
    EXPECT_LT(loops[0].probability, 1e-6);
    EXPECT_THAT(loops[0].text, HasSubstr("robot v2"));
}

// A loop through two images: the hand-eye error is in it twice, and nearly cancels.
TEST(FrameGraph, ChiSquareOfALoopIsThatOfItsErrors) {
    test::ChainScene scene;
    scene.focal_sigma = 1e-12;
    scene.center_sigma_px = 1e-12;
    scene.hand_eye = test::diagonal(3, 3, 0.01, 0.01);
    Random random(6);
    double sum = 0, likely = 0;
    constexpr int kTrials = 1000;
    for (int i = 0; i < kTrials; ++i) {
        const auto loops = graphOf(scene.problem(&random)).loops();
        ASSERT_THAT(loops, SizeIs(1));
        sum += loops[0].chi_square;
        likely += loops[0].probability > 0.05 ? 1 : 0;
    }
    // Mean 6; standard error of the mean sqrt(12 / 1000) = 0.11, of the share 0.7 %.
    EXPECT_NEAR(sum / kTrials, 6, 0.4);
    EXPECT_NEAR(likely / kTrials, 0.95, 0.025);
}

TEST(FrameGraph, PosesOfOtherFramesAreABrokenContract) {
    FrameGraph graph;
    EXPECT_THROW(graph.add({kRobot, kFemur, {Frame::imager, Frame::femur, {}, {}}, "", "", "", ""}), std::logic_error);
    EXPECT_THROW(graph.add({kRobot, kRobot, {Frame::robot, Frame::robot, {}, {}}, "", "", "", ""}), std::logic_error);
}

}  // namespace
}  // namespace fluorocut
