#include "ui/spreadsheet/column.h"

#include <gtest/gtest.h>

#include "core/geometry/primitives.h"
#include "tests/support/fixtures.h"

namespace fluorocut::ui {
namespace {

std::shared_ptr<const Image> ramp(float offset) {
    Image image(32, 32);
    for (int y = 0; y < 32; ++y)
        for (int x = 0; x < 32; ++x)
            image(x, y) = offset + static_cast<float>(x);
    return std::make_shared<const Image>(std::move(image));
}

CaseState oneView() {
    CaseState state;
    CaseView view;
    view.carm.columns = view.carm.rows = 32;
    view.carm.pixel_mm = {2, 2};
    view.carm.principal_point_px = {15.5, 15.5};
    view.before.image = ramp(1000);
    view.before.imager_from_femur = Pose{Frame::imager, Frame::femur, Rigid3::fromTranslation({0, 0, 600}), {}};
    state.views.push_back(view);
    return state;
}

QString lacks(const Column& column, const CaseState& state) {
    return missing(column, state, 0);
}

TEST(Column, SaysWhatItLacks) {
    CaseState state = oneView();
    const Column after{.id = "a", .kind = "after"}, second{.id = "b", .kind = "after", .cut = 2};
    const Column predicted{.id = "p", .kind = "predicted"}, cut{.id = "c", .kind = "predicted-cut"};
    EXPECT_EQ(lacks(after, state), "No cut yet.");
    EXPECT_EQ(lacks(predicted, state), "No implant is chosen.");
    EXPECT_EQ(lacks(cut, state), "The cavity is not worked out for this plan.");
    state.views[0].after.push_back(state.views[0].before);
    EXPECT_EQ(lacks(after, state), "");
    EXPECT_EQ(lacks(second, state), "No X-ray after cut 2 yet.");
    state.views[0].before.imager_from_femur.reset();
    state.views[0].before.unregistered_because = "no corkscrew";
    EXPECT_EQ(lacks(predicted, state), "View is not registered: no corkscrew");
    state.views[0].before.image.reset();
    EXPECT_EQ(lacks({.id = "x", .kind = "xray"}, state), "No X-ray yet.");
}

TEST(Column, ADifferenceIsThePictureAfterLessTheOneBefore) {
    CaseState state = oneView();
    TakenImage after = state.views[0].before;
    after.image = ramp(1075);
    state.views[0].after.push_back(after);
    ColumnMemory memory;
    const Column column{.id = "d", .kind = "difference"};
    const auto image = compute(column, state, 0, memory, Progress::none());
    ASSERT_OK(image);
    for (const float level : (*image)->pixels())
        EXPECT_EQ(level, 75);
    EXPECT_EQ(noteOf(column, state, 0), "");
    // The C-arm came back 3 mm aside: 3 / 600 * 1000 / 2 = 2.5 px.
    state.views[0].after[0].imager_from_femur->target_from_source = Rigid3::fromTranslation({3, 0, 600});
    EXPECT_EQ(noteOf(column, state, 0), "The bone lies 2.5 px elsewhere than before");
    state.views[0].after[0].image = std::make_shared<const Image>(16, 16, 1.0F);
    EXPECT_FALSE(compute(column, state, 0, memory, Progress::none()).ok());
}

// The stem takes light away where it stands and nowhere else far from it; from the prediction it differs by nothing
// when the picture after the cut is the prediction.
TEST(Column, APredictionDarkensWhatTheImplantCoversAndADifferenceFromItIsZero) {
    CaseState state = oneView();
    state.plan.mesh = std::make_shared<const TriangleMesh>(makeStem());
    state.plan.cavities = {state.plan.mesh};
    state.plan.femur_from_implant = Rigid3::fromRotationVector({1.5707963, 0, 0});
    ColumnMemory memory;
    const auto with = compute({.id = "p", .kind = "predicted"}, state, 0, memory, Progress::none());
    ASSERT_OK(with);
    EXPECT_LT((**with)(16, 18), 0.8 * (*state.views[0].before.image)(16, 18));
    const auto cut = compute({.id = "c", .kind = "predicted-cut"}, state, 0, memory, Progress::none());
    ASSERT_OK(cut);
    EXPECT_GT((**cut)(16, 18), (*state.views[0].before.image)(16, 18));  // bone is gone
    state.views[0].after.push_back(state.views[0].before);
    state.views[0].after[0].image = *cut;
    const auto difference =
        compute({.id = "d", .kind = "difference", .against = Against::prediction}, state, 0, memory, Progress::none());
    ASSERT_OK(difference);
    for (const float level : (*difference)->pixels())
        EXPECT_EQ(level, 0);
}

TEST(Column, InputsAreWhatItReads) {
    CaseState state = oneView();
    state.plan.mesh = std::make_shared<const TriangleMesh>(makeStem());
    const Column predicted{.id = "p", .kind = "predicted"}, xray{.id = "x", .kind = "xray"};
    const Inputs before = inputsOf(predicted, state, 0), xray_before = inputsOf(xray, state, 0);
    CaseState other = state;
    other.patient = "other";
    other.views[0].position.orbital_rad = 1;
    EXPECT_TRUE(inputsOf(predicted, other, 0) == before);
    const auto changed = [&](const std::function<void(CaseState&)>& change) {
        CaseState next = state;
        change(next);
        EXPECT_TRUE(inputsOf(xray, next, 0) == xray_before);
        return !(inputsOf(predicted, next, 0) == before);
    };
    EXPECT_TRUE(changed([](CaseState& s) { s.plan.femur_from_implant = Rigid3::fromTranslation({1e-9, 0, 0}); }));
    EXPECT_TRUE(changed([](CaseState& s) { s.views[0].carm.focal_length_mm = 999; }));
    EXPECT_TRUE(changed([](CaseState& s) { s.plan.mesh = std::make_shared<const TriangleMesh>(*s.plan.mesh); }));
    EXPECT_TRUE(changed([](CaseState& s) { s.ct = std::make_shared<const Volume>(); }));
    EXPECT_TRUE(changed([](CaseState& s) {
        s.views[0].before.imager_from_femur->target_from_source = Rigid3::fromTranslation({0, 0, 601});
    }));
}

TEST(Column, ListsGoThroughJsonAndBack) {
    std::vector<Column> columns = standardColumns();
    columns.push_back({.id = "mine",
                       .kind = "difference",
                       .title = QString::fromUtf8("Schnitt 2, \"ganz\""),
                       .cut = 2,
                       .against = Against::prediction,
                       .overlays = {OverlayKind::cavity, OverlayKind::uncertainty},
                       .hidden = true});
    const auto back = columnsFromJson(jsonOf(columns));
    ASSERT_OK(back);
    EXPECT_EQ(*back, columns);
}

TEST(Column, RefusesWhatIsNoListOfColumns) {
    for (const auto& [json, part] :
         {std::pair("{", "columns of the spreadsheet"), std::pair("{}", "no array"), std::pair("[{}]", "column 1, id"),
          std::pair(R"([{"id":"a","kind":"xray"},{"id":"a","kind":"xray"}])", "column 2, id"),
          std::pair(R"([{"id":"a","kind":"magic"}])", "found magic"),
          std::pair(R"([{"id":"a","kind":"after","cut":1.5}])", "cut"),
          std::pair(R"([{"id":"a","kind":"after","overlays":["stars"]}])", "stars")}) {
        const auto read = columnsFromJson(json);
        ASSERT_FALSE(read.ok()) << json;
        EXPECT_NE(read.error().message().find(part), std::string::npos) << read.error().message();
    }
}

}  // namespace
}  // namespace fluorocut::ui
