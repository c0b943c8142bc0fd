#include "ui/session/case_document.h"

#include <gmock/gmock.h>

#include "tests/support/fixtures.h"
#include "tests/ui/session/full_case.h"

namespace fluorocut::ui {
namespace {

using testing::HasSubstr;

class CaseDocument : public testing::Test {
  protected:
    test::ScratchFolder scratch_;
    std::filesystem::path path_ = scratch_ / "hip.fluorocut";
};

TEST_F(CaseDocument, ReadsBackEveryFieldAsItWasWritten) {
    const CaseState state = test::fullCase();
    ASSERT_OK(writeCase(path_, state));
    const Result<CaseState> read = readCase(path_);
    ASSERT_OK(read);
    test::expectSame(*read, state);
}

TEST_F(CaseDocument, AnEmptyCaseComesBackEmpty) {
    ASSERT_OK(writeCase(path_, CaseState{}));
    const Result<CaseState> read = readCase(path_);
    ASSERT_OK(read);
    test::expectSame(*read, CaseState{});
}

TEST_F(CaseDocument, TheNewestStateCountsAndContentLiesInTheFileOnce) {
    CaseState state = test::fullCase();
    Result<CaseWriter> writer = CaseWriter::create(path_, "hip");
    ASSERT_OK(writer);
    ASSERT_OK(writer->write(state, "open"));
    const auto contents = [&] { return CaseStore::open(path_, CaseStore::Access::read)->info()->contents; };
    const std::int64_t before = contents();
    for (int edit = 1; edit <= 5; ++edit) {
        state.plan.femur_from_implant = Rigid3::fromTranslation({0.1 * edit, 0, 0});
        ASSERT_OK(writer->write(state, "move"));
    }
    EXPECT_EQ(contents(), before + 5);  // documents, and no image again
    const Result<CaseState> read = readCase(path_);
    ASSERT_OK(read);
    test::expectSame(*read, state);
}

TEST_F(CaseDocument, AnotherWriterGoesOnWithoutWritingContentAgain) {
    CaseState state = test::fullCase();
    ASSERT_OK(writeCase(path_, state));
    const std::int64_t before = CaseStore::open(path_, CaseStore::Access::read)->info()->contents;
    {
        Result<CaseWriter> writer = CaseWriter::append(path_);
        ASSERT_OK(writer);
        state.patient = "another name";
        ASSERT_OK(writer->write(state, "rename"));
    }
    EXPECT_EQ(CaseStore::open(path_, CaseStore::Access::read)->info()->contents, before + 1);
    EXPECT_EQ(readCase(path_)->patient, "another name");
}

TEST_F(CaseDocument, SaysWhatIsNoCaseOfTheDesktop) {
    { ASSERT_OK(CaseStore::create(path_, "of the command line")); }
    const Result<CaseState> read = readCase(path_);
    ASSERT_FALSE(read.ok());
    EXPECT_THAT(read.error().message(), HasSubstr("hip.fluorocut"));
    EXPECT_THAT(read.error().message(), HasSubstr("the desktop has not written to"));
    EXPECT_TRUE(looksLikeCase(path_));
    EXPECT_FALSE(looksLikeCase(scratch_ / "nothing"));
}

TEST_F(CaseDocument, ADamagedDocumentNamesItsField) {
    const auto written = [&](const std::string& text) {
        const std::filesystem::path path = scratch_ / "damaged.fluorocut";
        std::filesystem::remove(path);
        Result<CaseStore> store = CaseStore::create(path, "x");
        EXPECT_OK(store);
        EXPECT_OK(store->addItem({.kind = ItemKind::plan, .schema = "fluorocut/desktop/1", .file_name = "desktop.json"},
                                 text));
        return path;
    };
    const Result<CaseState> unknown_hash = readCase(
        written(R"({"schema": "fluorocut/desktop/1", "edit": "", "patient": "", "side": "", "calibrated_utc": "",
                    "ct": "0000", "mu_water_per_mm": 0.02})"));
    ASSERT_FALSE(unknown_hash.ok());
    EXPECT_THAT(unknown_hash.error().message(), HasSubstr("ct"));
    const Result<CaseState> missing = readCase(written(R"({"schema": "fluorocut/desktop/1", "edit": ""})"));
    ASSERT_FALSE(missing.ok());
    EXPECT_THAT(missing.error().message(), HasSubstr("patient"));
    EXPECT_FALSE(readCase(written("no json at all")).ok());
}

TEST_F(CaseDocument, AFailureLeavesTheOldFile) {
    ASSERT_OK(writeCase(path_, test::fullCase()));
    CaseState bent = test::fullCase();
    struct Bent : Distortion {
        Vector2 distorted(const Vector2& p) const override { return p; }
        Vector2 undistorted(const Vector2& p) const override { return p; }
    };
    bent.views[0].carm.distortion = std::make_shared<Bent>();
    const Result<void> written = writeCase(path_, bent);
    ASSERT_FALSE(written.ok());
    EXPECT_THAT(written.error().message(), HasSubstr("distortion"));
    EXPECT_OK(readCase(path_));
    int files = 0;
    for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(scratch_.path()))
        ++files;
    EXPECT_EQ(files, 1) << "something was left beside it";
}

}  // namespace
}  // namespace fluorocut::ui
