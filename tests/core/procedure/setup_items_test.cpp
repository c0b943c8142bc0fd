#include "core/procedure/setup_items.h"

#include <map>

#include <gmock/gmock.h>

#include "core/base/random.h"
#include "core/distortion/distortion_map.h"
#include "core/geometry/primitives.h"
#include "tests/core/distortion/synthetic_grooves.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

using testing::HasSubstr;

ProcedureSetup goodSetup() {
    ProcedureSetup setup;
    setup.patient.name = "P-1";
    setup.patient.side = "left";
    VolumeGrid grid;
    grid.size = {5, 4, 3};
    grid.spacing_mm = {0.7, 0.8, 1.1};
    grid.origin_mm = {-10.5, 3.25, 1 / 3.0};
    Volume ct(grid, 12.34F);
    ct(2, 1, 1) = -1000.125F;
    setup.patient.ct = std::make_shared<const Volume>(ct);
    setup.patient.mu_water_per_mm = 0.0206;
    setup.patient.beads = {Frame::femur, {{"b1", {1.1, 2.2, 3.3}, 2}, {"b2", {-7, 0.1, 40}, 1.5}}};
    setup.plan.implant = "cuboid";
    setup.plan.mesh = makeBox({12, 12, 40});
    setup.plan.femur_from_cavity = Rigid3(expRotation({0.1, 0.2, -0.3}), {1, 2, 3});
    setup.plan.cavity.top_mm = 19.75;
    setup.plan.path.most_tilt_rad = 0.1;
    setup.plan.stages = 2;
    setup.plan.insets_mm = {1.5, 0};
    setup.calibration.corkscrew.rings = {{-30, 9, 0.5}, {30, 9, 0.5}};
    Matrix6 covariance = 1e-4 * Matrix6::Identity();
    covariance(0, 4) = covariance(4, 0) = 1e-5;
    setup.calibration.flange_from_corkscrew = {Frame::flange, Frame::corkscrew,
                                               Rigid3(expRotation({0.5, -0.3, 0.8}), {5, 10, 120}), covariance};
    setup.calibration.flange_from_cutter = Rigid3::fromTranslation({1, 2, 90});
    setup.calibration.calibrated_utc = "2026-03-01T09:30:00.125Z";
    setup.limits.envelope_delta_mm = 0.9;
    for (const char* name : {"ap", "lateral"}) {
        ProcedureView view;
        view.name = name;
        view.position.orbital_rad = 0.1 + 0.7 * static_cast<double>(setup.views.size());
        view.position.isocentre_in_room = {1, -2, 3.5};
        view.carm.focal_length_mm = 1000.3;
        setup.views.push_back(view);
    }
    Random random(5);
    const test::BentPlate plate = test::BentPlate::random(512, 0.32, random);
    const DistortionMap map = fitDistortion(test::groovePoints(plate, {}, random), {}).value();
    setup.views[0].carm.distortion = distortionOf(map, setup.views[0].carm).value();
    return setup;
}

// As a case would keep them.
ContentReader keep(const SetupItems& items, std::map<std::string, std::string>& content) {
    for (const CaseContentItem& one : items.items)
        content[one.hash()] = one.bytes;
    return [&content](const std::string& hash) -> Result<std::string> {
        const auto found = content.find(hash);
        if (found == content.end()) return invalidInput("content", hash, "one that is there");
        return found->second;
    };
}

TEST(SetupItems, ComeBackAsTheyWere) {
    const ProcedureSetup setup = goodSetup();
    const Result<SetupItems> items = setupItems(setup);
    ASSERT_OK(items);
    std::map<std::string, std::string> content;
    const ContentReader reader = keep(*items, content);
    const Result<ProcedureSetup> read = readSetup(items->items.back().bytes, reader);
    ASSERT_OK(read);
    EXPECT_EQ(read->patient.ct->voxels(), setup.patient.ct->voxels());
    EXPECT_LT((read->patient.ct->grid().origin_mm - setup.patient.ct->grid().origin_mm).norm(), 1e-9);
    EXPECT_EQ(read->patient.beads.beads[1].center_mm, setup.patient.beads.beads[1].center_mm);
    EXPECT_EQ(read->plan.mesh.triangles.size(), setup.plan.mesh.triangles.size());
    EXPECT_LT(read->plan.femur_from_cavity.deltaFrom(setup.plan.femur_from_cavity).norm(), 1e-12);
    EXPECT_EQ(read->plan.cavity.top_mm, setup.plan.cavity.top_mm);
    EXPECT_EQ(read->plan.path.most_tilt_rad, setup.plan.path.most_tilt_rad);
    EXPECT_EQ(read->plan.insets_mm, setup.plan.insets_mm);
    EXPECT_EQ(*read->calibration.flange_from_corkscrew.covariance, *setup.calibration.flange_from_corkscrew.covariance);
    EXPECT_EQ(read->calibration.calibrated_utc, setup.calibration.calibrated_utc);
    EXPECT_EQ(read->limits.envelope_delta_mm, 0.9);
    ASSERT_EQ(read->views.size(), 2u);
    EXPECT_EQ(read->views[1].position, setup.views[1].position);
    EXPECT_FALSE(read->views[1].carm.distortion);
    ASSERT_TRUE(read->views[0].carm.distortion);
    for (const Vector2& pixel : {Vector2(100, 50), Vector2(400.25, 300)})
        EXPECT_EQ(read->views[0].carm.idealPixel(pixel), setup.views[0].carm.idealPixel(pixel));
}

TEST(SetupItems, ASetupWithAHoleIsRefusedByName) {
    const std::pair<std::function<void(ProcedureSetup&)>, const char*> holes[] = {
        {[](auto& s) { s.patient.name.clear(); }, "patient.name"},
        {[](auto& s) { s.patient.side = "both"; }, "patient.side"},
        {[](auto& s) { s.patient.beads.frame = Frame::phantom; }, "patient.beads"},
        {[](auto& s) { s.plan.mesh.triangles.clear(); }, "plan.mesh"},
        {[](auto& s) { s.plan.insets_mm = {1.5}; }, "plan.insets_mm"},
        {[](auto& s) {
             s.plan.insets_mm = {1.5, 0.1};
         },
         "plan.insets_mm"},
        {[](auto& s) { s.plan.path.cutter.radius_mm = 2; }, "cutter.radius_mm"},
        {[](auto& s) { s.calibration.flange_from_corkscrew.covariance.reset(); }, "flange_from_corkscrew"},
        {[](auto& s) { s.calibration.calibrated_utc = "yesterday"; }, "calibrated_utc"},
        {[](auto& s) { s.calibration.robot_sigma_mm = 0; }, "robot_sigma_mm"},
        {[](auto& s) { s.limits.envelope_delta_mm = std::nan(""); }, "envelope_delta_mm"},
        {[](auto& s) { s.views.clear(); }, "views"},
        {[](auto& s) { s.views[1].name = "ap"; }, "ap a second time"},
        {[](auto& s) { s.views[1].name = "../ap"; }, "a name that a file can have"}};
    for (const auto& [make, named] : holes) {
        ProcedureSetup setup = goodSetup();
        make(setup);
        const Result<SetupItems> items = setupItems(setup);
        ASSERT_FALSE(items.ok()) << named;
        EXPECT_THAT(items.error().message(), HasSubstr(named));
    }
}

TEST(SetupItems, ImagesAreKeptWithoutLoss) {
    Image counts(6, 5, 17.0F);
    counts(2, 3) = 65535;
    Image real(6, 5, 0.1F);
    real(0, 0) = -3.75e-8F;
    for (const Image& image : {counts, real}) {
        const Result<CaseContentItem> item = imageItem("ap", image);
        ASSERT_OK(item);
        const Result<Image> read = imageFrom(item->item.file_name, item->bytes);
        ASSERT_OK(read);
        EXPECT_EQ(*read, image);
    }
    EXPECT_EQ(imageItem("ap", counts)->item.file_name, "ap.png");
}

}  // namespace
}  // namespace fluorocut
