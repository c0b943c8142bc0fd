// Every string can be translated: with a made-up language in which each is longer and has brackets, nothing without
// brackets may be seen and nothing may be cut off. And the German translation has every string that was asked for.
#include <QAbstractButton>
#include <QAction>
#include <QApplication>
#include <QDockWidget>
#include <QFile>
#include <QLabel>
#include <QMenu>
#include <QMenuBar>
#include <QRegularExpression>
#include <QSignalSpy>
#include <QStatusBar>
#include <QTest>
#include <QTranslator>
#include <QXmlStreamReader>
#include <map>
#include <set>

#include <gtest/gtest.h>

#include "core/io/resources.h"
#include "tests/support/fixtures.h"
#include "tests/ui/shell/desktop_at_hand.h"
#include "ui/shell/message_bar.h"
#include "ui/shell/settings.h"
#include "ui/shell/settings_dialog.h"
#include "ui/shell/start_page.h"

namespace fluorocut::ui {
namespace {

using Asked = std::pair<QString, QString>;  // context, source

// 40 % longer, as translations are; it notes what it was asked for.
class PseudoLanguage : public QTranslator {
  public:
    QString translate(const char* context, const char* source, const char*, int) const override {
        if (!QString(context).contains("fluorocut") && QString(context) != "CaseSteps") return {};
        asked.insert({context, source});
        const QString text = QString::fromUtf8(source);
        return "[" + text + QString(text.size() * 2 / 5, QChar(0x00e9)) + "]";
    }
    bool isEmpty() const override { return false; }

    mutable std::set<Asked> asked;
};

bool isTranslated(const QString& text) {
    static const QRegularExpression kWord("[A-Za-z]{2,}");
    // Names: of the program, and of languages in themselves.
    static const QStringList kNames{"FluoroCut", "English", "Deutsch", "3D"};
    return text.contains('[') || kNames.contains(text) || !kWord.match(text).hasMatch();
}

class Translation : public testing::Test {
  protected:
    Translation() { QApplication::installTranslator(&language_); }
    ~Translation() override { QApplication::removeTranslator(&language_); }

    void look(const QWidget& part) {
        for (const QWidget* widget : part.findChildren<QWidget*>()) {
            if (!widget->isVisibleTo(part.window())) continue;
            QString text;
            bool wraps = false;
            if (const auto* label = qobject_cast<const QLabel*>(widget)) {
                text = label->text();
                wraps = label->wordWrap();
            } else if (const auto* button = qobject_cast<const QAbstractButton*>(widget)) {
                text = button->text();
            }
            if (text.isEmpty()) continue;
            ++texts_;
            EXPECT_TRUE(isTranslated(text)) << text.toStdString() << " is not translated";
            if (!wraps && widget->isVisible()) {
                EXPECT_GE(widget->width(), widget->minimumSizeHint().width()) << text.toStdString() << " is cut off";
            }
        }
    }
    void look(const QMenu& menu) {
        for (const QAction* action : menu.actions()) {
            if (action->isSeparator()) continue;
            ++texts_;
            EXPECT_TRUE(isTranslated(action->text())) << action->text().toStdString() << " is not translated";
            if (action->menu()) look(*action->menu());
        }
    }

    PseudoLanguage language_;
    int texts_ = 0;
};

TEST_F(Translation, NothingOfTheShellIsLeftOutOrCutOff) {
    test::DesktopAtHand desktop;
    MainWindow& window = desktop.window_;
    QApplication::processEvents();
    look(window.startPage());
    for (const QAction* action : window.menuBar()->actions()) {
        EXPECT_TRUE(isTranslated(action->text())) << action->text().toStdString();
        look(*action->menu());
    }
    window.messages().showError(MainWindow::tr("Opening %1").arg("x"));
    look(window.messages());
    look(*window.statusBar());
    SettingsDialog dialog(desktop.settings_);
    dialog.show();
    QApplication::processEvents();
    look(dialog);
    EXPECT_GE(texts_, 40);  // or something was not looked at
    QSignalSpy opened(&window, &MainWindow::opened);
    window.openSample();
    ASSERT_TRUE(opened.wait());
    EXPECT_TRUE(isTranslated(window.windowTitle()));
    for (const QDockWidget* dock : window.findChildren<QDockWidget*>())
        EXPECT_TRUE(isTranslated(dock->windowTitle())) << dock->windowTitle().toStdString();
}

std::map<Asked, QString> translationsIn(const QString& language) {
    std::map<Asked, QString> found;
    const auto folder = resourceFolder();
    EXPECT_OK(folder);
    QFile file(QString::fromStdString((*folder / "translations").string()) + "/fluorocut_" + language + ".ts");
    EXPECT_TRUE(file.open(QIODevice::ReadOnly));
    QXmlStreamReader xml(&file);
    QString context, source;
    while (!xml.atEnd()) {
        if (xml.readNext() != QXmlStreamReader::StartElement) continue;
        if (xml.name() == QLatin1String("name")) context = xml.readElementText();
        if (xml.name() == QLatin1String("source")) source = xml.readElementText();
        if (xml.name() == QLatin1String("translation")) {
            EXPECT_FALSE(xml.attributes().hasAttribute("type")) << source.toStdString() << " is unfinished or obsolete";
            found[{context, source}] = xml.readElementText(QXmlStreamReader::IncludeChildElements);
        }
    }
    EXPECT_FALSE(xml.hasError()) << xml.errorString().toStdString();
    return found;
}

TEST_F(Translation, GermanHasEveryStringThatTheShellAskedForWithItsPlaces) {
    const std::map<Asked, QString> german = translationsIn("de");
    EXPECT_GT(german.size(), 100u);
    std::set<QString> contexts;
    static const QRegularExpression kPlace("%(\\d|n)");
    for (const auto& [asked, text] : german) {
        contexts.insert(asked.first);
        EXPECT_FALSE(text.trimmed().isEmpty()) << asked.second.toStdString();
        std::set<QString> wanted, there;
        for (auto match = kPlace.globalMatch(asked.second); match.hasNext();)
            wanted.insert(match.next().captured());
        for (auto match = kPlace.globalMatch(text); match.hasNext();)
            there.insert(match.next().captured());
        EXPECT_EQ(wanted, there) << asked.second.toStdString();
    }
    test::DesktopAtHand desktop;
    QSignalSpy opened(&desktop.window_, &MainWindow::opened);
    desktop.window_.openSample();
    ASSERT_TRUE(opened.wait());
    const SettingsDialog dialog(desktop.settings_);
    for (const Asked& asked : language_.asked) {
        if (!contexts.contains(asked.first)) continue;  // of parts that are not translated yet
        EXPECT_TRUE(german.contains(asked)) << asked.second.toStdString() << " in " << asked.first.toStdString();
    }
}

}  // namespace
}  // namespace fluorocut::ui
