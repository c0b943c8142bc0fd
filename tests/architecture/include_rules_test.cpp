// The test of the test: every rule refuses a bad example and lets the good one beside it pass.
#include "tests/architecture/include_rules.h"

#include <gmock/gmock.h>

namespace fluorocut::architecture {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::string quoted(std::string_view file, std::string path) {
    return includeViolation(file, {7, std::move(path), true});
}
std::string angled(std::string_view file, std::string path) {
    return includeViolation(file, {7, std::move(path), false});
}

TEST(IncludesOf, FindsEveryFormWithItsLine) {
    const auto found = includesOf("#pragma once\n#include <vector>\n  #  include \"core/base/result.h\"  // why\n");
    ASSERT_EQ(found.size(), 2u);
    EXPECT_EQ(found[0].path, "vector");
    EXPECT_EQ(found[0].line, 2);
    EXPECT_FALSE(found[0].quoted);
    EXPECT_EQ(found[1].path, "core/base/result.h");
    EXPECT_EQ(found[1].line, 3);
    EXPECT_TRUE(found[1].quoted);
}

TEST(IncludesOf, PassesOverComments) {
    EXPECT_THAT(includesOf("// #include <QWidget>\n/* a\n#include <QWidget>\n*/\n"), IsEmpty());
    EXPECT_EQ(includesOf("/* one line */\n#include <vector>\n").size(), 1u);
}

TEST(IncludeRules, RoomsPointOneWay) {
    EXPECT_THAT(quoted("core/image/image.cpp", "ui/spreadsheet/image_view.h"), HasSubstr("core never includes ui"));
    EXPECT_THAT(quoted("core/image/image.cpp", "app/cli/report.h"), HasSubstr("nothing but app"));
    EXPECT_THAT(quoted("ui/spreadsheet/image_view.cpp", "app/cli/report.h"), HasSubstr("nothing but app"));
    EXPECT_THAT(quoted("app/cli/main.cpp", "ui/spreadsheet/image_view.h"), HasSubstr("without ui"));
    EXPECT_THAT(quoted("core/image/image.cpp", "tests/support/fixtures.h"), HasSubstr("only tests"));
    EXPECT_EQ(quoted("app/desktop/main.cpp", "ui/spreadsheet/image_view.h"), "");
    EXPECT_EQ(quoted("ui/spreadsheet/image_view.cpp", "core/image/image.h"), "");
    EXPECT_EQ(quoted("tests/app/info_test.cpp", "app/cli/report.h"), "");
}

TEST(IncludeRules, CoreFoldersUseOnlyThoseAboveThem) {
    EXPECT_THAT(quoted("core/io/pose_file.h", "core/imaging/carm.h"), HasSubstr("only those above it"));
    EXPECT_THAT(quoted("core/base/error.h", "core/geometry/rigid3.h"), HasSubstr("only those above it"));
    EXPECT_THAT(quoted("core/basement/x.h", "core/base/error.h"), HasSubstr("not in the list"));
    EXPECT_EQ(quoted("core/imaging/carm_file.cpp", "core/io/json_file.h"), "");
    EXPECT_EQ(quoted("core/imaging/carm.cpp", "core/imaging/carm.h"), "");
}

TEST(IncludeRules, StagesDoNotUseEachOther) {
    EXPECT_THAT(quoted("core/robot/state.cpp", "core/planning/stages.h"), HasSubstr("stages do not use each other"));
    EXPECT_THAT(quoted("core/cavity/locate.cpp", "core/distortion/map.h"), HasSubstr("stages do not use each other"));
    EXPECT_EQ(quoted("core/procedure/loop.cpp", "core/planning/stages.h"), "");
}

TEST(IncludeRules, OnlyAFewMaySeeTheSimulation) {
    const std::string room = "core/simulation/virtual_operating_room.h";
    EXPECT_THAT(quoted("core/registration/beads.cpp", room), HasSubstr("simulation is for"));
    EXPECT_THAT(quoted("core/robot/state.cpp", room), HasSubstr("simulation is for"));
    EXPECT_THAT(quoted("ui/session/session.cpp", room), HasSubstr("simulation is for"));
    EXPECT_THAT(quoted("core/procedure/loop.cpp", room), HasSubstr("simulation is for"));
    EXPECT_EQ(quoted("core/robot/adaptors/simulated_robot.cpp", room), "");
    EXPECT_THAT(quoted("ui/session/session.cpp", "core/simulation/truth.h"), HasSubstr("is for"));
    EXPECT_EQ(quoted("app/cli/commands/phantom.cpp", "core/simulation/femur_phantom.h"), "");
}

TEST(IncludeRules, ThirdPartyHeadersStayInSources) {
    for (const char* header : {"itkImage.h", "vtkPolyData.h", "opencv2/core.hpp", "assimp/scene.h",
                               "dcmtk/dcmdata/dctk.h", "itkImage.hxx"}) {
        EXPECT_THAT(angled("ui/scene/view.h", header), HasSubstr("stay in .cpp")) << header;
        EXPECT_EQ(angled("ui/scene/view.cpp", header), "") << header;
    }
    EXPECT_EQ(angled("core/io/volume_file.cpp", "itkImage.h"), "");
    EXPECT_EQ(angled("core/geometry/rigid3.h", "Eigen/Core"), "");
}

TEST(IncludeRules, CoreHasNoQtAndNoRendering) {
    for (const char* header : {"QWidget", "QtCore/QObject", "qobject.h", "vtkRenderer.h"}) {
        EXPECT_NE(angled("core/image/image.cpp", header), "") << header;
        EXPECT_EQ(angled("ui/scene/view.cpp", header), "") << header;
    }
}

TEST(IncludeRules, GdcmIsNowhere) {
    for (const char* header : {"gdcmReader.h", "itkGDCMImageIO.h", "opencv2/imgcodecs.hpp", "opencv2/highgui.hpp"}) {
        EXPECT_THAT(angled("core/io/image_file.cpp", header), HasSubstr("GDCM")) << header;
    }
    EXPECT_EQ(angled("core/io/image_file.cpp", "opencv2/imgproc.hpp"), "");
}

TEST(IncludeRules, IncludesAreWrittenFromTheRoot) {
    EXPECT_THAT(quoted("core/image/volume.cpp", "volume.h"), HasSubstr("from the root"));
    EXPECT_THAT(quoted("core/image/volume.cpp", "../geometry/rigid3.h"), HasSubstr("from the root"));
    EXPECT_THAT(angled("core/image/volume.cpp", "core/image/volume.h"), HasSubstr("with quotes"));
}

TEST(IncludeRules, ASentenceNamesFileLineAndInclude) {
    EXPECT_THAT(quoted("core/io/pose_file.h", "core/imaging/carm.h"),
                HasSubstr("core/io/pose_file.h:7 includes core/imaging/carm.h"));
}

TEST(LinkRules, ReadsWhatAFolderLinks) {
    EXPECT_THAT(linkedFolders("# fluorocut_ui\nfluorocut_library(core io\n  PUBLIC fluorocut_image PRIVATE "
                              "fluorocut_settings fluorocut_geometry fmt::fmt)"),
                ElementsAre("image", "geometry"));
}

TEST(LinkRules, RefusesAnArrowThatRunsTheWrongWay) {
    EXPECT_THAT(linkViolation("io", "imaging"), HasSubstr("only those above it"));
    EXPECT_THAT(linkViolation("io", "spreadsheet"), HasSubstr("not in the list"));
    EXPECT_THAT(linkViolation("robot", "planning"), HasSubstr("stages do not use each other"));
    EXPECT_EQ(linkViolation("imaging", "io"), "");
}

TEST(UnwantedLibraries, AreSeenInTheOutputOfLdd) {
    EXPECT_THAT(
        unwantedLibraries("\tlibgdcmMSFF.so.3.0 => /lib/libgdcmMSFF.so.3.0 (0x1)\n\tlibc.so.6 => /lib/libc.so.6\n"),
        ElementsAre(HasSubstr("libgdcmMSFF")));
    EXPECT_EQ(
        unwantedLibraries("libopencv_imgcodecs.so.406 => /x\nlibQt5Core.so.5 => /x\nlibfoo.so => not found\n").size(),
        3u);
    EXPECT_THAT(unwantedLibraries("\tlibdcmdata.so.17 => /lib/libdcmdata.so.17\n"), IsEmpty());
}

}  // namespace
}  // namespace fluorocut::architecture
