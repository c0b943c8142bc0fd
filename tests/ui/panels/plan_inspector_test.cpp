#include "ui/panels/plan_inspector.h"

#include <QAbstractButton>
#include <QCheckBox>
#include <QComboBox>
#include <QDoubleSpinBox>
#include <QElapsedTimer>
#include <QLabel>
#include <QListWidget>
#include <QScrollArea>
#include <QSignalSpy>
#include <QTableWidget>
#include <QTest>

#include <gtest/gtest.h>

#include "core/base/units.h"
#include "core/geometry/primitives.h"
#include "core/simulation/femur_phantom.h"
#include "tests/support/fixtures.h"
#include "tests/ui/panels/planning_scene.h"
#include "ui/panels/measurements.h"

namespace fluorocut::ui {
namespace {

class PlanInspectorTest : public testing::Test {
  protected:
    PlanInspectorTest() {
        session_.open(test::planningCase());
        inspector_.resize(400, 900);
        inspector_.show();
    }
    template <class T>
    T* child(const char* name) {
        T* found = inspector_.findChild<T*>(name);
        if (!found) throw std::logic_error(std::string("no ") + name);
        return found;
    }
    QDoubleSpinBox* box(const char* field) { return child<NumberField>(field)->box(); }
    // As a hand does: all of it is replaced, then Enter.
    void type(const char* field, const char* text) {
        QDoubleSpinBox* spin = box(field);
        spin->setFocus();
        spin->selectAll();
        QTest::keyClicks(spin, text);
        QTest::keyClick(spin, Qt::Key_Return);
    }
    const ImplantPlan& plan() const { return session_.state()->plan; }
    StemNumbers numbers() const {
        return stemNumbers(seatOf(*session_.state()).seat, plan().femur_from_implant, resectionOf(plan()));
    }

    Session session_;
    MeasureChoice measuring_;
    PlanInspector inspector_{session_, measuring_};
};

TEST_F(PlanInspectorTest, ANumberIsEditedAndTheOthersStay) {
    const StemNumbers before = numbers();
    EXPECT_NEAR(box("varus")->value(), degreesFromRadians(before.varus_rad), 0.005);  // two decimals are shown
    type("varus", "3.5");
    EXPECT_NEAR(degreesFromRadians(numbers().varus_rad), 3.5, 1e-9);
    EXPECT_NEAR(numbers().flexion_rad, before.flexion_rad, 1e-9);
    EXPECT_NEAR(numbers().version_rad, before.version_rad, 1e-9);
    EXPECT_NEAR(numbers().height_mm, before.height_mm, 1e-9);
    EXPECT_EQ(session_.undoText(), "Change varus");
    type("height", "-4");
    EXPECT_NEAR(numbers().height_mm, -4, 1e-9);
    EXPECT_NEAR(degreesFromRadians(numbers().varus_rad), 3.5, 1e-9);
    session_.undo();
    session_.undo();
    EXPECT_NEAR(box("varus")->value(), degreesFromRadians(before.varus_rad), 0.005);
    EXPECT_FALSE(session_.canUndo());
}

TEST_F(PlanInspectorTest, EnterWithoutAChangeIsNoStep) {
    box("version")->setFocus();
    QTest::keyClick(box("version"), Qt::Key_Return);
    box("height")->setFocus();
    EXPECT_FALSE(session_.canUndo());
}

TEST_F(PlanInspectorTest, NumbersFollowTheHand) {
    StemNumbers moving = numbers();
    moving.medial_mm = 7;
    session_.preview(withPose(*session_.state(), femurFromCavity(seatOf(*session_.state()).seat, moving)));
    EXPECT_NEAR(box("medial")->value(), 7, 1e-9);
    session_.dropPreview();
    EXPECT_LT(box("medial")->value(), 6);
}

TEST_F(PlanInspectorTest, ADoubtfulNumberSaysWhy) {
    type("varus", "9");
    EXPECT_FALSE(child<NumberField>("varus")->state().problem.isEmpty());
    type("varus", "1");
    EXPECT_TRUE(child<NumberField>("varus")->state().problem.isEmpty());
    NumberField field("x");
    field.show({50, 0, 10, 1, 0, " mm", {}, false});
    EXPECT_EQ(field.box()->value(), 50);  // shown as it is
}

TEST_F(PlanInspectorTest, ALockedPlanCannotBeEdited) {
    QTest::mouseClick(child<QCheckBox>("lock"), Qt::LeftButton, {}, QPoint(8, 8));
    ASSERT_TRUE(plan().locked);
    EXPECT_EQ(session_.undoText(), "Lock plan");
    for (const char* field : {"varus", "height", "cutter", "stages"})
        EXPECT_FALSE(box(field)->isEnabled()) << field;
    for (const char* button : {"larger", "smaller", "library", "snap", "automatic", "cavities"})
        EXPECT_FALSE(child<QAbstractButton>(button)->isEnabled()) << button;
    EXPECT_FALSE(child<QComboBox>("size")->isEnabled());
    session_.undo();
    EXPECT_TRUE(box("varus")->isEnabled());
}

TEST_F(PlanInspectorTest, SizesStepAndKeepWhatIsAsked) {
    const Vector3 resection = plan().femur_from_implant * Vector3(0, 0, 0);
    QTest::mouseClick(child<QAbstractButton>("larger"), Qt::LeftButton);
    EXPECT_EQ(plan().size, "13");
    EXPECT_LT((plan().femur_from_implant * Vector3(0, 0, 0) - resection).norm(), 1e-9);
    session_.undo();
    child<QComboBox>("kept")->setCurrentIndex(1);
    const Vector3 entry = plan().femur_from_implant * keptPoint(*plan().implant, KeptPoint::entry);
    QTest::mouseClick(child<QAbstractButton>("larger"), Qt::LeftButton);
    EXPECT_LT((plan().femur_from_implant * keptPoint(*plan().implant, KeptPoint::entry) - entry).norm(), 1e-9);
    EXPECT_EQ(child<QComboBox>("size")->currentText(), "13");
}

TEST_F(PlanInspectorTest, ALongerNeckIsAnotherHeadOnTheSameStem) {
    CaseState state = *session_.state();
    state.plan.cavities = {std::make_shared<const TriangleMesh>()};
    session_.open(state);
    const Vector3 head = plan().implant->head_center;
    QComboBox* neck = child<QComboBox>("neck");
    neck->setFocus();
    QTest::keyClick(neck, Qt::Key_Down);  // +4 mm
    EXPECT_EQ(plan().neck_mm, 4);
    EXPECT_NEAR((plan().implant->head_center - head).norm(), 4, 1e-9);
    EXPECT_EQ(plan().cavities.size(), 1u);
    session_.undo();
    EXPECT_EQ(plan().neck_mm, 0);
}

TEST_F(PlanInspectorTest, StagesAreEvenAndEditable) {
    type("stages", "3");
    ASSERT_EQ(plan().insets_mm.size(), 3u);
    EXPECT_NEAR(plan().insets_mm[0], 1, 1e-12);
    EXPECT_NEAR(plan().insets_mm[1], 0.5, 1e-12);
    EXPECT_EQ(plan().insets_mm[2], 0);
    type("inset1", "0.8");
    EXPECT_NEAR(plan().insets_mm[1], 0.8, 1e-12);
    EXPECT_EQ(box("inset1")->maximum(), 1);  // inside the stage before it
    type("cutter", "4");
    EXPECT_EQ(plan().cutter_radius_mm, 4);
    for (int i = 0; i < 3; ++i)
        session_.undo();
    EXPECT_TRUE(plan().insets_mm.empty());
    EXPECT_FALSE(child<QAbstractButton>("cavities")->isEnabled());
    EXPECT_FALSE(child<QAbstractButton>("cavities")->toolTip().isEmpty());
}

TEST_F(PlanInspectorTest, MeasuresAreListedAndRemoved) {
    CaseState state = *session_.state();
    state.measures.push_back({MeasureKind::length, 0, {{40, 60}, {140, 60}}});
    session_.commit("Measure length", state);
    bool shown = false;
    for (const QLabel* label : inspector_.findChildren<QLabel*>())
        shown = shown || label->text() == textOf(measureOf(*session_.state(), session_.state()->measures[0]));
    EXPECT_TRUE(shown);
    QTest::mouseClick(child<QAbstractButton>("remove2"), Qt::LeftButton);  // after leg length and offset
    EXPECT_TRUE(session_.state()->measures.empty());
    session_.undo();
    EXPECT_EQ(session_.state()->measures.size(), 1u);

    QTest::mouseClick(child<QAbstractButton>("measure1"), Qt::LeftButton);
    EXPECT_EQ(measuring_.mode(), MeasureMode::length);
    QTest::mouseClick(child<QAbstractButton>("measure1"), Qt::LeftButton);
    EXPECT_EQ(measuring_.mode(), MeasureMode::none);
}

TEST_F(PlanInspectorTest, WithoutACtItSaysWhatThatMeans) {
    EXPECT_TRUE(inspector_.study().message().contains("CT"));
    EXPECT_FALSE(child<QAbstractButton>("automatic")->isEnabled());
    EXPECT_TRUE(child<QAbstractButton>("automatic")->toolTip().contains("CT"));
}

// At the usual font and at that of the operating room: no text of a control is cut off, nothing lies beyond the side.
TEST_F(PlanInspectorTest, NothingIsClippedAtAnyFont) {
    CaseState state = *session_.state();
    state.plan.insets_mm = {1, 0.5, 0};
    state.measures.push_back({MeasureKind::angle, 0, {{40, 60}, {140, 60}, {40, 60}, {140, 90}}});
    session_.open(state);
    for (const int points : {9, 18, 24}) {
        QFont font = inspector_.font();
        font.setPointSize(points);
        PlanInspector inspector(session_, measuring_);
        inspector.setFont(font);
        inspector.resize(10, 600);  // as narrow as it goes
        inspector.show();
        QTest::qWait(20);
        inspector.resize(inspector.minimumSizeHint().width(), 600);
        QTest::qWait(20);
        const QWidget* content = inspector.findChild<QScrollArea*>()->widget();
        int seen = 0;
        for (const QWidget* widget : content->findChildren<QWidget*>()) {
            if (!widget->isVisible() ||
                !(qobject_cast<const QLabel*>(widget) || qobject_cast<const QAbstractButton*>(widget) ||
                  qobject_cast<const NumberField*>(widget) || qobject_cast<const QComboBox*>(widget)))
                continue;
            ++seen;
            EXPECT_GE(widget->width(), widget->minimumSizeHint().width())
                << points << widget->objectName().toStdString();
            const int right = widget->mapTo(content, QPoint(widget->width(), 0)).x();
            EXPECT_LE(right, inspector.findChild<QScrollArea*>()->viewport()->width())
                << points << widget->objectName().toStdString();
        }
        EXPECT_GT(seen, 30);
    }
}

TEST(ImplantLibraryTest, OffersEveryFamilyAndSize) {
    const ImplantShelf shelf = ImplantShelf::read();
    EXPECT_TRUE(shelf.problems.isEmpty()) << shelf.problems.toStdString();
    ASSERT_GE(shelf.entries.size(), 3u);
    for (const ImplantShelf::Entry& entry : shelf.entries)  // so that a plan's family is found again
        EXPECT_EQ(entry.name, entry.family.name);
    ImplantLibrary library(shelf);
    QSignalSpy chosen(&library, &ImplantLibrary::chosen);
    library.choose("straight", "10");
    library.show();
    QTest::mouseClick(library.findChild<QAbstractButton*>("use"), Qt::LeftButton);
    ASSERT_EQ(chosen.count(), 1);
    EXPECT_EQ(chosen[0][0].toString(), "straight");
    EXPECT_EQ(chosen[0][1].toString(), "10");
    library.findChild<QListWidget*>("families")->setCurrentRow(0);
    EXPECT_EQ(library.findChild<QTableWidget*>("sizes")->rowCount(),
              static_cast<int>(shelf.entries[0].family.sizes.size()));
}

// A short stem, so that it is quick.
TEST_F(PlanInspectorTest, SlowCavitiesAreWorkedOutAndDroppedWhenThePlanChanges) {
    CaseState state = *session_.state();
    StemShape shape;
    shape.length_mm = 30;
    state.plan = {};
    state.plan.mesh = std::make_shared<const TriangleMesh>(makeStem(shape));
    state.plan.insets_mm = {1, 0};
    session_.open(state);
    QSignalSpy finished(&inspector_.jobs(), &PlanJobs::finished);
    QTest::mouseClick(child<QAbstractButton>("cavities"), Qt::LeftButton);
    EXPECT_EQ(inspector_.jobs().running(), PlanJobs::Job::cavities);
    EXPECT_TRUE(child<QAbstractButton>("cancel")->isVisible());
    ASSERT_TRUE(finished.wait(120000));
    ASSERT_TRUE(finished[0][0].toBool()) << finished[0][1].toString().toStdString();
    ASSERT_EQ(plan().cavities.size(), 2u);
    EXPECT_EQ(session_.undoText(), "Work out cavities");
    EXPECT_FALSE(child<QAbstractButton>("cancel")->isVisible());

    // Another inset while it runs: what comes back belongs to no plan there is.
    inspector_.jobs().workOutCavities();
    type("inset0", "1.5");
    EXPECT_TRUE(plan().cavities.empty());
    ASSERT_TRUE(finished.wait(120000));
    EXPECT_FALSE(finished[1][0].toBool());
    EXPECT_TRUE(plan().cavities.empty());
    EXPECT_TRUE(finished[1][1].toString().contains("changed"));

    inspector_.jobs().workOutCavities();
    QElapsedTimer timer;
    timer.start();
    QTest::mouseClick(child<QAbstractButton>("cancel"), Qt::LeftButton);
    ASSERT_TRUE(finished.wait(120000));
    EXPECT_FALSE(finished[2][0].toBool());
    EXPECT_TRUE(plan().cavities.empty());
}

// From nothing but a CT: a stem, the canal, fill and wall; then by hand 3 mm aside, and the numbers follow.
TEST_F(PlanInspectorTest, SlowPlansAutomaticallyFromACt) {
    FemurOptions options;
    options.voxel_mm = 1.2;
    options.pelvis = options.soft_tissue = false;
    const auto femur = generateFemur(options);
    ASSERT_OK(femur);
    CaseState state;
    state.side = "left";
    state.ct = std::make_shared<const Volume>(femur->ct);
    session_.open(state);
    QSignalSpy finished(&inspector_.jobs(), &PlanJobs::finished);
    QTest::mouseClick(child<QAbstractButton>("automatic"), Qt::LeftButton);
    ASSERT_TRUE(finished.wait(300000));
    ASSERT_TRUE(finished[0][0].toBool()) << finished[0][1].toString().toStdString();
    ASSERT_TRUE(plan().implant);
    ASSERT_TRUE(session_.state()->canal);
    EXPECT_LT(std::abs(degreesFromRadians(numbers().varus_rad)), 6);
    QSignalSpy studied(&inspector_.study(), &PlanStudy::changed);
    for (int i = 0; i < 2000 && (!inspector_.study().fit() || inspector_.study().fitIsStale()); ++i)
        studied.wait(300);
    ASSERT_TRUE(inspector_.study().fit());
    ASSERT_FALSE(inspector_.study().fitIsStale());
    EXPECT_TRUE(inspector_.study().message().isEmpty()) << inspector_.study().message().toStdString();
    const double wall = inspector_.study().fit()->least_wall.thickness_mm;
    EXPECT_GT(wall, 0.5);

    session_.commit("Move",
                    withPose(*session_.state(), Rigid3::fromTranslation({4, 0, 0}) * plan().femur_from_implant));
    EXPECT_TRUE(inspector_.study().fitIsStale());
    EXPECT_TRUE(inspector_.study().message().contains("Out of date"));
    for (int i = 0; i < 2000 && inspector_.study().fitIsStale(); ++i)
        studied.wait(300);
    EXPECT_LT(inspector_.study().fit()->least_wall.thickness_mm, wall - 0.5);
}

}  // namespace
}  // namespace fluorocut::ui
