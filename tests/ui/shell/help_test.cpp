#include <QFile>
#include <QFileInfo>
#include <QRegularExpression>
#include <QTest>

#include <gtest/gtest.h>

#include "core/io/resources.h"
#include "tests/ui/shell/desktop_at_hand.h"
#include "ui/panels/navigator.h"
#include "ui/shell/help_window.h"
#include "ui/shell/shortcuts_dialog.h"
#include "ui/spreadsheet/sheet.h"

namespace fluorocut::ui {
namespace {

QString content(const QString& page) {
    const auto folder = resourceFolder();
    QFile file(QString::fromStdString((*folder / "help").string()) + "/" + page + ".md");
    EXPECT_TRUE(file.open(QIODevice::ReadOnly)) << page.toStdString();
    return QString::fromUtf8(file.readAll());
}

TEST(Help, EveryPageIsThereAndShown) {
    HelpWindow help;
    for (const QString& page : HelpWindow::pages()) {
        help.showPage(page);
        EXPECT_EQ(help.page(), page);
        EXPECT_GT(help.text().size(), 300) << page.toStdString();
        EXPECT_FALSE(help.text().contains("**")) << page.toStdString() << ": markup that was not understood";
    }
}

TEST(Help, LinksBetweenPagesLeadSomewhere) {
    static const QRegularExpression kLink(R"(\]\(([^)]+)\))");
    int links = 0;
    for (const QString& page : HelpWindow::pages()) {
        auto match = kLink.globalMatch(content(page));
        while (match.hasNext()) {
            const QString target = match.next().captured(1);
            ++links;
            EXPECT_TRUE(HelpWindow::pages().contains(QFileInfo(target).completeBaseName()))
                << page.toStdString() << " leads to " << target.toStdString();
        }
    }
    EXPECT_GE(links, 5);
}

TEST(Help, F1ShowsThePageOfThePlaceWithTheFocus) {
    test::DesktopAtHand desktop;
    MainWindow& window = desktop.window_;
    window.activateWindow();
    ASSERT_TRUE(QTest::qWaitForWindowActive(&window));
    QTest::keyClick(&window, Qt::Key_F1);
    ASSERT_NE(window.help(), nullptr);
    EXPECT_EQ(window.help()->page(), "start");
    window.showCase();
    window.navigator().setFocus();
    window.showHelp();
    EXPECT_EQ(window.help()->page(), "procedure");
    window.sheet().setFocus();
    window.showHelp();
    EXPECT_EQ(window.help()->page(), "images");
}

TEST(Shortcuts, AreThoseOfTheActionsAndNoTwoAreTheSame) {
    test::DesktopAtHand desktop;
    const std::vector<Shortcut> shortcuts = shortcutsOf(desktop.window_);
    EXPECT_GE(shortcuts.size(), 8u);
    bool undo = false;
    for (const Shortcut& a : shortcuts) {
        EXPECT_FALSE(a.what.contains('&'));
        undo = undo || (a.keys == "Ctrl+Z" && a.what.startsWith("Undo"));
        int same = 0;
        for (const Shortcut& b : shortcuts)
            same += a.keys == b.keys ? 1 : 0;
        EXPECT_EQ(same, 1) << a.keys.toStdString();
    }
    EXPECT_TRUE(undo);
}

}  // namespace
}  // namespace fluorocut::ui
