#include "core/fabrication/drawing.h"

#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <sstream>
#include <stdexcept>

#include <gmock/gmock.h>

namespace fluorocut {
namespace {

using testing::HasSubstr;
using testing::Not;

struct Entity {
    std::string kind;
    std::multimap<int, std::string> groups;
    double number(int code) const { return std::stod(groups.find(code)->second); }
    std::string text(int code) const { return groups.count(code) == 0 ? "" : groups.find(code)->second; }
};

// The entities of a DXF, read back by the rules of the format: pairs of lines, group code and value.
std::vector<Entity> entitiesOf(const std::string& dxf) {
    std::istringstream lines(dxf);
    std::string code, value;
    std::vector<Entity> all;
    bool in_entities = false;
    std::string last;
    while (std::getline(lines, code) && std::getline(lines, value)) {
        const int group = std::stoi(code);
        last = value;
        if (group == 2 && value == "ENTITIES") in_entities = true;
        if (!in_entities) continue;
        if (group == 0 && value == "ENDSEC") in_entities = false;
        if (group == 0) {
            all.push_back({value, {}});
        } else if (!all.empty()) {
            all.back().groups.emplace(group, value);
        }
    }
    EXPECT_EQ(last, "EOF");
    std::erase_if(all, [](const Entity& e) { return e.kind == "ENDSEC"; });
    return all;
}

TEST(Drawing, TakesTheSmallestSheetThatHasRoom) {
    EXPECT_EQ(Drawing({100, 100}).size(), Vector2(297, 210));
    EXPECT_EQ(Drawing({280, 100}).size(), Vector2(420, 297));
    EXPECT_EQ(Drawing({100, 500}).size(), Vector2(841, 594));
    EXPECT_EQ(Drawing({277, 190}).size(), Vector2(297, 210));  // A4 less 10 mm all round
    EXPECT_GT(Drawing({3000, 100}).size().x(), 3000);
    EXPECT_THROW(Drawing({std::numeric_limits<double>::quiet_NaN(), 1}), std::logic_error);
}

TEST(Drawing, SvgIsTrueToSizeAndUpright) {
    Drawing drawing({100, 100});
    drawing.line({10, 20}, {110, 20});
    drawing.circle({50, 60}, 7.5, Pen::hidden);
    const std::string svg = drawing.svg();
    EXPECT_THAT(svg, HasSubstr("width=\"297mm\" height=\"210mm\" viewBox=\"0 0 297 210\""));
    EXPECT_THAT(svg, HasSubstr("class=\"OUTLINE\" d=\"M10 190L110 190\""));  // y is down there
    EXPECT_THAT(svg, HasSubstr("class=\"HIDDEN\" cx=\"50\" cy=\"150\" r=\"7.5\""));
}

TEST(Drawing, DxfReadsBackAsItWasDrawn) {
    Drawing drawing({100, 100});
    drawing.line({10, 20}, {110, 20.5});
    drawing.circle({50, 60}, 7.5, Pen::hidden);
    drawing.arc({1, 2}, 3, 0, std::numbers::pi / 2, Pen::center);
    drawing.text({5, 6},
                 "\xE2\x8C\x80"
                 "5 \xC2\xB1"
                 "0.1 \xC3\xA4",
                 Align::right, 5, std::numbers::pi / 2);
    const auto entities = entitiesOf(drawing.dxf());
    ASSERT_EQ(entities.size(), 4u);
    EXPECT_EQ(entities[0].kind, "LINE");
    EXPECT_EQ(entities[0].text(8), "OUTLINE");
    EXPECT_EQ(entities[0].number(10), 10);
    EXPECT_EQ(entities[0].number(20), 20);
    EXPECT_EQ(entities[0].number(11), 110);
    EXPECT_EQ(entities[0].number(21), 20.5);
    EXPECT_EQ(entities[1].kind, "CIRCLE");
    EXPECT_EQ(entities[1].number(40), 7.5);
    EXPECT_EQ(entities[2].kind, "ARC");
    EXPECT_EQ(entities[2].number(51), 90);
    EXPECT_EQ(entities[3].kind, "TEXT");
    EXPECT_EQ(entities[3].text(1), "%%c5 %%p0.1 ?");
    EXPECT_EQ(entities[3].number(72), 2);
    EXPECT_EQ(entities[3].number(50), 90);
    EXPECT_THAT(drawing.dxf(), HasSubstr("AC1009"));
}

TEST(Drawing, TextCannotBreakTheFiles) {
    Drawing drawing({100, 100});
    drawing.text({5, 6}, "<bead> & \"b\"\n  0\nEOF");
    EXPECT_THAT(drawing.svg(), HasSubstr("&lt;bead&gt; &amp; &quot;b&quot;"));
    const auto entities = entitiesOf(drawing.dxf());
    ASSERT_EQ(entities.size(), 1u);
    EXPECT_THAT(entities[0].text(1), HasSubstr("<bead> & \"b\""));
    EXPECT_THAT(drawing.svg(), Not(HasSubstr("\n  0")));
}

TEST(Drawing, ADimensionMeasuresBetweenItsPoints) {
    Drawing drawing({200, 100});
    drawing.dimensionX({20, 30}, {120, 50}, 10, "100");
    const auto entities = entitiesOf(drawing.dxf());
    double left = 1e9, right = -1e9;
    int arrows = 0;
    for (const Entity& e : entities) {
        if (e.kind == "SOLID") {
            ++arrows;
            left = std::min(left, e.number(10));
            right = std::max(right, e.number(10));
            EXPECT_EQ(e.number(20), 10);  // tips on the dimension line
        }
    }
    EXPECT_EQ(arrows, 2);
    EXPECT_EQ(left, 20);
    EXPECT_EQ(right, 120);
}

TEST(Drawing, LengthsAreWrittenInMillimetresAndWholeInches) {
    EXPECT_EQ(millimetres(6.35), "6.35");
    EXPECT_EQ(millimetres(12), "12");
    EXPECT_EQ(millimetres(-0.00001), "0");
    EXPECT_EQ(millimetresAndInches(6.35), "6.35 [1/4\"]");
    EXPECT_EQ(millimetresAndInches(4.7625), "4.7625 [3/16\"]");
    EXPECT_EQ(millimetresAndInches(311.15), "311.15 [12 1/4\"]");
    EXPECT_EQ(millimetresAndInches(25.4), "25.4 [1\"]");
    EXPECT_EQ(millimetresAndInches(6.3), "6.3");
    EXPECT_FALSE(isWholeInches64(0));
}

}  // namespace
}  // namespace fluorocut
