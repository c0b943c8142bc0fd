// phantom corkscrew with the real program: the picture against the pose that comes with it.
#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>

#include "core/fiducial/corkscrew_layout.h"
#include "core/image/blur.h"
#include "core/imaging/carm.h"
#include "core/io/image_file.h"
#include "core/io/pose_file.h"
#include "core/io/resources.h"
#include "tests/app/cli.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using test::cli;
using test::errorMessage;
using test::onlyJson;
using testing::HasSubstr;

class PhantomCorkscrew : public testing::Test {
  protected:
    std::string path(const std::string& name) const { return (scratch_ / name).string(); }
    test::ScratchFolder scratch_;
};

TEST_F(PhantomCorkscrew, ShowsTheCorkscrewWhereTheTruthSaysIt) {
    const auto made = cli({"phantom", "corkscrew", "-o", path("c.png"), "--truth", path("truth.json"), "--roll-deg",
                           "-35", "--at-mm", "4", "-6", "690", "--photons", "1e5", "--json"});
    ASSERT_EQ(made.exit_code, 0) << made.err;
    EXPECT_EQ(onlyJson(made)["visible"], 1.0);
    const auto image = readImage(scratch_ / "c.png");
    ASSERT_OK(image);
    const auto truth = readPose(scratch_ / "truth.json", Frame::imager, Frame::corkscrew);
    ASSERT_OK(truth);
    EXPECT_NEAR(truth->target_from_source.translation().z(), 690, 1e-9);
    EXPECT_NEAR(truth->target_from_source.twistRollPitch().y(), -35 * M_PI / 180, 1e-9);
    const auto layout = readCorkscrew(*findResource("fiducials", "corkscrew"));
    ASSERT_OK(layout);
    // The wire is darker than what lies 5 pixels (1.1 mm, two wires' widths) to both sides of it, nearly everywhere:
    // where it crosses another wire or the shaft it need not be.
    const Image smooth = gaussianBlurred(image->image, 1);
    const CArm carm;
    const auto level = [&](const Vector2& pixel) {
        return smooth(static_cast<int>(std::lround(pixel.x())), static_cast<int>(std::lround(pixel.y())));
    };
    int dark = 0, all = 0;
    for (double t = 0.01; t < 1; t += 0.01) {
        const Vector2 at = carm.project(truth->target_from_source * layout->helix.point(t));
        const Vector2 next = carm.project(truth->target_from_source * layout->helix.point(t + 0.005));
        if ((next - at).norm() < 0.2) continue;  // seen end on
        const Vector2 across = Vector2(at.y() - next.y(), next.x() - at.x()).normalized();
        ++all;
        dark += level(at) < 0.97F * std::min(level(at + 5 * across), level(at - 5 * across)) ? 1 : 0;
    }
    EXPECT_GT(all, 90);
    EXPECT_GT(dark, 0.75 * all);
}

TEST_F(PhantomCorkscrew, TakesThePoseThatItWrites) {
    const auto first = cli({"phantom", "corkscrew", "-o", path("a.mha"), "--truth", path("a.json"), "--seed", "4"});
    ASSERT_EQ(first.exit_code, 0) << first.err;
    const auto second = cli({"phantom", "corkscrew", "-o", path("b.mha"), "--pose", path("a.json"), "--seed", "4"});
    ASSERT_EQ(second.exit_code, 0) << second.err;
    const auto inverted =
        cli({"phantom", "corkscrew", "-o", path("c.mha"), "--pose", path("a.json"), "--seed", "4", "--inverted"});
    ASSERT_EQ(inverted.exit_code, 0) << inverted.err;
    const auto a = readImage(scratch_ / "a.mha"), b = readImage(scratch_ / "b.mha"), c = readImage(scratch_ / "c.mha");
    ASSERT_OK(a);
    ASSERT_OK(b);
    ASSERT_OK(c);
    EXPECT_EQ(a->image, b->image);
    EXPECT_EQ(c->image(100, 100), 65535 - a->image(100, 100));
}

TEST_F(PhantomCorkscrew, WrongUsageIsOneSentence) {
    EXPECT_THAT(cli({"phantom", "corkscrew", "-o", path("a.png"), "--at-mm", "0", "0", "-700"}).err,
                HasSubstr("between source and detector"));
    EXPECT_EQ(cli({"phantom", "corkscrew", "-o", path("a.png"), "--at-mm", "0", "0", "-700"}).exit_code, 2);
    EXPECT_EQ(cli({"phantom", "corkscrew", "-o", path("a.png"), "--corkscrew", "nothing"}).exit_code, 3);
    EXPECT_EQ(cli({"phantom", "corkscrew", "-o", path("a.png"), "--roll-deg", "nan"}).exit_code, 2);
    EXPECT_EQ(cli({"phantom", "corkscrew", "-o", path("a.txt")}).exit_code, 2);
    EXPECT_EQ(cli({"phantom", "corkscrew", "-o", path("a.png"), "--pose", "p.json", "--twist-deg", "3"}).exit_code, 2);
    EXPECT_FALSE(std::filesystem::exists(path("a.png")));
}

TEST_F(PhantomCorkscrew, InfoTellsWhatALayoutIs) {
    const auto told = cli({"info", findResource("fiducials", "corkscrew")->string(), "--json"});
    ASSERT_EQ(told.exit_code, 0) << told.err;
    const auto json = onlyJson(told);
    EXPECT_EQ(json["kind"], "corkscrew");
    EXPECT_EQ(json["rings_x_mm"].size(), 4u);
    EXPECT_EQ(json["helix_turns"], 1.25);
    EXPECT_EQ(json["beads"], 3);
}

}  // namespace
}  // namespace fluorocut
