// The main of the tests with Qt: without a screen unless told otherwise, in the look of the desktop.
#include <QApplication>

#include <gtest/gtest.h>

#include "ui/shell/theme.h"

int main(int argc, char** argv) {
    testing::InitGoogleTest(&argc, argv);
    if (qEnvironmentVariableIsEmpty("QT_QPA_PLATFORM")) qputenv("QT_QPA_PLATFORM", "offscreen");
    QApplication application(argc, argv);
    fluorocut::ui::applyTheme(application);
    return RUN_ALL_TESTS();
}
