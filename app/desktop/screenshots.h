// Pictures of the desktop, each of one of its states on the sample case, for the manual and to be looked at:
//
//     fluorocut --screenshot planning planning.png --size 1280x800
//
// The window is laid out, the case is opened, and when nothing is being worked out any more it is drawn into the file;
// no screen is needed.
#pragma once

#include <QSize>
#include <QString>
#include <QStringList>
#include <functional>

#include "core/base/result.h"
#include "ui/shell/main_window.h"

namespace fluorocut::desktop {

// start, spreadsheet, ...
QStringList screenshotNames();

struct Screenshot {
    QString name;  // one of them; empty: what the window shows once `files` are open
    QString file;
    QSize size{1920, 1080};
    QStringList files;
};

// Opens what is to be seen and calls `finished` with what became of it, once.
void takeScreenshot(ui::MainWindow& window, const Screenshot& screenshot, std::function<void(Result<void>)> finished);

}  // namespace fluorocut::desktop
