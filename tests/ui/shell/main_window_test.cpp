#include "ui/shell/main_window.h"

#include <QAction>
#include <QDockWidget>
#include <QDropEvent>
#include <QLabel>
#include <QMenuBar>
#include <QMimeData>
#include <QPushButton>
#include <QSignalSpy>
#include <QTest>
#include <QUrl>
#include <fstream>
#include <thread>

#include <gtest/gtest.h>

#include "core/geometry/primitives.h"
#include "core/io/image_file.h"
#include "core/io/mesh_file.h"
#include "core/io/volume_file.h"
#include "tests/support/fixtures.h"
#include "tests/ui/shell/desktop_at_hand.h"
#include "ui/panels/navigator.h"
#include "ui/session/autosave.h"
#include "ui/session/case_document.h"
#include "ui/shell/message_bar.h"
#include "ui/shell/settings.h"
#include "ui/shell/start_page.h"

namespace fluorocut::ui {
namespace {

using namespace std::chrono_literals;
using test::DesktopAtHand;

class MainWindowTest : public testing::Test, public DesktopAtHand {
  protected:
    QString file(const std::string& name) { return QString::fromStdString((scratch_ / name).string()); }
    QString imageFile(const std::string& name) {
        Image image(32, 24);
        for (int x = 0; x < 32; ++x)
            image(x, 5) = static_cast<float>(x);
        EXPECT_OK(writeImage(scratch_ / name, image));
        return file(name);
    }
    QString garbage(const std::string& name, const std::string& content) {
        std::ofstream(scratch_ / name, std::ios::binary) << content;
        return file(name);
    }
    void drop(const QList<QUrl>& urls) {
        QMimeData data;
        data.setUrls(urls);
        QDragEnterEvent enter({50, 50}, Qt::CopyAction, &data, Qt::LeftButton, Qt::NoModifier);
        QApplication::sendEvent(&window_, &enter);
        EXPECT_TRUE(enter.isAccepted());
        QDropEvent event(QPointF(50, 50), Qt::CopyAction, &data, Qt::LeftButton, Qt::NoModifier);
        QApplication::sendEvent(&window_, &event);
    }
    QAction* action(const QString& name) { return window_.findChild<QAction*>(name); }
};

TEST_F(MainWindowTest, SaysWhatItIsAndBeginsWithTheStartPage) {
    EXPECT_TRUE(window_.windowTitle().contains("not a medical device"));
    EXPECT_TRUE(window_.showsStart());
    bool noticed = false;
    for (const QLabel* label : window_.findChildren<QLabel*>())
        noticed = noticed || (label->isVisibleTo(&window_) && label->text().contains("not a medical device"));
    EXPECT_TRUE(noticed);
}

TEST_F(MainWindowTest, OneClickOpensTheSampleCase) {
    QSignalSpy opened(&window_, &MainWindow::opened);
    QTest::mouseClick(window_.startPage().sampleButton(), Qt::LeftButton);
    ASSERT_TRUE(opened.wait());
    EXPECT_TRUE(opened.at(0).at(0).toBool());
    EXPECT_FALSE(window_.showsStart());
    EXPECT_EQ(session_.state()->patient, DesktopAtHand::kPatient);
    EXPECT_FALSE(session_.canUndo());
    EXPECT_TRUE(window_.windowTitle().startsWith("Sample case"));
    EXPECT_TRUE(window_.messages().sentence().isEmpty());
    EXPECT_FALSE(window_.navigator().rows().empty());
}

TEST_F(MainWindowTest, AFileOfEveryKindComesIntoTheCase) {
    QSignalSpy opened(&window_, &MainWindow::opened);
    window_.openFiles({imageFile("a.png"), imageFile("b.tif")});
    ASSERT_TRUE(opened.wait());
    ASSERT_EQ(session_.state()->views.size(), 2u);
    EXPECT_EQ(session_.state()->views[0].name, "a");
    EXPECT_FALSE(session_.state()->views[0].before.unregistered_because.empty());
    EXPECT_EQ(session_.state()->views[0].carm.columns, 32);
    EXPECT_FALSE(session_.canUndo());  // the case began with them

    VolumeGrid grid;
    grid.size = {5, 6, 7};
    ASSERT_OK(writeVolume(scratch_ / "ct.nrrd", Volume(grid, 100.0F)));
    window_.openFiles({file("ct.nrrd")});
    ASSERT_TRUE(opened.wait());
    ASSERT_NE(session_.state()->ct, nullptr);
    EXPECT_EQ(session_.state()->ct->grid().size, grid.size);
    EXPECT_TRUE(session_.undoText().contains("ct.nrrd"));

    ASSERT_OK(writeMesh(scratch_ / "stem.stl", makeFrustum(5, 9, 130, 48)));
    window_.openFiles({file("stem.stl")});
    ASSERT_TRUE(opened.wait());
    EXPECT_NE(session_.state()->plan.mesh, nullptr) << opened.at(2).at(1).toString().toStdString();
    session_.undo();
    EXPECT_EQ(session_.state()->plan.mesh, nullptr);
    EXPECT_NE(session_.state()->ct, nullptr);
}

TEST_F(MainWindowTest, ASavedCaseIsOpenedAndGoneOnWithInItsFile) {
    CaseState state;
    state.patient = "from a file";
    ASSERT_OK(writeCase(scratch_ / "hip.fluorocut", state));
    QSignalSpy opened(&window_, &MainWindow::opened);
    drop({QUrl::fromLocalFile(file("hip.fluorocut"))});
    ASSERT_TRUE(opened.wait());
    EXPECT_EQ(session_.state()->patient, "from a file");
    QSignalSpy saved(&window_.autosave(), &Autosave::saved);
    CaseState next = *session_.state();
    next.side = "right";
    session_.commit("Side", next);
    ASSERT_TRUE(saved.wait());
    EXPECT_EQ(readCase(scratch_ / "hip.fluorocut")->side, "right");
    EXPECT_EQ(settings_.recentFiles().first(), file("hip.fluorocut"));
}

TEST_F(MainWindowTest, WhatCannotBeOpenedIsOneSentenceAndNothingElse) {
    QSignalSpy opened(&window_, &MainWindow::opened);
    const QStringList bad{
        garbage("empty.png", ""),
        garbage("cut.png", "\x89PNG\r\n\x1a\n" + std::string(20, '\0')),
        garbage("noise.dcm", std::string(300, '\xab')),
        garbage("text.stl", "solid what\nnothing\n"),
        garbage("huge.nrrd", "NRRD0004\ntype: float\ndimension: 3\nsizes: 99999 99999 99999\nencoding: raw\n\n"),
        garbage("note.txt", "hello"),
        garbage("fake.fluorocut", std::string("SQLite format 3\0", 16) + std::string(200, 'x')),
        garbage("some.json", "{}"),
        file("nowhere.png"),
        QString::fromStdString(scratch_.path().string())};
    for (const QString& path : bad) {
        opened.clear();
        drop({QUrl::fromLocalFile(path)});
        ASSERT_TRUE(opened.wait()) << path.toStdString();
        EXPECT_FALSE(opened.at(0).at(0).toBool()) << path.toStdString();
        const QString sentence = window_.messages().sentence();
        EXPECT_TRUE(window_.messages().isError());
        EXPECT_TRUE(sentence.contains(QFileInfo(path).fileName())) << sentence.toStdString();
        EXPECT_TRUE(sentence.endsWith('.')) << sentence.toStdString();
        EXPECT_FALSE(sentence.contains('\n'));
        EXPECT_TRUE(window_.showsStart());
        EXPECT_FALSE(session_.canUndo());
    }
    EXPECT_TRUE(settings_.recentFiles().isEmpty());
}

TEST_F(MainWindowTest, OneBadFileAmongGoodOnesOpensNothing) {
    QSignalSpy opened(&window_, &MainWindow::opened);
    window_.openFiles({imageFile("good.png"), garbage("bad.png", "no")});
    ASSERT_TRUE(opened.wait());
    EXPECT_FALSE(opened.at(0).at(0).toBool());
    EXPECT_TRUE(session_.state()->views.empty());
}

TEST_F(MainWindowTest, UndoAndRedoSayWhatTheyWouldDo) {
    QAction *undo = action("undo"), *redo = action("redo");
    EXPECT_FALSE(undo->isEnabled());
    CaseState next = *session_.state();
    next.side = "left";
    session_.commit("Choose side", next);
    EXPECT_TRUE(undo->isEnabled());
    EXPECT_TRUE(undo->text().contains("Choose side"));
    window_.activateWindow();  // shortcuts are the active window's
    ASSERT_TRUE(QTest::qWaitForWindowActive(&window_));
    QTest::keyClick(&window_, Qt::Key_Z, Qt::ControlModifier);
    EXPECT_EQ(session_.state()->side, "");
    EXPECT_FALSE(undo->isEnabled());
    EXPECT_TRUE(redo->text().contains("Choose side"));
    QTest::keyClick(&window_, Qt::Key_Z, Qt::ControlModifier | Qt::ShiftModifier);
    EXPECT_EQ(session_.state()->side, "left");
}

TEST_F(MainWindowTest, ANewJobReplacesARunningOne) {
    QSignalSpy opened(&window_, &MainWindow::opened);
    sample_ = [](Progress& progress) -> Result<CaseState> {
        while (!progress.isCancelled())
            std::this_thread::sleep_for(5ms);
        return cancelled("the sample");
    };
    window_.openSample();
    window_.openFiles({imageFile("a.png")});
    ASSERT_TRUE(opened.wait());
    EXPECT_EQ(opened.count(), 1);
    EXPECT_TRUE(opened.at(0).at(0).toBool());
    EXPECT_EQ(session_.state()->views.size(), 1u);
}

TEST_F(MainWindowTest, TheCancelButtonEndsAJobWithinTwoHundredMilliseconds) {
    QSignalSpy opened(&window_, &MainWindow::opened);
    sample_ = [](Progress& progress) -> Result<CaseState> {
        while (!progress.isCancelled())
            std::this_thread::sleep_for(5ms);
        return cancelled("the sample case");
    };
    window_.openSample();
    auto* button = window_.messages().findChild<QPushButton*>();
    ASSERT_TRUE(button->isVisible());
    QElapsedTimer timer;
    timer.start();
    QTest::mouseClick(button, Qt::LeftButton);
    ASSERT_TRUE(opened.wait(1000));
    EXPECT_LT(timer.elapsed(), 200);
    EXPECT_TRUE(window_.showsStart());
}

TEST(MainWindowClosing, WhileAJobRunsIsSafe) {
    std::atomic<bool> began = false, left = false;
    {
        DesktopAtHand desktop;
        desktop.sample_ = [&](Progress& progress) -> Result<CaseState> {
            began = true;
            while (!progress.isCancelled())
                std::this_thread::sleep_for(1ms);
            left = true;
            return cancelled("the sample");
        };
        desktop.window_.openSample();
        ASSERT_TRUE(QTest::qWaitFor([&] { return began.load(); }));
        EXPECT_TRUE(desktop.window_.close());
    }
    EXPECT_TRUE(left);
    QCoreApplication::processEvents();
}

TEST(MainWindowClosing, AFaultInAJobIsASentence) {
    DesktopAtHand desktop;
    desktop.sample_ = [](Progress&) -> Result<CaseState> { throw std::logic_error("sizes differ"); };
    QSignalSpy opened(&desktop.window_, &MainWindow::opened);
    desktop.window_.openSample();
    ASSERT_TRUE(opened.wait());
    EXPECT_TRUE(desktop.window_.messages().sentence().contains("sizes differ"));
}

TEST(MainWindowLayout, IsRememberedWithTheSettings) {
    test::ScratchFolder folder;
    const QString settings = QString::fromStdString((folder / "s.ini").string());
    {
        DesktopAtHand desktop(settings);
        desktop.window_.showCase();
        desktop.window_.findChild<QDockWidget*>("procedure")->hide();
        desktop.window_.close();
    }
    DesktopAtHand desktop(settings);
    desktop.window_.showCase();
    EXPECT_TRUE(desktop.window_.findChild<QDockWidget*>("procedure")->isHidden());
}

}  // namespace
}  // namespace fluorocut::ui
