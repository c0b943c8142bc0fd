// Settings, looks, and what each of them promises to the eye and the hand.
#include <QApplication>
#include <QComboBox>
#include <QFile>
#include <QFontMetrics>
#include <QMenuBar>
#include <QPushButton>
#include <QScreen>
#include <QSignalSpy>
#include <QTest>
#include <cmath>

#include <gtest/gtest.h>

#include "tests/support/fixtures.h"
#include "tests/ui/shell/desktop_at_hand.h"
#include "ui/panels/navigator.h"
#include "ui/shell/case_steps.h"
#include "ui/shell/message_bar.h"
#include "ui/shell/settings.h"
#include "ui/shell/settings_dialog.h"
#include "ui/shell/start_page.h"
#include "ui/shell/theme.h"

namespace fluorocut::ui {
namespace {

QApplication& application() {
    return *qobject_cast<QApplication*>(QApplication::instance());
}

// WCAG 2: of relative luminances.
double contrast(const QColor& a, const QColor& b) {
    const auto luminance = [](const QColor& color) {
        const auto linear = [](double c) { return c <= 0.03928 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4); };
        return 0.2126 * linear(color.redF()) + 0.7152 * linear(color.greenF()) + 0.0722 * linear(color.blueF());
    };
    const double x = luminance(a), y = luminance(b);
    return (std::max(x, y) + 0.05) / (std::min(x, y) + 0.05);
}

class Looks : public testing::TestWithParam<Look> {
  protected:
    ~Looks() override { applyTheme(application()); }
};

TEST_P(Looks, TextCanBeRead) {
    applyTheme(application(), GetParam());
    const QPalette palette = QApplication::palette();
    // WCAG AA asks for 4.5 to 1.
    EXPECT_GE(contrast(palette.color(QPalette::WindowText), palette.color(QPalette::Window)), 4.5);
    EXPECT_GE(contrast(palette.color(QPalette::Text), palette.color(QPalette::Base)), 4.5);
    EXPECT_GE(contrast(palette.color(QPalette::ButtonText), palette.color(QPalette::Button)), 4.5);
    EXPECT_GE(contrast(palette.color(QPalette::PlaceholderText), palette.color(QPalette::Base)), 4.5);
    // Large text and controls: 3 to 1.
    EXPECT_GE(contrast(palette.color(QPalette::HighlightedText), palette.color(QPalette::Highlight)), 3);
}
INSTANTIATE_TEST_SUITE_P(All, Looks, testing::Values(Look::dark, Look::light, Look::operatingRoom));

TEST(OperatingRoom, TextIsLargeAndTargetsAreTwentyMillimetres) {
    applyTheme(application(), Look::operatingRoom);
    EXPECT_GE(QApplication::font().pointSize(), 18);
    const double mm_per_px = 25.4 / QApplication::primaryScreen()->physicalDotsPerInch();
    {
        test::DesktopAtHand desktop;
        QApplication::processEvents();
        EXPECT_GE(desktop.window_.startPage().sampleButton()->height() * mm_per_px, 20);
        desktop.window_.openSample();
        QSignalSpy opened(&desktop.window_, &MainWindow::opened);
        ASSERT_TRUE(opened.wait());
        QApplication::processEvents();
        EXPECT_GE(desktop.window_.menuBar()->height() * mm_per_px, 20);
        desktop.window_.messages().showError("x");
        QApplication::processEvents();
        const auto* close = desktop.window_.messages().findChild<QPushButton*>();
        ASSERT_TRUE(close->isVisible());
        EXPECT_GE(close->height() * mm_per_px, 20);
    }
    applyTheme(application());
    EXPECT_EQ(targetPixels(Look::dark), 0);
}

TEST(SettingsFile, KeepsWhatWasSetAndForgivesWhatIsWrong) {
    const test::ScratchFolder folder;
    const QString file = QString::fromStdString((folder / "s.ini").string());
    {
        Settings settings(file);
        EXPECT_EQ(settings.look(), Look::dark);
        const QSignalSpy changed(&settings, &Settings::lookChanged);
        settings.setLook(Look::operatingRoom);
        settings.setLook(Look::operatingRoom);
        EXPECT_EQ(changed.count(), 1);
        settings.setLanguage("de");
        settings.setCaseFolder("/somewhere");
    }
    {
        Settings settings(file);
        EXPECT_EQ(settings.look(), Look::operatingRoom);
        EXPECT_EQ(settings.language(), "de");
        EXPECT_EQ(settings.caseFolder(), "/somewhere");
    }
    {
        QSettings wrong(file, QSettings::IniFormat);
        wrong.setValue("look", "purple");
        wrong.setValue("language", 17);
        wrong.setValue("layout/state", "nonsense");
    }
    Settings settings(file);
    EXPECT_EQ(settings.look(), Look::dark);
    EXPECT_EQ(settings.language(), "");
    test::DesktopAtHand desktop(file);
    desktop.window_.showCase();
    EXPECT_TRUE(desktop.window_.navigator().isVisible());
}

TEST(SettingsFile, RecentFilesAreTheNewestThatAreStillThere) {
    const test::ScratchFolder folder;
    Settings settings(QString::fromStdString((folder / "s.ini").string()));
    QStringList files;
    for (int i = 0; i < Settings::kMostRecent + 3; ++i) {
        files << QString::fromStdString(folder.path().string()) + QString("/f%1").arg(i);
        QFile(files.last()).open(QIODevice::WriteOnly);
        settings.addRecent(files.last());
    }
    EXPECT_EQ(settings.recentFiles().size(), Settings::kMostRecent);
    EXPECT_EQ(settings.recentFiles().first(), files.last());
    settings.addRecent(files.at(5));
    EXPECT_EQ(settings.recentFiles().first(), files.at(5));
    EXPECT_EQ(settings.recentFiles().count(files.at(5)), 1);
    QFile::remove(files.at(5));
    EXPECT_FALSE(settings.recentFiles().contains(files.at(5)));
    settings.clearRecent();
    EXPECT_TRUE(settings.recentFiles().isEmpty());
}

TEST(SettingsDialogTest, PutsEachChangeIntoEffect) {
    const test::ScratchFolder folder;
    Settings settings(QString::fromStdString((folder / "s.ini").string()));
    SettingsDialog dialog(settings);
    dialog.show();
    dialog.look()->setCurrentIndex(1);
    EXPECT_EQ(settings.look(), Look::light);
    dialog.language()->setCurrentIndex(2);
    EXPECT_EQ(settings.language(), "de");
}

TEST(CaseSteps, FollowWhatTheCaseHolds) {
    const auto marks = [](const CaseState& state) {
        std::vector<StepMark> each;
        for (const NavigatorRow& row : stepsOf(state))
            each.push_back(row.mark);
        return each;
    };
    CaseState state;
    using enum StepMark;
    EXPECT_EQ(marks(state), (std::vector{ready, ready, waiting, waiting}));
    state = test::smallCase();
    state.calibrated_utc = "2026-03-01T09:30:00Z";
    EXPECT_EQ(marks(state), (std::vector{accepted, accepted, accepted, done}));
    state.plan.insets_mm = {1, 0};
    EXPECT_EQ(marks(state),
              (std::vector{accepted, accepted, accepted, stale, waiting, waiting, waiting, waiting, waiting, waiting}));
    state.plan.cavities = {state.plan.mesh, state.plan.mesh};
    state.plan.locked = true;
    EXPECT_EQ(marks(state), (std::vector{accepted, accepted, accepted, accepted, ready, waiting, waiting, waiting,
                                         waiting, waiting}));
    state.views[0].after.resize(1);
    EXPECT_EQ(marks(state), (std::vector{accepted, accepted, accepted, accepted, accepted, accepted, ready, waiting,
                                         waiting, waiting}));
    state.found_cavities.resize(1);
    EXPECT_EQ(marks(state), (std::vector{accepted, accepted, accepted, accepted, accepted, accepted, accepted, ready,
                                         waiting, waiting}));
    state.views[1].before.imager_from_femur.reset();
    EXPECT_EQ(marks(state)[2], done);
}

TEST(NavigatorTest, TellsIconWordAndNumberAndWhichStepWasChosen) {
    Navigator navigator;
    navigator.resize(220, 400);
    navigator.setRows({{"Images", StepMark::accepted, "six views"}, {"Plan", StepMark::stale, "the stem was moved"}});
    navigator.show();
    EXPECT_TRUE(navigator.item(1)->data(Qt::AccessibleTextRole).toString().contains("2 Plan, stale"));
    // The stale mark is not the accepted one: they differ where they are drawn.
    const QImage picture = navigator.grab().toImage();
    const QRect first = navigator.visualItemRect(navigator.item(0)),
                second = navigator.visualItemRect(navigator.item(1));
    const auto icon = [&](const QRect& row) { return picture.copy(row.left() + 8, row.top() + 6, 24, 24); };
    EXPECT_NE(icon(first), icon(second));
    QSignalSpy chosen(&navigator, &Navigator::stepChosen);
    QTest::mouseClick(navigator.viewport(), Qt::LeftButton, {}, second.center());
    ASSERT_EQ(chosen.count(), 1);
    EXPECT_EQ(chosen.at(0).at(0).toInt(), 1);
    navigator.setRows({{"Images", StepMark::accepted, ""}});
    EXPECT_EQ(navigator.count(), 1);
    EXPECT_EQ(chosen.count(), 1);  // following a case is not choosing
}

}  // namespace
}  // namespace fluorocut::ui
