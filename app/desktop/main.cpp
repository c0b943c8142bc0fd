// fluorocut: the desktop. Shows the images named on the command line, or simulated views of the built-in femur.
#include <QApplication>
#include <QCommandLineParser>
#include <QPixmap>
#include <QTimer>
#include <cstdio>

#include "app/desktop/images.h"
#include "core/io/atomic_file.h"
#include "ui/shell/main_window.h"
#include "ui/shell/theme.h"

namespace {

int fail(int exit_code, const QString& sentence) {
    std::fprintf(stderr, "fluorocut: %s\n", qPrintable(sentence));
    return exit_code;
}

fluorocut::Result<void> saveScreenshot(QWidget& window, const QString& file) {
    return fluorocut::writeWhole(file.toStdString(), [&](const auto& temporary) -> fluorocut::Result<void> {
        if (window.grab().save(QString::fromStdString(temporary.string()))) return {};
        return fluorocut::outputFailed(file.toStdString(), "a picture that cannot be written", "name it .png");
    });
}

}  // namespace

int main(int argc, char** argv) {
    // Without a screen: pictures can still be taken.
    if (qEnvironmentVariableIsEmpty("QT_QPA_PLATFORM") && qEnvironmentVariableIsEmpty("DISPLAY") &&
        qEnvironmentVariableIsEmpty("WAYLAND_DISPLAY")) {
        qputenv("QT_QPA_PLATFORM", "offscreen");
    }
    QApplication application(argc, argv);
    QApplication::setApplicationName("fluorocut");
    QApplication::setApplicationVersion(FLUOROCUT_VERSION);
    fluorocut::ui::applyTheme(application);

    QCommandLineParser parser;
    parser.setApplicationDescription("FluoroCut. Research software, not a medical device.");
    parser.addHelpOption();
    parser.addVersionOption();
    parser.addPositionalArgument("images", "Images to show; without any, simulated views of the built-in femur.",
                                 "[images...]");
    const QCommandLineOption screenshot("screenshot", "Save the window as a picture and quit.", "file");
    parser.addOption(screenshot);
    if (!parser.parse(QApplication::arguments())) return fail(2, parser.errorText());
    if (parser.isSet("help")) parser.showHelp(0);
    if (parser.isSet("version")) parser.showVersion();
    const QString picture = parser.value(screenshot);
    if (picture.isEmpty() && QApplication::platformName() == "offscreen") {
        return fail(2, "there is no screen; with --screenshot FILE the window is saved as a picture");
    }

    fluorocut::ui::MainWindow window;
    const auto showFiles = [&window](const QStringList& files) {
        const QString subject = files.size() == 1 ? files.first() : QObject::tr("%1 images").arg(files.size());
        window.show(subject, QObject::tr("Reading"), files.size(), fluorocut::desktop::imagesOf(files));
    };
    QObject::connect(&window, &fluorocut::ui::MainWindow::openRequested, showFiles);
    int exit_code = 0;
    if (!picture.isEmpty()) {
        QObject::connect(&window, &fluorocut::ui::MainWindow::shown, [&](bool ok, const QString& sentence) {
            // After the event loop has laid the views out.
            QTimer::singleShot(0, &window, [&, ok, sentence] {
                const fluorocut::Result<void> saved = saveScreenshot(window, picture);
                if (!ok)
                    exit_code = fail(3, sentence);
                else if (!saved)
                    exit_code = fail(73, QString::fromStdString(saved.error().message()));
                QApplication::exit(exit_code);
            });
        });
    }
    window.show();
    if (parser.positionalArguments().isEmpty()) {
        window.show(QObject::tr("Built-in femur"), QObject::tr("Simulating fluoroscopy of the built-in femur"), 2,
                    fluorocut::desktop::femurViews());
    } else {
        showFiles(parser.positionalArguments());
    }
    return QApplication::exec();
}
