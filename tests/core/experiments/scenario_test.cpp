#include "core/experiments/scenario.h"

#include <gtest/gtest.h>

#include "core/io/resources.h"
#include "tests/support/fixtures.h"

namespace fluorocut {
namespace {

Result<Scenario> parse(const std::string& fields) {
    return parseScenario("{\"schema\": \"fluorocut/scenario/1\"" + fields + "}", "folder/s.json");
}

TEST(Scenario, LeftOutFieldsHaveTheHeadersDefaults) {
    const auto scenario = parse("");
    ASSERT_OK(scenario);
    EXPECT_EQ(textOf(*scenario), textOf(Scenario{}));
}

TEST(Scenario, WhatIsWrittenIsReadBack) {
    Scenario scenario;
    scenario.name = "all of it";
    scenario.seed = 77;
    scenario.patient.kind = PatientKind::ct;
    scenario.patient.side = Side::right;
    scenario.patient.ct = "/data/hip.nii.gz";
    scenario.patient.voxel_mm = 0.7;
    scenario.patient.soft_tissue = false;
    scenario.implant.stem.clear();
    scenario.implant.cuboid_mm = Vector3(14, 15, 40);
    scenario.placement.femur_from_cavity = Rigid3::fromTranslation({1, 2, 3});
    scenario.placement.axis_mm = {Vector3(1, 2, 3), Vector3(1, 2, -50)};
    scenario.cut.insets_mm = {2, 1, 0};
    scenario.views = {{"ap", 0, 10}, {"lateral", 60, -5}, {"third", -40, 0}};
    scenario.carm.round_field = false;
    scenario.carm.scatter = false;
    scenario.calibration.pictures = false;
    scenario.corkscrew.knock = (Vector6() << 1, 2, 3, 0.1, 0.2, 0.3).finished();
    scenario.beads.count = 11;
    ASSERT_OK(scenario.validate());
    const auto again = parseScenario(textOf(scenario), "folder/s.json");
    ASSERT_OK(again);
    EXPECT_EQ(textOf(*again), textOf(scenario));
    EXPECT_EQ(again->views[1].angulation_deg, -5);
    const Rigid3 turned(expRotation({0.1, 0.2, -0.3}), Vector3(1, 2, 3));  // a matrix's last digit may differ
    scenario.placement.femur_from_cavity = turned;
    const auto third = parseScenario(textOf(scenario), "folder/s.json");
    ASSERT_OK(third);
    EXPECT_LT(third->placement.femur_from_cavity->deltaFrom(turned).norm(), 1e-12);
}

TEST(Scenario, PathsAreRelativeToTheFile) {
    const auto scenario = parse(R"(, "patient": {"kind": "ct", "ct": "../ct/hip.nii"})");
    ASSERT_OK(scenario);
    EXPECT_EQ(scenario->patient.ct, std::filesystem::path("folder/../ct/hip.nii"));
}

TEST(Scenario, SaysWhatIsWrongAndWhere) {
    const auto says = [](const std::string& fields, const std::vector<std::string>& words) {
        const auto scenario = parse(fields);
        ASSERT_FALSE(scenario.ok()) << fields;
        EXPECT_EQ(scenario.error().code, ErrorCode::invalidInput) << fields;
        const std::string message = scenario.error().message();
        EXPECT_NE(message.find("s.json"), std::string::npos) << message;
        for (const std::string& word : words)
            EXPECT_NE(message.find(word), std::string::npos) << word << " in: " << message;
    };
    says(R"(, "sead": 1)", {"sead"});
    says(R"(, "seed": -1)", {"seed", "-1"});
    says(R"(, "seed": 1.5)", {"seed", "1.5"});
    says(R"(, "carm": {"columns": 1e3, "pixle_mm": 1})", {"pixle_mm"});
    says(R"(, "carm": {"pixel_mm": 0})", {"carm.pixel_mm", "0.05"});
    says(R"(, "patient": {"kind": "cow"})", {"kind", "acrylic"});
    says(R"(, "patient": {"kind": "ct"})", {"patient.ct"});
    says(R"(, "patient": {"ct": "a.nii"})", {"patient.ct"});
    says(R"(, "patient": {"side": "middle"})", {"side", "left"});
    says(R"(, "implant": {"stem": "straight", "cuboid_mm": [1, 2, 3]})", {"implant"});
    says(R"(, "implant": {"cuboid_mm": [20, 20, 1]})", {"implant.cuboid_mm", "6"});
    says(R"(, "placement": {"femur_from_cavity": [[1, 0, 0, 0], [0, 2, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]})",
         {"femur_from_cavity"});
    says(R"(, "cut": {"stages": 2, "insets_mm": [1, 0.5]})", {"cut.insets_mm[1]", "0.5"});
    says(R"(, "cut": {"stages": 3, "insets_mm": [1, 0]})", {"cut.insets_mm", "2 insets"});
    says(R"(, "cut": {"stages": 0})", {"cut.stages"});
    says(R"(, "views": [])", {"views"});
    says(R"(, "views": [{"name": "a"}, {"name": "a"}])", {"views[1].name"});
    says(R"(, "views": [{"name": "a", "orbital_deg": 200}])", {"views[0].orbital_deg", "200"});
    says(R"(, "corkscrew": {"knock": [1, 2, 3]})", {"knock"});
    says(R"(, "corkscrew": {"knock": [1, 2, 3, 0, 0, 50]})", {"corkscrew.knock", "50"});
    says(R"(, "beads": {"count": 2})", {"beads.count"});
}

// Every one that comes with the program can be run, but for a CT that it may need.
TEST(Scenario, ThoseThatComeWithTheProgramAreRead) {
    const std::vector<std::string> names = resourceNames("scenarios");
    EXPECT_GE(names.size(), 4U);
    for (const std::string& name : names) {
        const auto scenario = readScenario(name);
        EXPECT_TRUE(scenario.ok()) << name << ": " << (scenario ? "" : scenario.error().message());
    }
    EXPECT_FALSE(readScenario("no-such-scenario").ok());
}

}  // namespace
}  // namespace fluorocut
