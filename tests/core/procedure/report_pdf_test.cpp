// The report as a PDF, read back by a program of others (pdftotext, pdfinfo of poppler); its pictures for the archive.
#include "core/procedure/report_pdf.h"

#include <algorithm>
#include <fstream>

#include <gmock/gmock.h>

#include "core/io/image_file.h"
#include "core/procedure/report.h"
#include "core/procedure/report_captures.h"
#include "core/procedure/report_document.h"
#include "core/procedure/report_picture.h"
#include "tests/support/fixtures.h"
#include "tests/support/program.h"

namespace fluorocut {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

ReportPicture picture(const std::string& title) {
    ReportPicture picture{title, Image(64, 48), {}};
    for (int y = 0; y < 48; ++y)
        for (int x = 0; x < 64; ++x)
            picture.image(x, y) = 1000.0F + 10.0F * static_cast<float>(x);
    picture.curves.push_back({ReportCurve::Kind::planned, {{10, 10}, {50, 10}, {50, 40}}});
    return picture;
}

// With everything in it, long enough for several pages.
ProcedureReport full() {
    ProcedureReport report;
    report.title = "Eingriff bei Frau Müller-Лебедева";
    report.conclusion = "The final cavity lies 0.04 mm from its plan.";
    report.finished = true;
    report.facts = {{"Side", "left"}, {"Newest hash", std::string(64, 'a')}};
    report.calibrations = {{"Robot", "0.020 mm, 0.010° (root mean square)"}, {"Age at time-out 1", "12 min"}};
    report.views = {{"ap", "orbital 0°, angulation 0°", "f 1000.0 mm", 0.12, 0.03, {{"cut 1", 0.08}}}};
    report.plan_pictures = {picture("ap, before the first cut"), picture("lateral, before the first cut")};
    report.budget_at = "0.31 mm (95 %) at the stem's tip";
    report.budget = {{"hand-eye calibration", 0.7}, {"places of the beads", 0.3}};
    for (int k = 1; k <= 3; ++k) {
        ReportStage stage;
        stage.name = "Cut " + std::to_string(k) + " of 3";
        stage.facts = {{"Cutting", "2.8 m in 3 min 24 s"}};
        stage.announced_mm = 1.0 / k;
        stage.measured = {0.3 / k, 0.2};
        stage.measured_bound_mm = 0.1;
        stage.truth = ReportOffset{0.25 / k, 0.11};
        stage.acceptance = {atMost("offset", 0.2, 0.1 * k, "mm")};
        stage.doubts = {"Somebody should look at cut " + std::to_string(k)};
        stage.pictures = {picture("ap, after cut " + std::to_string(k))};
        report.stages.push_back(std::move(stage));
    }
    report.poses = {{"robot from femur", "register", Rigid3::fromTranslation({1.25, -2.5, 3}), 0.05, 0.02}};
    for (int k = 0; k < 60; ++k)
        report.decisions.push_back(
            {"2026-03-01T09:30:00.125Z", "cut " + std::to_string(k), "Dr. X", "why", k % 2 == 0});
    report.software = "FluoroCut 0.1.0";
    report.case_id = "29f126745623285a97ff66ff74377fbe";
    report.newest_hash = std::string(64, 'a');
    report.patient = "Müller^Änne";
    report.side = "left";
    report.created_utc = "2026-03-01T09:30:00.125Z";
    return report;
}

std::string withoutSpace(std::string text) {
    std::erase_if(text, [](unsigned char c) { return c <= ' ' || c == 0x7F; });
    return text;
}

// Every text that the document has.
std::vector<std::string> textsOf(const ReportDocument& document) {
    std::vector<std::string> texts{document.title, document.notice, document.footer};
    for (const ReportSection& section : document.sections) {
        texts.push_back(section.title);
        for (const ReportBlock& block : section.blocks) {
            if (const auto* text = std::get_if<ReportText>(&block)) texts.push_back(text->text);
            if (const auto* facts = std::get_if<ReportFacts>(&block))
                for (const auto& [what, value] : facts->rows)
                    texts.insert(texts.end(), {what, value});
            if (const auto* table = std::get_if<ReportTable>(&block)) {
                for (const auto& column : table->columns)
                    texts.push_back(column.title);
                for (const auto& row : table->rows)
                    for (const ReportCell& cell : row)
                        texts.push_back(cell.text);
            }
            if (const auto* key = std::get_if<ReportKey>(&block))
                for (const auto& entry : key->entries)
                    texts.push_back(entry.label);
            if (const auto* drawing = std::get_if<ReportDrawing>(&block))
                for (const auto& shape : drawing->shapes)
                    texts.push_back(shape.text);
            if (const auto* pictures = std::get_if<ReportPictures>(&block))
                for (const ReportPicture& shown : *pictures->pictures)
                    texts.push_back(shown.title);
        }
    }
    return texts;
}

TEST(ReportPdf, TellsAllThatTheDocumentHas) {
    const test::ScratchFolder scratch;
    const ProcedureReport report = full();
    const std::string path = (scratch / "report.pdf").string();
    ASSERT_OK(writeReport(path, report));
    // -raw: in the order in which it was written, so that a cell's lines stay together.
    const test::Finished read = test::runProgram(
        "/bin/sh", {"-c", "command -v pdftotext >/dev/null || exit 99; pdftotext -raw " + path + " -"});
    if (read.exit_code == 99) GTEST_SKIP() << "no pdftotext";
    ASSERT_EQ(read.exit_code, 0) << read.err;
    const std::string text = withoutSpace(read.out);
    const std::vector<std::string> all = textsOf(documentOf(report));
    ASSERT_GT(all.size(), 300U);
    for (const std::string& wanted : all)
        EXPECT_THAT(text, HasSubstr(withoutSpace(wanted)));
}

TEST(ReportPdf, HtmlTellsTheSame) {
    const ProcedureReport report = full();
    const Result<std::string> page = html(report);
    ASSERT_OK(page);
    for (std::string wanted : textsOf(documentOf(report))) {
        for (std::size_t at = 0; (at = wanted.find('&', at)) != std::string::npos; at += 5)
            wanted.replace(at, 1, "&amp;");
        EXPECT_THAT(*page, HasSubstr(wanted));
    }
}

TEST(ReportPdf, HasNumberedA4PagesAndATitle) {
    const test::ScratchFolder scratch;
    const std::string path = (scratch / "report.pdf").string();
    ASSERT_OK(writeReport(path, full()));
    const test::Finished info =
        test::runProgram("/bin/sh", {"-c", "command -v pdfinfo >/dev/null || exit 99; pdfinfo " + path +
                                               "; pdftotext -raw -f 2 -l 2 " + path + " -"});
    if (info.exit_code == 99) GTEST_SKIP() << "no pdfinfo";
    ASSERT_EQ(info.exit_code, 0) << info.err;
    EXPECT_EQ(info.err, "");
    EXPECT_THAT(info.out, HasSubstr("(A4)"));
    EXPECT_THAT(info.out, HasSubstr("Eingriff bei Frau Müller-Лебедева"));
    const std::size_t at = info.out.find("Pages:");
    ASSERT_NE(at, std::string::npos);
    const int pages = std::stoi(info.out.substr(at + 6));
    EXPECT_GE(pages, 4);
    EXPECT_THAT(info.out, HasSubstr("2 of " + std::to_string(pages)));
}

TEST(ReportPdf, AnEmptyReportAndAnUnreadableNameAreStillPages) {
    ProcedureReport report;
    report.title = "case \xff\xfe";
    const Result<std::string> bytes = pdf(report);
    ASSERT_OK(bytes);
    EXPECT_EQ(bytes->rfind("%PDF-", 0), 0U);
    report.plan_pictures.emplace_back();  // without pixels
    EXPECT_FALSE(pdf(report).ok());
}

TEST(WriteReport, GoesByTheExtension) {
    const test::ScratchFolder scratch;
    ProcedureReport report;
    report.title = "Case";
    for (const auto& [name, begin] : {std::pair("a.pdf", "%PDF-"), {"a.PDF", "%PDF-"}, {"a.html", "<!DOCTYPE html>"}}) {
        ASSERT_OK(writeReport(scratch / name, report));
        std::ifstream stream(scratch / name);
        const std::string text(std::istreambuf_iterator<char>(stream), {});
        EXPECT_EQ(text.rfind(begin, 0), 0U) << name;
    }
    const Result<void> other = writeReport(scratch / "a.doc", report);
    ASSERT_FALSE(other);
    EXPECT_THAT(other.error().message(), HasSubstr(".pdf or .html"));
    EXPECT_FALSE(fs::exists(scratch / "a.doc"));
}

TEST(BurnedIn, ShowsPictureContourAndWords) {
    const ReportPicture shown = picture("ap");
    const Result<ColorImage> drawn = burnedIn(shown, {"Müller, left side", "FluoroCut"});
    ASSERT_OK(drawn);
    ASSERT_EQ(drawn->width(), 1024);  // 16 times as large
    ASSERT_GT(drawn->height(), 768);  // the strip below
    const auto grey = reportGrey(shown);
    ASSERT_OK(grey);
    // Inside the pixel (30, 30), away from lines: its own grey.
    const auto& inside = (*drawn)(30 * 16 + 8, 30 * 16 + 8);
    EXPECT_EQ(inside[0], inside[2]);
    EXPECT_NEAR(inside[0], (*grey)(30, 30), 3);  // between neighbours that differ by some levels
    // On the planned contour, at (50, 25): its blue, where the dash is; so look along it.
    const ReportColor blue = lookOf(ReportCurve::Kind::planned).color;
    int on_curve = 0, white = 0;
    for (int y = 10 * 16 + 8; y < 40 * 16; ++y)
        on_curve += (*drawn)(50 * 16 + 8, y) == blue;
    EXPECT_GT(on_curve, 200);  // of 472, dashes of 4 to gaps of 2.5
    EXPECT_LT(on_curve, 400);
    for (int y = 768; y < drawn->height(); ++y)
        for (int x = 0; x < drawn->width(); ++x)
            white += (*drawn)(x, y)[0] > 200;
    EXPECT_GT(white, 300);  // letters
}

// An intensifier's corners are darker than any bone, the open beam is brighter: neither takes contrast from what
// matters.
TEST(ReportGrey, GivesItsContrastToWhatLiesAboutTheCurves) {
    ReportPicture shown{"ap", Image(200, 200, 1.0F), {}};  // corners: hardly a photon
    for (int y = 40; y < 160; ++y)
        for (int x = 20; x < 180; ++x)
            shown.image(x, y) = x < 60 ? 20000.0F : (x / 10 % 2 == 0 ? 1000.0F : 1300.0F);  // beam; bone and flesh
    shown.curves.push_back({ReportCurve::Kind::planned, {{100, 80}, {120, 120}}});
    const auto grey = reportGrey(shown);
    ASSERT_OK(grey);
    EXPECT_GT((*grey)(115, 100) - (*grey)(105, 100), 60);  // 30 % more photons are a quarter of the scale or more
    EXPECT_GT((*grey)(30, 100), 200);
}

TEST(Captures, OneStudyTwoSeriesAndTheSameUidsAgain) {
    const test::ScratchFolder scratch;
    const ProcedureReport report = full();
    const auto names = writeCaptures(scratch / "first", report, "4711");
    ASSERT_OK(names);
    EXPECT_THAT(*names, ElementsAre("planned_1.dcm", "planned_2.dcm", "final_1.dcm"));
    ASSERT_OK(writeCaptures(scratch / "again", report, "4711"));
    for (const std::string& name : *names) {
        const auto image = readImage(scratch / "first" / name);
        ASSERT_OK(image);
        EXPECT_EQ(image->image.width(), 1024);
        EXPECT_TRUE(image->info.has_identifying_fields);
        std::ifstream one(scratch / "first" / name, std::ios::binary), two(scratch / "again" / name, std::ios::binary);
        const std::string a(std::istreambuf_iterator<char>(one), {}), b(std::istreambuf_iterator<char>(two), {});
        EXPECT_EQ(a, b);  // whatever is sent twice is the same file
    }
    EXPECT_FALSE(writeCaptures(scratch / "first", report).ok());  // nothing is overwritten
    const auto none = writeCaptures(scratch / "none", ProcedureReport());
    ASSERT_FALSE(none);
    EXPECT_EQ(none.error().code, ErrorCode::noSolution);
    EXPECT_FALSE(fs::exists(scratch / "none"));
}

}  // namespace
}  // namespace fluorocut
