#include "ui/shell/settings.h"

#include <QDir>
#include <QFileInfo>
#include <QStandardPaths>

namespace fluorocut::ui {
namespace {

const QStringList kLooks{"dark", "light", "operating-room"};
const QStringList kLanguages{"", "en", "de"};

}  // namespace

Settings::Settings(const QString& file, QObject* parent) : QObject(parent), store_(file, QSettings::IniFormat) {}

QString Settings::usualFile() {
    return QStandardPaths::writableLocation(QStandardPaths::GenericConfigLocation) + "/fluorocut/desktop.ini";
}

Look Settings::look() const {
    return static_cast<Look>(std::max(0, static_cast<int>(kLooks.indexOf(store_.value("look").toString()))));
}

void Settings::setLook(Look look) {
    if (look == this->look()) return;
    store_.setValue("look", kLooks.at(static_cast<int>(look)));
    emit lookChanged(look);
}

QString Settings::language() const {
    const QString language = store_.value("language").toString();
    return kLanguages.contains(language) ? language : QString();
}

void Settings::setLanguage(const QString& language) {
    store_.setValue("language", language);
}

QString Settings::caseFolder() const {
    const QString folder = store_.value("case_folder").toString();
    if (!folder.isEmpty()) return folder;
    return QStandardPaths::writableLocation(QStandardPaths::GenericDataLocation) + "/fluorocut/cases";
}

void Settings::setCaseFolder(const QString& folder) {
    store_.setValue("case_folder", folder);
}

QStringList Settings::recentFiles() const {
    QStringList files;
    for (const QString& file : store_.value("recent").toStringList())
        if (QFileInfo::exists(file)) files << file;
    return files;
}

void Settings::addRecent(const QString& file) {
    const QString path = QFileInfo(file).absoluteFilePath();
    QStringList files = recentFiles();
    files.removeAll(path);
    files.prepend(path);
    store_.setValue("recent", QStringList(files.mid(0, kMostRecent)));
    emit recentChanged();
}

void Settings::clearRecent() {
    store_.remove("recent");
    emit recentChanged();
}

}  // namespace fluorocut::ui
