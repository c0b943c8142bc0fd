#include "ui/shell/main_window.h"

#include <QSignalSpy>
#include <QTest>
#include <thread>

#include <gtest/gtest.h>

#include "ui/spreadsheet/image_view.h"

namespace fluorocut::ui {
namespace {

using namespace std::chrono_literals;

MakeImages makeImages(int count) {
    return [count](Progress&) -> Result<std::vector<TitledImage>> {
        std::vector<TitledImage> images;
        for (int i = 0; i < count; ++i) {
            images.push_back({QString("image %1").arg(i), std::make_shared<Image>(8, 8, static_cast<float>(i))});
        }
        return images;
    };
}

TEST(MainWindow, SaysWhatItIs) {
    const MainWindow window;
    EXPECT_TRUE(window.windowTitle().contains("not a medical device"));
}

TEST(MainWindow, ShowsTheImagesOfAJob) {
    MainWindow window;
    QSignalSpy shown(&window, &MainWindow::shown);
    window.show("Femur", "Simulating", 2, makeImages(2));
    ASSERT_EQ(window.views().size(), 2u);
    EXPECT_EQ(window.views()[0]->image(), nullptr);
    ASSERT_TRUE(shown.wait());
    EXPECT_TRUE(shown.at(0).at(0).toBool());
    ASSERT_EQ(window.views().size(), 2u);
    EXPECT_EQ((*window.views()[1]->image())(0, 0), 1.0F);
    EXPECT_TRUE(window.windowTitle().startsWith("Femur"));
}

TEST(MainWindow, MakesRoomForMoreImagesThanExpected) {
    MainWindow window;
    QSignalSpy shown(&window, &MainWindow::shown);
    window.show("Case", "Reading", 1, makeImages(5));
    ASSERT_TRUE(shown.wait());
    EXPECT_EQ(window.views().size(), 5u);
}

TEST(MainWindow, AnErrorIsASentenceInTheWindow) {
    MainWindow window;
    QSignalSpy shown(&window, &MainWindow::shown);
    window.show("x.png", "Reading", 1, [](Progress&) -> Result<std::vector<TitledImage>> {
        return invalidInput("x.png", "no such file", "an image");
    });
    ASSERT_TRUE(shown.wait());
    EXPECT_FALSE(shown.at(0).at(0).toBool());
    EXPECT_TRUE(shown.at(0).at(1).toString().contains("x.png"));
}

TEST(MainWindow, ANewJobReplacesARunningOne) {
    MainWindow window;
    QSignalSpy shown(&window, &MainWindow::shown);
    window.show("first", "Simulating", 1, [](Progress& progress) -> Result<std::vector<TitledImage>> {
        while (!progress.isCancelled())
            std::this_thread::sleep_for(5ms);
        return cancelled("first");
    });
    window.show("second", "Reading", 3, makeImages(3));
    ASSERT_TRUE(shown.wait());
    EXPECT_EQ(shown.count(), 1);
    EXPECT_TRUE(shown.at(0).at(0).toBool());
    EXPECT_EQ(window.views().size(), 3u);
}

}  // namespace
}  // namespace fluorocut::ui
