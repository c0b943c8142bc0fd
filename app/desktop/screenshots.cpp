#include "app/desktop/screenshots.h"

#include <QApplication>
#include <QPixmap>
#include <QTimer>
#include <utility>

#include "core/io/atomic_file.h"
#include "ui/shell/theme.h"

namespace fluorocut::desktop {
namespace {

// For what is worked out behind the scenes once a case is open: predicted images, surfaces.
constexpr int kLookMs = 200, kMostLooks = 600;
// The panels' own numbers have no way to say that they are there.
constexpr int kSettleMs = 2500;

void whenDone(ui::MainWindow& window, int looks, const std::function<void()>& then) {
    QTimer::singleShot(kLookMs, &window, [&window, looks, then] {
        if (window.isWorking() && looks < kMostLooks) return whenDone(window, looks + 1, then);
        then();
    });
}

Result<void> save(QWidget& window, const QString& file) {
    return writeWhole(file.toStdString(), [&](const auto& temporary) -> Result<void> {
        if (window.grab().save(QString::fromStdString(temporary.string()))) return {};
        return outputFailed(file.toStdString(), "a picture that cannot be written", "name it .png");
    });
}

}  // namespace

QStringList screenshotNames() {
    return {"start", "spreadsheet", "planning", "scene", "procedure", "or-mode"};
}

void takeScreenshot(ui::MainWindow& window, const Screenshot& screenshot, std::function<void(Result<void>)> finished) {
    window.resize(screenshot.size);
    if (screenshot.name == "or-mode")
        ui::applyTheme(*qobject_cast<QApplication*>(QApplication::instance()), ui::Look::operatingRoom);
    const auto shoot = [&window, screenshot, finished](int wait_ms) {
        QTimer::singleShot(wait_ms, &window, [&window, screenshot, finished] {
            window.resize(screenshot.size);
            finished(save(window, screenshot.file));
        });
    };
    if (screenshot.name == "start") return shoot(0);
    QObject::connect(&window, &ui::MainWindow::opened, &window,
                     [shoot, finished, screenshot, &window](bool ok, const QString& sentence) {
                         if (!ok) return finished(invalidInput("", sentence.toStdString(), "what can be opened"));
                         window.arrangeFor(screenshot.name);
                         whenDone(window, 0, [shoot] { shoot(kSettleMs); });
                     });
    if (screenshot.files.isEmpty())
        window.openSample();
    else
        window.openFiles(screenshot.files);
}

}  // namespace fluorocut::desktop
