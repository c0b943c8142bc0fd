#include "core/procedure/report_html.h"

#include <cmath>
#include <regex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/io/image_file.h"
#include "core/procedure/content.h"
#include "core/procedure/report_picture.h"
#include "tests/support/fixtures.h"

using namespace fluorocut;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

namespace {

ProcedureReport twoCuts() {
    ProcedureReport report;
    report.title = "Procedure of <Mr. A & B>";
    report.conclusion = "The cavity lies 0.04 mm from the plan.";
    report.finished = true;
    report.facts = {{"Side", "left"}};
    for (int k = 1; k <= 2; ++k) {
        ReportStage stage;
        stage.name = "Cut " + std::to_string(k);
        stage.announced_mm = 2.5 / (k * k);
        stage.measured = {1.2 / (k * k * k), 0.3};
        stage.measured_bound_mm = 0.1;
        stage.acceptance = {atMost("offset", 0.2, 0.1 * k, "mm")};
        report.stages.push_back(stage);
    }
    report.decisions = {{"2026-03-01T09:30:00.125Z", "cut 1", "Dr. \"X\"", "looks right", true}};
    return report;
}

TEST(ReportHtml, SaysWhatStandsInItAndEscapesIt) {
    const Result<std::string> page = html(twoCuts());
    ASSERT_OK(page);
    EXPECT_THAT(*page, AllOf(HasSubstr("Procedure of &lt;Mr. A &amp; B&gt;"), HasSubstr("0.04 mm from the plan"),
                             HasSubstr("Dr. &quot;X&quot;"), HasSubstr("not a medical device")));
    EXPECT_THAT(*page, Not(HasSubstr("<Mr. A")));
    // The first cut's limit is broken, the second's is kept.
    EXPECT_THAT(*page, AllOf(HasSubstr("over the limit of 0.1"), HasSubstr("limit 0.2")));
}

TEST(ReportHtml, NeedsNothingFromElsewhere) {
    const Result<std::string> page = html(twoCuts());
    ASSERT_OK(page);
    EXPECT_FALSE(std::regex_search(*page, std::regex(R"((src|href)\s*=\s*"(?!data:))")));
    EXPECT_THAT(*page, AllOf(Not(HasSubstr("http")), Not(HasSubstr("<script")), Not(HasSubstr("@import"))));
}

TEST(ReportHtml, TruthStandsInItOnlyWhereThereIsOne) {
    ProcedureReport report = twoCuts();
    EXPECT_THAT(html(report).value(), Not(HasSubstr("truly")));
    report.stages[1].truth = ReportOffset{0.031, 0.02};
    EXPECT_THAT(html(report).value(), AllOf(HasSubstr("truly off the plan"), HasSubstr("0.03 mm, 0.02°")));
}

TEST(ReportHtml, WhatWasNotMeasuredIsSaidAndDrawnNowhere) {
    ProcedureReport report = twoCuts();
    report.stages[0].measured = {};
    report.stages[0].announced_mm = std::nan("");
    const Result<std::string> page = html(report);
    ASSERT_OK(page);
    EXPECT_THAT(*page, AllOf(HasSubstr("not known"), Not(HasSubstr("nan"))));
    ASSERT_THAT(*page, HasSubstr("<circle"));
    EXPECT_EQ(page->find("<circle"), page->rfind("<circle"));  // one
}

// The picture that a browser will decode from the page is the one that went in: decoded here by hand.
TEST(ReportHtml, PicturesLieInItWithTheirContours) {
    ProcedureReport report = twoCuts();
    ReportPicture picture{"AP, after cut 1", Image(7, 5), {}};
    for (int y = 0; y < 5; ++y)
        for (int x = 0; x < 7; ++x)
            picture.image(x, y) = std::exp(0.1F * static_cast<float>(x));
    picture.curves.push_back({ReportCurve::Kind::found, {{0, 0}, {3.25, 2}}});
    report.stages[0].pictures.push_back(picture);
    const Result<std::string> page = html(report);
    ASSERT_OK(page);
    EXPECT_THAT(*page, HasSubstr(R"(class="curve found" points="0.50,0.50 3.75,2.50 ")"));

    const std::string mark = "data:image/png;base64,";
    const std::size_t start = page->find(mark) + mark.size();
    std::string bytes;
    std::uint32_t bits = 0;
    int count = 0;
    for (std::size_t i = start; (*page)[i] != '"' && (*page)[i] != '='; ++i) {
        const char c = (*page)[i];
        const int digit = c >= 'a' ? c - 'a' + 26 : c >= 'A' ? c - 'A' : c >= '0' ? c - '0' + 52 : c == '+' ? 62 : 63;
        bits = bits << 6 | static_cast<std::uint32_t>(digit);
        count += 6;
        if (count >= 8) bytes += static_cast<char>(bits >> (count -= 8) & 255U);
    }
    const Result<Image> decoded = imageFrom("picture.png", bytes);
    ASSERT_OK(decoded);
    ASSERT_EQ(decoded->width(), 7);
    const Result<Image> shown = reportGrey(picture);
    ASSERT_OK(shown);
    for (int x = 0; x < 7; ++x)
        EXPECT_NEAR((*decoded)(x, 2), (*shown)(x, 2), 0.51) << x;  // rounded
    EXPECT_GT((*decoded)(6, 2) - (*decoded)(0, 2), 100);
}

}  // namespace
