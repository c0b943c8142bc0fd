#include "core/imaging/imager_cache.h"

#include <atomic>

#include <gmock/gmock.h>

#include "core/geometry/primitives.h"
#include "core/imaging/mesh_projector.h"
#include "core/imaging/volume_projector.h"
#include "tests/core/imaging/blob_volumes.h"
#include "tests/core/imaging/pincushion.h"

namespace fluorocut {
namespace {

// Counts how often it is asked.
class Counted final : public Distortion {
  public:
    Vector2 distorted(const Vector2& u) const override { return bend_.distorted(u); }
    Vector2 undistorted(const Vector2& d) const override {
        ++asked;
        return bend_.undistorted(d);
    }
    mutable std::atomic<int> asked = 0;

  private:
    test::Pincushion bend_{4e-6};
};

TEST(ImagerCache, ASecondProjectionAsksTheDistortionNothingAndIsTheSame) {
    const auto volume =
        test::makeBlobs(test::centeredGrid({32, 32, 32}, Vector3(4, 4, 4)), {{Vector3(5, 0, 0), 20, 1000}});
    const auto projector = VolumeProjector::prepare(volume).value();
    const auto mesh = MeshProjector::prepare(makeSphere(30, 3)).value();
    const auto distortion = std::make_shared<Counted>();
    CArm carm;
    carm.columns = carm.rows = 64;
    carm.pixel_mm.setConstant(2.5);
    carm.principal_point_px.setConstant(31.5);
    carm.distortion = distortion;
    const Rigid3 pose = Rigid3::fromTranslation(Vector3(0, 0, 650));

    const Image first = projector.project(carm, pose), first_mesh = mesh.project(carm, pose);
    EXPECT_EQ(distortion->asked, 2 * 64 * 64);
    EXPECT_EQ(projector.project(carm, pose), first);
    EXPECT_EQ(mesh.project(carm, pose), first_mesh);
    EXPECT_EQ(distortion->asked, 2 * 64 * 64);

    // Another grid of pixels is another matter: nothing of the first may be taken for it.
    CArm moved = carm;
    moved.principal_point_px.x() += 3;
    CArm alone = moved;
    alone.distortion = std::make_shared<Counted>();
    EXPECT_EQ(projector.project(moved, pose), projector.project(alone, pose));
    EXPECT_NE(projector.project(moved, pose), first);
    EXPECT_EQ(projector.project(carm, pose), first);
}

TEST(ImagerCache, KeepsFourOfAllSizesTogether) {
    ImagerCache cache;
    int made = 0;
    const auto ask = [&](int columns, std::size_t bytes) {
        return *cache.get<int>({.columns = columns}, bytes, [&] {
            ++made;
            return std::make_shared<const int>(columns);
        });
    };
    for (const int columns : {1, 2, 3, 4, 1})
        EXPECT_EQ(ask(columns, 10), columns);
    EXPECT_EQ(made, 4);
    EXPECT_EQ(ask(5, 10), 5);  // 2 has waited longest
    EXPECT_EQ(ask(1, 10), 1);
    EXPECT_EQ(made, 5);
    EXPECT_EQ(ask(2, 10), 2);
    EXPECT_EQ(made, 6);
    EXPECT_EQ(ask(6, std::size_t{1} << 30), 6);  // too large to keep, and drops nothing
    EXPECT_EQ(ask(2, 10), 2);
    EXPECT_EQ(made, 7);
    EXPECT_EQ(ask(7, (std::size_t{128} << 20) - 5), 7);  // room for nothing else
    EXPECT_EQ(ask(2, 10), 2);
    EXPECT_EQ(made, 9);
}

}  // namespace
}  // namespace fluorocut
