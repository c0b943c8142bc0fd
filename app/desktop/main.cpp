// fluorocut: the desktop. Opens the files named on the command line, or begins with the start page.
#include <QApplication>
#include <QCommandLineParser>
#include <QIcon>
#include <QLocale>
#include <QStandardPaths>
#include <QTemporaryDir>
#include <QTranslator>
#include <cstdio>

#include "app/desktop/sample_case.h"
#include "app/desktop/screenshots.h"
#include "core/io/resources.h"
#include "ui/session/session.h"
#include "ui/shell/main_window.h"
#include "ui/shell/settings.h"
#include "ui/shell/theme.h"

namespace {

using namespace fluorocut;

int fail(int exit_code, const QString& sentence) {
    std::fprintf(stderr, "fluorocut: %s\n", qPrintable(sentence));
    return exit_code;
}

std::filesystem::path sampleCache() {
    const QString folder = QStandardPaths::writableLocation(QStandardPaths::GenericCacheLocation);
    return (folder + "/fluorocut/sample-" + QApplication::applicationVersion() +
            QString("-%1.fluorocut").arg(desktop::kSampleRevision))
        .toStdString();
}

std::optional<QSize> sizeFrom(const QString& text) {
    const QStringList parts = text.split('x');
    const QSize size = parts.size() == 2 ? QSize(parts[0].toInt(), parts[1].toInt()) : QSize();
    if (size.width() < 320 || size.height() < 240 || size.width() > 8192 || size.height() > 8192) return std::nullopt;
    return size;
}

// What is to be photographed: "--screenshot NAME OUT.png", or "[FILES...] --screenshot OUT.png".
Result<desktop::Screenshot> screenshotFrom(const QCommandLineParser& parser) {
    desktop::Screenshot shot;
    shot.files = parser.positionalArguments();
    shot.file = parser.value("screenshot");
    if (desktop::screenshotNames().contains(shot.file)) {
        shot.name = shot.file;
        if (shot.files.size() != 1)
            return invalidOption("--screenshot " + shot.name.toStdString(), "no file for the picture",
                                 "--screenshot " + shot.name.toStdString() + " OUT.png");
        shot.file = shot.files.takeFirst();
    } else if (!shot.file.contains('.')) {
        return invalidOption("--screenshot", shot.file.toStdString(),
                             "one of " + desktop::screenshotNames().join(", ").toStdString() + ", or a file");
    }
    if (parser.isSet("size")) {
        const auto size = sizeFrom(parser.value("size"));
        if (!size)
            return invalidOption("--size", parser.value("size").toStdString(), "WIDTHxHEIGHT, 320x240 to 8192x8192");
        shot.size = *size;
    }
    return shot;
}

int run(QApplication& application, const QCommandLineParser& parser) {
    const bool is_picture = parser.isSet("screenshot");
    Result<desktop::Screenshot> shot = is_picture ? screenshotFrom(parser) : desktop::Screenshot{};
    if (!shot) return fail(2, QString::fromStdString(shot.error().message()));

    // A picture must not depend on what somebody set before, nor change it.
    const QTemporaryDir passing;
    ui::Settings settings(is_picture ? passing.filePath("settings.ini") : ui::Settings::usualFile());
    if (is_picture) settings.setCaseFolder(passing.filePath("cases"));
    ui::applyTheme(application, settings.look());
    QTranslator translator;
    QString language = is_picture ? QString("en") : settings.language();
    if (parser.isSet("language")) language = parser.value("language");
    if (language.isEmpty()) language = QLocale::system().name();
    if (translator.load("fluorocut_" + language.left(2), ":/translations"))
        QApplication::installTranslator(&translator);

    ui::Session session;
    ui::MainWindow window(session, settings,
                          [cache = sampleCache()](Progress& progress) { return desktop::sampleCase(cache, progress); });
    int exit_code = 0;
    if (is_picture) {
        desktop::takeScreenshot(window, *shot, [&](const Result<void>& taken) {
            if (!taken)
                exit_code = fail(taken.error().code == ErrorCode::outputFailed ? 73 : 3,
                                 QString::fromStdString(taken.error().message()));
            QApplication::exit(exit_code);
        });
    } else if (!parser.positionalArguments().isEmpty()) {
        window.openFiles(parser.positionalArguments());
    }
    window.show();
    const int left = QApplication::exec();
    return exit_code != 0 ? exit_code : left;
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
    QApplication::setDesktopFileName("org.fluorocut.FluoroCut");
    if (const auto resources = resourceFolder(); resources)
        QApplication::setWindowIcon(QIcon(QString::fromStdString((*resources / "icons/fluorocut-128.png").string())));

    QCommandLineParser parser;
    parser.setApplicationDescription("FluoroCut. Research software, not a medical device.");
    parser.addHelpOption();
    parser.addVersionOption();
    parser.addPositionalArgument("files", "Images, a CT, an implant's mesh or a saved case to open.", "[files...]");
    parser.addOption({"screenshot",
                      "Save the window as a picture and quit: of the files, or, with one of these names before the "
                      "picture's file, of the sample case: " +
                          desktop::screenshotNames().join(", ") + ".",
                      "file or name"});
    parser.addOption({"size", "Of the picture, such as 1280x800.", "size"});
    parser.addOption({"language", "en or de, whatever the settings say.", "language"});
    if (!parser.parse(QApplication::arguments())) return fail(2, parser.errorText());
    if (parser.isSet("help")) parser.showHelp(0);
    if (parser.isSet("version")) parser.showVersion();
    if (!parser.isSet("screenshot") && QApplication::platformName() == "offscreen")
        return fail(2, "there is no screen; with --screenshot FILE the window is saved as a picture");
    return run(application, parser);
}
